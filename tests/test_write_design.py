"""`--write-design`: what it writes reads back, leaves nothing open and is the very same design."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import yaml
from typer.testing import CliRunner

from syncline_design.choice.problem import build_problem
from syncline_design.cli.app import app
from syncline_design.spec.load import load
from syncline_design.verdict.pinned import pinned_text
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

QUICK = CheckSettings(monte_carlo=False)
ERRORS: list[dict[str, Any]] = [
    {"distribution": "uniform", "low": "-20 us", "high": "35 us"},
    {"distribution": "normal", "mean": "4 us", "std": "3 us"},
    {"distribution": "constant", "value": "12 us"},
    {"distribution": "empirical", "values": ["1 us", "9 us", "4 us"]},
]
FIGURES = {
    "position": {"sigma_position": "7 cm"},
    "attitude": {"sigma_attitude": ["0.3 deg", "0.3 deg", "0.9 deg"]},
    "ranging": {"sigma_range": "5 cm", "sigma_bearing": ["0.4 deg", "0.4 deg"]},
}
CATALOG = {
    # Ids that YAML would read as something else, or that need quotes.
    "sensors": {
        "007": {"modality": "position", "sigma_position": "9 cm", "primitives": ["pps"]},
        "on: board": {"modality": "attitude", "sigma_attitude": "0.5 deg", "primitives": ["tov"]},
        "no": {
            "modality": "ranging",
            "sigma_range": "9 cm",
            "sigma_bearing": "0.5 deg",
            "primitives": ["trigger"],
        },
        "plain": {"modality": "position", "sigma_position": "6 cm", "primitives": ["tov"]},
    },
    "timestamping": {
        "inline": {
            "primitives": ["pps", "tov", "trigger"],
            "error": {"distribution": "uniform", "low": "-2 us", "high": "2 us"},
        }
    },
}
for _entry in (*CATALOG["sensors"].values(), *CATALOG["timestamping"].values()):
    _entry |= {"cost": "10 EUR", "mass": "1 kg", "power": "1 W"}
OWN = {"position": ["007", "plain"], "attitude": ["on: board"], "ranging": ["no"]}
SHIPPED = {
    "position": ["ublox_f9p_rtk", "ublox_f9p_pvt", "trimble_r12_rtk"],
    "attitude": ["sbg_ellipse", "sbg_apogee"],
    "ranging": ["riegl_vux1uav", "ouster_os1"],
}


def draw_timestamping(rng: random.Random) -> Any:
    kind = rng.random()
    if kind < 0.4:
        error: dict[str, Any] = {"error": rng.choice(ERRORS)}
        return error | ({"timeline": rng.choice(["utc", "host"])} if rng.random() < 0.6 else {})
    if kind < 0.6:
        return rng.choice(["hardware", "inline", "arrival"])
    return {"candidates": rng.sample(["hardware", "inline", "gpio", "arrival"], 2)}


def draw_role(rng: random.Random, role: str) -> dict[str, Any]:
    names = [*OWN[role], *(n for n in SHIPPED[role] if n in KNOWN)]
    kind = rng.random()
    own: dict[str, Any]
    if kind < 0.2:
        sensor = {"modality": role, **FIGURES[role], "primitives": ["pps", "tov", "trigger"]}
        own = {"sensor": sensor | {"cost": "5 EUR", "mass": "1 kg", "power": "1 W"}}
    elif kind < 0.3:
        own = {"candidates": {"modality": role}}
    else:
        own = {"candidates": rng.sample(names, rng.randint(1, len(names)))}
    if rng.random() < 0.3:
        own["primitive"] = rng.choice(["pps", "tov", "trigger", "arrival"])
    if rng.random() < 0.6:
        own["timestamping"] = draw_timestamping(rng)
    if rng.random() < 0.3:
        own["lever_arm"] = ["0.1 m", "0 m", "-0.2 m"]
    return own


def draw_spec(rng: random.Random) -> dict[str, Any]:
    stages: list[dict[str, Any]] = []
    for index in range(rng.choice([1, 1, 2])):
        stage: dict[str, Any] = {"name": f"s{index}", "platform": "usv", "gnss": "yes"}
        if index == 0:
            stage["position"] = draw_role(rng, "position")
        stage["attitude"], stage["ranging"] = draw_role(rng, "attitude"), draw_role(rng, "ranging")
        if rng.random() < 0.4:
            clocks = rng.sample(["free_running", "ntp", "pps_gpio"], rng.randint(1, 3))
            stage["clock"] = rng.choice([{"candidates": clocks}, clocks[0]])
        stages.append(stage)
    if len(stages) > 1 and "clock" not in stages[1] and rng.random() < 0.4:
        stages[0]["vehicle"] = stages[1]["vehicle"] = "both"
    return {
        "syncline": 1,
        "name": "drawn",
        "catalogs": ["own.yaml"],
        "requirements": [
            {"id": "ACC", "kind": "accuracy", "limit": "90 m"},
            {"id": "SYNC", "kind": "sync", "limit": rng.choice([1000.0, 20.0])},
        ],
        "sync_model": rng.choice(["syncline", "per_sensor"]),
        "objective": rng.choice(["cost", "mass", "error"]),
        "stages": stages,
        "timestamping": {"candidates": ["hardware", "gpio", "arrival"]},
    }


KNOWN = frozenset(
    yaml.safe_load((Path(__file__).parent.parent / "catalogs" / "sensors.yaml").read_text("utf-8"))[
        "sensors"
    ]
)


def test_pinned_specs_are_the_designs_that_they_pin(tmp_path: Path) -> None:
    """40 random specs: what is written is verified to the same figures with nothing left open.

    Fixed seed and exact comparison: no error rate.  Enough of them have a design.
    """
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(CATALOG), "utf-8")
    rng, feasible = random.Random(5), 0
    for number in range(40):
        path = tmp_path / f"open{number}.yaml"
        flow = rng.choice([False, None])
        path.write_text(yaml.safe_dump(draw_spec(rng), default_flow_style=flow), "utf-8")
        verdict = check_open(path)
        if verdict is None:
            continue
        feasible += 1
        pinned = tmp_path / f"pinned{number}.yaml"
        again = check_file(pinned, QUICK).to_json()
        assert again["spec"]["combinations"] == "1", pinned.read_text("utf-8")
        assert again["spec"]["open_roles"] == []
        for key in ("design", "syncline", "requirements"):
            assert _placeless(again[key]) == _placeless(verdict[key]), pinned.read_text("utf-8")
    assert feasible >= 15, feasible


def check_open(path: Path) -> dict[str, Any] | None:
    """The verdict of a drawn spec whose design was written beside it; None where it has none."""
    from syncline_design.spec.load import BadInput
    from syncline_design.verdict.pinned import picked_design

    try:
        loaded = load(path)
    except BadInput:
        return None
    verdict = check_file(path, QUICK).to_json()
    if verdict["verdict"] != "meets":
        return None
    problem, design = picked_design(loaded, seed=0)
    text = pinned_text(loaded, problem, design)
    path.with_name(path.name.replace("open", "pinned")).write_text(text, "utf-8")
    return verdict


def _placeless(data: Any) -> Any:
    if isinstance(data, dict):
        return {k: _placeless(v) for k, v in data.items() if k not in ("line", "column")}
    return [_placeless(item) for item in data] if isinstance(data, list) else data


INLINE = """\
syncline: 1
name: errors in place
catalogs: [own.yaml]
requirements:
  - {id: ACC, kind: accuracy, limit: 90 m}
  - {id: SYNC, kind: sync, limit: 1000}
