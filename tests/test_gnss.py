"""GNSS only where it is: sensors, timestamping methods and clocks that need it, stage by stage."""

from __future__ import annotations

import itertools
import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from syncline_design.choice.decide import choose
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice, Infeasible
from syncline_design.choice.problem import build_problem, selection_of
from syncline_design.choice.ranked import iter_best
from syncline_design.cli.app import app
from syncline_design.spec.load import BadInput, load
from syncline_design.spec.selection import ClockSelection, RoleSelection, Selection
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.recheck_facts import impossible
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

QUICK = CheckSettings(monte_carlo=False)

Stage = dict[str, Any]


def single(**keys: Any) -> Stage:
    """A stage of one vehicle: position, attitude and ranging, all stamped by `hardware`."""
    sensors = {
        "position": {"modality": "position", "sigma_position": "10 cm", "primitives": ["pps"]},
        "attitude": {"modality": "attitude", "sigma_attitude": "0.1 deg", "primitives": ["pps"]},
        "ranging": {
            "modality": "ranging", "sigma_range": "1 cm", "sigma_bearing": "0.1 deg",
            "primitives": ["pps"],
        },
    }  # fmt: skip
    platform = {"v_max": "2 m/s", "omega_max": "9 deg/s", "distance": "30 m", "baseline": "1 m"}
    roles = {
        role: {"sensor": sensor, "primitive": "pps", "timestamping": "hardware"}
        for role, sensor in sensors.items()
    }
    return {"name": "fish", "platform": platform, **roles, **keys}


def later(name: str, **keys: Any) -> Stage:
    found = single(name=name, **keys)
    del found["position"]
    return found


def written(folder: Path, *stages: Stage, parts: Stage | None = None, **keys: Any) -> Path:
    """The spec of some stages in a folder, with a catalog of its own."""
    (folder / "parts.yaml").write_text(json.dumps(parts or {"sensors": {}}))
    spec: Stage = {
        "syncline": 1, "name": "where GNSS is", "catalogs": ["parts.yaml"],
        "requirements": [{"id": "ACC-1", "kind": "accuracy", "limit": "10 m"}],
        "objective": "error", "stages": list(stages),
    }  # fmt: skip
    path = folder / "spec.yaml"
    path.write_text(json.dumps(spec | keys, indent=1))
    return path


def stamped(stage: Stage, role: str, method: Any) -> Stage:
    """The stage with one role stamped otherwise."""
    return stage | {role: stage[role] | {"timestamping": method}}


def facts(verdict: dict[str, Any]) -> dict[str, Any] | None:
    rows = [row for row in verdict["requirements"] if row["id"] == "FACTS"]
    assert all(row["kind"] == "feasible" and row["implied"] for row in rows)
    return rows[0] if rows else None


# ------------------------------------------------------------------ where GNSS is

SINGLE: list[tuple[Stage, bool]] = [
    ({}, True),
    ({"depth": "0 m"}, True),
    ({"depth": "300 m"}, False),
    ({"depth": "1 mm"}, False),
    ({"gnss": "no"}, False),
    ({"gnss": False}, False),
    ({"gnss": "yes", "depth": "300 m"}, True),  # says so itself: a buoy on a line
    ({"gnss": True}, True),
    ({"gnss": "no", "depth": "0 m"}, False),
]


@pytest.mark.parametrize("method", ["pps_gnss", "pps_gnss_50us"])
@pytest.mark.parametrize(("keys", "has"), SINGLE)
def test_a_pinned_method_of_a_single_stage(
    keys: Stage, has: bool, method: str, tmp_path: Path
) -> None:
    path = written(tmp_path, stamped(single(**keys), "attitude", method))
    found = check_file(path, QUICK)
    verdict = found.to_json()
    assert verdict["verdict"] == ("meets" if has else "fails")
    row = facts(verdict)
    assert (row is None) == has
    if row is not None:
        assert row["status"] == "fail"
        assert row["value"] == 1
        assert row["margin"] < 0
        assert method in row["note"]
        assert found.exit_code == 1
        (gone,) = verdict["choice"]["excluded"]
        assert gone["code"] == "gnss"
        assert (gone["stage"], gone["role"], gone["method"]) == ("fish", "attitude", method)
    else:
        assert verdict["choice"] == {"excluded": [], "excluded_count": 0}


@pytest.mark.parametrize("clock", ["pps_gpio", "pps_hardware", "pps_usb", "ptp", "ntp"])
@pytest.mark.parametrize(("keys", "has"), SINGLE)
def test_a_pinned_clock_of_a_single_stage(
    keys: Stage, has: bool, clock: str, tmp_path: Path
) -> None:
    path = written(tmp_path, single(**keys, clock=clock))
    verdict = check_file(path, QUICK).to_json()
    assert verdict["verdict"] == ("meets" if has else "fails")
    assert (facts(verdict) is None) == has
    roles = [(gone["role"], gone["sensor"]) for gone in verdict["choice"]["excluded"]]
    assert roles == ([] if has else [("clock", clock)])


@pytest.mark.parametrize("clock", ["free_running", "tcxo", "ocxo", "ocxo_disciplined", "rubidium"])
def test_oscillators_dive(clock: str, tmp_path: Path) -> None:
    """What was set before the dive needs no GNSS in it."""
    verdict = check_file(written(tmp_path, single(depth="300 m", clock=clock)), QUICK).to_json()
    assert facts(verdict) is None


@pytest.mark.parametrize(("keys", "has"), SINGLE)
def test_a_sensor_of_type_gnss(keys: Stage, has: bool, tmp_path: Path) -> None:
    receiver = {"sensor": "ublox_f9p_rtk", "primitive": "pps", "timestamping": "hardware"}
    verdict = check_file(written(tmp_path, single(**keys, position=receiver)), QUICK).to_json()
    assert verdict["verdict"] == ("meets" if has else "fails")
    if not has:
        (gone,) = verdict["choice"]["excluded"]
        assert (gone["sensor"], gone["primitive"], gone["method"]) == ("ublox_f9p_rtk", None, None)


RECEIVERS = ["gnss", " GNSS ", "gnss_rtk", "rtk gnss", "GNSS/INS", "gnss-compass", "GPS", "dgps",
             "Galileo", "rtk", "ppp", "QZSS", "navic", "psrtk", "network RTK", "PPK", "satnav",
             "satellite_compass", "Global Positioning System", "egnos", "satellite", "NAVSTAR",
             "vrs", "NTRIP rover", "MSAS", "gagan", "OmniSTAR"]  # fmt: skip
OTHERS = ["", "ins", "usbl", "total_station", "total station", "pingpong", "artkit", "lbl",
          "local positioning", "pppp", "uwb", "starlink", "star tracker", "vrsx"]  # fmt: skip


@pytest.mark.parametrize("kind", [*RECEIVERS, *OTHERS])
def test_a_receiver_by_any_of_its_names(kind: str, tmp_path: Path) -> None:
    """Oracle: the two lists, by what the words mean; solvers and recheck agree on each."""
    antenna = single(depth="50 m")["position"]
    antenna = antenna | {"sensor": antenna["sensor"] | {"type": kind}}
    path = written(tmp_path, single(depth="50 m", position=antenna))
    assert check_file(path, QUICK).to_json()["verdict"] == (
        "fails" if kind in RECEIVERS else "meets"
    )
    roles = [RoleSelection("fish", role, f"fish.{role}", "pps", "hardware")  # type: ignore[arg-type]
             for role in ("position", "attitude", "ranging")]  # fmt: skip
    named = impossible(load(path), Selection(tuple(roles), (ClockSelection("fish", None),)))
    assert len(named) == (kind in RECEIVERS)


@pytest.mark.parametrize(("keys", "has"), SINGLE)
@pytest.mark.parametrize("kind", ["", " ", "lbl"])
def test_a_position_sensor_of_no_type_is_told_of_where_gnss_is_not(
    kind: str, keys: Stage, has: bool, tmp_path: Path
) -> None:
    """Only its type tells that a receiver is one: a silent entry met 50 m down without a word."""
    antenna = single(**keys)["position"]
    antenna = antenna | {"sensor": antenna["sensor"] | {"type": kind}}
    verdict = check_file(written(tmp_path, single(**keys, position=antenna)), QUICK).to_json()
    told = [one for one in verdict["warnings"] if one.get("key") == "type"]
    assert bool(told) == (not has and not kind.strip())
    assert all((one["key"], "GNSS" in one["message"]) == ("type", True) for one in told)