objective: error
stages:
  - name: usv
    platform: usv
    # a comment to keep
    position:
      candidates: ["007", plain]
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}, timeline: utc}
    attitude: {candidates: ["on: board"], timestamping: inline}
    ranging: {sensor: "no", timestamping: {error: {distribution: constant, value: 3 us}}}
    clock: {candidates: [free_running, pps_gpio]}
"""


def test_command_writes_what_it_reads(tmp_path: Path) -> None:
    """An error given in place stays as it stands; a pinned primitive chooses among its sensors."""
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(CATALOG), "utf-8")
    spec, pinned = tmp_path / "spec.yaml", tmp_path / "pinned.yaml"
    spec.write_text(INLINE, "utf-8")
    words = ["optimize", str(spec), "--write-design", str(pinned), "--quiet"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    text = pinned.read_text("utf-8")
    assert "# a comment to keep" in text
    role = yaml.safe_load(text)["stages"][0]["position"]
    # `plain` has the smaller error and no pps
    assert (role["sensor"], role["primitive"]) == ("007", "pps")
    assert role["timestamping"]["timeline"] == "utc"
    assert CliRunner().invoke(app, ["check", str(pinned), "--quiet"]).exit_code == 0
    excluded = build_problem(load(spec)).roles[0].excluded
    assert [(one.sensor, one.code) for one in excluded] == [("plain", "primitive")]


def test_primitive_that_no_candidate_has_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(CATALOG), "utf-8")
    spec = tmp_path / "spec.yaml"
    spec.write_text(INLINE.replace('["007", plain]', "[plain]"), "utf-8")
    done = CliRunner().invoke(app, ["check", str(spec)])
    assert done.exit_code == 2
    assert "pps" in done.output
    assert "Traceback" not in done.output


INLINE_BLOCK = """\
syncline: 1
name: all given in place
requirements:
  - {id: A, kind: accuracy, limit: 9 m}
stages:
  - name: v
    platform: usv
    position: {candidates: [ublox_f9p_rtk, ublox_f9p_pvt]}
    attitude:
      sensor: {modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps], cost: 9 EUR}
      timestamping: {error: {distribution: constant, value: 2 us}}
    ranging: {sensor: velodyne_hdl32e, timestamping: gpio}
timestamping: {candidates: [gpio]}
"""


def test_a_written_design_is_written_again_as_it_stands(tmp_path: Path) -> None:
    """Nothing is left to pin, so not a byte changes, blanks and line ends included."""
    given, first, second = (tmp_path / f"{name}.yaml" for name in ("given", "first", "second"))
    given.write_text(INLINE_BLOCK, "utf-8")
    for source, target in ((given, first), (first, second)):
        done = CliRunner().invoke(app, ["optimize", str(source), "--write-design", str(target)])
        assert done.exit_code == 0, done.output
    assert second.read_text("utf-8") == first.read_text("utf-8")
    assert not any(line != line.rstrip() for line in first.read_text("utf-8").splitlines())