ship = {"clock": "pps_gpio"}
CHAINS: list[tuple[list[Stage], list[bool], list[bool]]] = [
    # keys of the stages; which have GNSS, which its time
    ([{}, {}], [True, False], [True, False]),
    ([{}, {"gnss": "yes"}], [True, True], [True, True]),
    ([{"gnss": "no"}, {}], [False, False], [False, False]),
    ([{}, {"timing_from": "s0"}], [True, False], [True, True]),
    ([{}, {"timing_from": "s0", "depth": "50 m"}], [True, False], [True, True]),
    ([{"gnss": "no"}, {"timing_from": "s0"}], [False, False], [False, False]),
    ([{}, {"timing_from": "s0"}, {"timing_from": "s1"}], [True, False, False], [True, True, True]),
    ([{}, {"timing_from": "s2"}, {"gnss": "yes"}], [True, False, True], [True, True, True]),
    ([{}, {}, {"timing_from": "s1"}], [True, False, False], [True, False, False]),
    ([{"depth": "9 m", "timing_from": "s1"}, {"gnss": "yes"}], [False, True], [True, True]),
]


@pytest.mark.parametrize("case", range(len(CHAINS)))
def test_cables_pass_time_on_and_no_antenna(case: int, tmp_path: Path) -> None:
    """Stage by stage a method, a clock and a sensor that need GNSS: refused where it is not."""
    keys, received, timed = CHAINS[case]
    compass = {"sensor": {"modality": "attitude", "type": "GNSS", "sigma_attitude": "0.1 deg",
                          "primitives": ["pps"]}, "primitive": "pps",
               "timestamping": "hardware"}  # fmt: skip
    for at, what in itertools.product(range(len(keys)), ("method", "clock", "sensor")):
        stages = [
            (single if i == 0 else later)(**(own | {"name": f"s{i}"})) for i, own in enumerate(keys)
        ]
        if what == "method":
            stages[at] = stamped(stages[at], "ranging", "pps_gnss")
        else:
            stages[at] |= {"clock": "pps_gpio"} if what == "clock" else {"attitude": compass}
        path = written(tmp_path, *stages)
        allowed = received[at] if what == "sensor" else timed[at]
        assert (facts(check_file(path, QUICK).to_json()) is None) == allowed, (at, what)


def test_stages_on_one_vehicle_share_its_clock(tmp_path: Path) -> None:
    """The host of a ship may be disciplined by GNSS though a stage on it has no antenna; what
    stamps straight from GNSS stands where it has it."""
    ship = single(name="ship", vehicle="ship", clock="pps_gpio")
    fish = later("fish", vehicle="ship", depth="20 m")
    assert facts(check_file(written(tmp_path, ship, fish), QUICK).to_json()) is None
    straight = stamped(fish, "ranging", "pps_gnss")
    assert facts(check_file(written(tmp_path, ship, straight), QUICK).to_json()) is not None
    cable = straight | {"timing_from": "ship"}
    assert facts(check_file(written(tmp_path, ship, cable), QUICK).to_json()) is None


# ------------------------------------------------------------------ catalogs of one's own

OWN = {
    "sensors": {
        "listener": {
            "modality": "attitude", "type": "compass", "needs": ["gnss"],
            "sigma_attitude": "0.1 deg", "primitives": ["pps", "network"],
        },
    },
    "infrastructure": {"beacon": {"channels": 4, "needs": ["gnss"]}},
    "timestamping": {
        "by_sky": {
            "primitives": ["pps"], "timeline": "utc", "needs": ["gnss"],
            "error": {"distribution": "constant", "value": "1 us"},
        },
        "by_beacon": {
            "primitives": ["pps"], "timeline": "utc", "requires": {"beacon": 1},
            "error": {"distribution": "constant", "value": "1 us"},
        },
        "by_grandmaster": {
            "primitives": ["pps"], "timeline": "utc", "requires": {"ptp_grandmaster": 1},
            "error": {"distribution": "constant", "value": "1 us"},
        },
        "by_chance": {
            "primitives": ["pps"], "timeline": "utc",
            "error": {"distribution": "constant", "value": "1 us"},
        },
    },
    "clocks": {
        "sky": {"offset": {"distribution": "constant", "value": "1 us"}, "needs": ["gnss"]},
        "chip": {"offset": {"distribution": "constant", "value": "1 us"}},
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("role", "name"),
    [
        ("attitude", "listener"), ("method", "by_sky"), ("method", "by_beacon"),
        ("method", "by_grandmaster"), ("clock", "sky"),
    ],
)  # fmt: skip
def test_own_entries_say_what_they_need(role: str, name: str, tmp_path: Path) -> None:
    for depth in ("0 m", "40 m"):
        stage = single(depth=depth)
        if role == "method":
            stage = stamped(stage, "position", name)
        elif role == "clock":
            stage |= {"clock": name}
        else:
            stage["attitude"] = stage["attitude"] | {"sensor": name}
        verdict = check_file(written(tmp_path, stage, parts=OWN), QUICK).to_json()
        assert (facts(verdict) is None) == (depth == "0 m")


def test_what_needs_nothing_works_anywhere(tmp_path: Path) -> None:
    stage = stamped(single(depth="40 m", clock="chip"), "position", "by_chance")
    assert check_file(written(tmp_path, stage, parts=OWN), QUICK).to_json()["verdict"] == "meets"


# ------------------------------------------------------------------ the choice


def test_the_choice_leaves_out_what_cannot_work(tmp_path: Path) -> None:
    """At the surface the free GNSS pulse wins by its error; at depth, the best of the others."""
    methods = {"candidates": ["pps_gnss", "gpio", "arrival"]}
    clocks = {"candidates": ["pps_gpio", "tcxo"]}
    chosen = {}
    for depth in ("0 m", "200 m"):
        stage = single(depth=depth, clock=clocks)
        for role in ("position", "attitude", "ranging"):
            stage = stamped(stage, role, methods)
        verdict = check_file(written(tmp_path, stage), QUICK).to_json()
        assert verdict["verdict"] == "meets"
        roles = verdict["design"]["stages"][0]["roles"]
        names = {roles[role]["timestamping"] for role in roles}
        chosen[depth] = (names, verdict["design"]["clocks"][0]["id"])
        codes = [(g["role"], g["method"]) for g in verdict["choice"]["excluded"]
                 if g["code"] == "gnss"]  # fmt: skip
        assert len(codes) == (0 if depth == "0 m" else 4)
        assert verdict["choice"]["excluded_count"] == len(verdict["choice"]["excluded"])
    assert chosen["0 m"] == ({"pps_gnss"}, "pps_gpio")
    assert chosen["200 m"] == ({"gpio"}, "tcxo")


@pytest.mark.parametrize("what", ["method", "clock", "sensor"])
def test_nothing_left_is_infeasible_and_says_why(what: str, tmp_path: Path) -> None:
    stage = single(depth="200 m")
    if what == "method":
        stage = stamped(stage, "position", {"candidates": ["pps_gnss", "pps_gnss_50us"]})
    elif what == "clock":
        stage |= {"clock": {"candidates": ["pps_gpio", "pps_usb"]}}
    else:
        receivers = {"candidates": ["ublox_f9p_rtk", "ublox_f9p_pvt"]}
        stage["position"] = receivers | {"timestamping": "hardware"}
    path = written(tmp_path, stage)
    found = check_file(path, QUICK)
    verdict = found.to_json()
    assert verdict["verdict"] == "infeasible"
    assert found.exit_code == 1
    (gap,) = verdict["infeasibility"]["roles_without_options"]
    assert gap["role"] == ("clock" if what == "clock" else "position")
    assert "depth: 200 m" in gap["text"]
    problem = build_problem(load(path))
    for method in ("auto", "front", "milp", "enumerate"):
        assert isinstance(choose(problem, method), Infeasible)  # type: ignore[arg-type]
    assert list(iter_best(problem)) == []
    assert front(problem) == ()


def test_remedies_offer_nothing_that_cannot_work(tmp_path: Path) -> None:
    """Stamps 16 ms late fail the accuracy; GNSS stamps would mend it, under water they cannot."""
    stage = single(depth="200 m", clock="ocxo")
    for role in ("position", "attitude", "ranging"):
        slow = stage[role] | {"timestamping": {"candidates": ["arrival", "arrival_ros"]}}
        del slow["primitive"]
        stage = stage | {role: slow}
    accuracy = [{"id": "ACC-1", "kind": "accuracy", "limit": "40 cm"},
                {"id": "SYNC-1", "kind": "sync", "limit": 1000}]  # fmt: skip
    verdict = check_file(written(tmp_path, stage, requirements=accuracy), QUICK).to_json()
    assert verdict["verdict"] == "infeasible"
    texts = [fix["text"] for fix in verdict["infeasibility"]["fixes"]]
    assert texts
    assert not [text for text in texts if "gnss" in text or "ptp" in text.split()]


def test_a_written_design_keeps_what_the_stage_says(tmp_path: Path) -> None:
    first = single(name="ship", clock={"candidates": ["pps_gpio", "tcxo"]})
    second = stamped(
        later("fish", depth="30 m", timing_from="ship"), "ranging",
        {"candidates": ["pps_gnss", "gpio"]},
    )  # fmt: skip
    path, design = written(tmp_path, first, second), tmp_path / "design.yaml"
    done = CliRunner().invoke(app, ["optimize", str(path), "--write-design", str(design)])
    assert done.exit_code == 0
    fish = yaml.safe_load(design.read_text())["stages"][1]
    assert (fish["depth"], fish["timing_from"]) == ("30 m", "ship")
    assert fish["ranging"]["timestamping"] == "pps_gnss"
    assert check_file(design, QUICK).to_json()["verdict"] == "meets"


# ------------------------------------------------------------------ against a plain loop


def expected_time(stages: list[Stage]) -> tuple[list[bool], list[bool]]:
    """(GNSS, its time) of every stage, by following each cable by hand."""
    has = []
    for i, stage in enumerate(stages):
        deep = stage.get("depth", "0 m") != "0 m"
        has.append(stage.get("gnss", "yes" if i == 0 and not deep else "no") == "yes")
    names = [stage["name"] for stage in stages]
    timed = []
    for i in range(len(stages)):
        at, seen, found = i, set(), False
        while at not in seen:
            seen.add(at)
            found = found or has[at]
            at = names.index(stages[at].get("timing_from", names[at]))
        timed.append(found)
    return has, timed


def random_stages(rng: random.Random) -> list[Stage]:
    count = rng.choice([1, 2, 3])
    stages = []
    for i in range(count):
        keys: Stage = {"name": f"s{i}"}
        if rng.random() < 0.3:
            keys["gnss"] = rng.choice(["yes", "no"])
        if rng.random() < 0.3:
            keys["depth"] = rng.choice(["0 m", "20 m"])
        if i and rng.random() < 0.5:
            keys["timing_from"] = f"s{rng.randrange(i)}"
        if i and rng.random() < 0.3:
            keys["vehicle"] = "s0"
        stage = (single if i == 0 else later)(**keys)
        if keys.get("vehicle") is None and rng.random() < 0.7:
            offered = rng.sample(["sky", "chip", "ocxo", "pps_gpio"], 2)
            stage["clock"] = {"candidates": offered}
        pool = ["by_sky", "by_beacon", "by_chance", "hardware"]
        role = rng.choice(["attitude", "ranging"])
        stages.append(stamped(stage, role, {"candidates": rng.sample(pool, 2)}))
    return stages


@pytest.mark.parametrize("seed", range(40))
def test_every_road_knows_where_gnss_is(seed: int, tmp_path: Path) -> None:
    """Random chains: the ranking lists as many designs as a plain loop with the rules counts."""
    stages = random_stages(random.Random(seed))
    loaded = load(written(tmp_path, *stages, parts=OWN))
    problem = build_problem(loaded)
    _, timed = expected_time(stages)
    asks = {"by_sky", "by_beacon", "sky", "pps_gpio"}
    methods = [
        [name for name in stage[role]["timestamping"]["candidates"] if timed[i] or name not in asks]
        for i, stage in enumerate(stages)
        for role in ("attitude", "ranging")
        if isinstance(stage[role]["timestamping"], dict)
    ]
    clocks = []
    for stage in stages:
        if "clock" in stage:
            aboard = [
                j for j, s in enumerate(stages) if s.get("vehicle", s["name"]) == stage["name"]
            ]
            free = any(timed[j] for j in aboard)
            clocks.append([c for c in stage["clock"]["candidates"] if free or c not in asks])
    count = 1
    for names in (*methods, *clocks):
        count *= len(names)
    relaxed = replace(problem, limits=replace(problem.limits, sync=float("inf"), accuracy_m=None))
    listed = list(iter_best(relaxed))
    assert len(listed) == count
    for design in listed:
        assert impossible(loaded, selection_of(relaxed, design)) == []
    roads = ["auto", "front", "enumerate", *(["milp"] if seed < 3 else [])]
    assert {isinstance(choose(relaxed, road), Choice) for road in roads} == {count > 0}  # type: ignore[arg-type]


def test_the_recheck_refuses_on_its_own(tmp_path: Path) -> None:
    """A selection that the tables never hold: both the method and the clock are named."""
    stage = stamped(single(depth="5 m", clock="pps_gpio"), "ranging", "pps_gnss")
    loaded = load(written(tmp_path, stage))
    roles = tuple(
        RoleSelection("fish", role, f"fish.{role}", "pps", method)
        for role, method in (
            ("position", "hardware"), ("attitude", "hardware"), ("ranging", "pps_gnss"),
        )
    )  # fmt: skip
    found = recheck(loaded, Selection(roles, (ClockSelection("fish", "pps_gpio"),)))  # type: ignore[arg-type]
    (row,) = [one for one in found.requirements if one.kind == "feasible"]
    assert not row.passed
    assert row.value == 2
    assert not found.passed


# ------------------------------------------------------------------ bad input, output


@pytest.mark.parametrize(
    ("keys", "path"),
    [
        ({"gnss": "maybe"}, "stages[0].gnss"),
        ({"gnss": 1}, "stages[0].gnss"),
        ({"depth": "-3 m"}, "stages[0].depth"),
        ({"depth": 300}, "stages[0].depth"),
        ({"timing_from": "fish"}, "stages[0].timing_from"),
        ({"timing_from": "boat"}, "stages[0].timing_from"),
    ],
)
def test_bad_keys_are_refused_at_their_place(keys: Stage, path: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as error:
        load(written(tmp_path, single(**keys)))
    assert path in str(error.value)


def test_a_cable_that_comes_back_is_refused(tmp_path: Path) -> None:
    stages = [single(name="a", timing_from="b"), later("b", timing_from="a")]
    with pytest.raises(BadInput, match="comes back"):
        load(written(tmp_path, *stages))


def test_unknown_needs_are_refused(tmp_path: Path) -> None:
    parts = {"clocks": {"sky": OWN["clocks"]["sky"] | {"needs": ["galileo"]}}}
    with pytest.raises(BadInput, match="needs"):
        load(written(tmp_path, single(), parts=parts))


@pytest.mark.parametrize("output", ["json", "html", "junit", "sarif", "github", "markdown", "csv"])
def test_every_format_says_it(output: str, tmp_path: Path) -> None:
    path = written(tmp_path, stamped(single(depth="5 m"), "ranging", "pps_gnss"))
    target = tmp_path / "out"
    done = CliRunner().invoke(
        app, ["check", str(path), "--quiet", "--output", f"{output}:{target}"]
    )
    assert done.exit_code == 1
    text = target.read_text("utf-8")
    assert "FACTS" in text
    if output == "json":
        assert json.loads(text)["choice"]["excluded"][0]["code"] == "gnss"
    elif output != "csv":
        assert "GNSS" in text
