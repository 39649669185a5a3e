"""`accept`: every assumption of a verdict against logs whose truth is known."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest

from syncline_design.comparison import accept as acceptance
from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.comparison.acceptance import (
    NAMES,
    Acceptance,
    MeasuredFigure,
)
from syncline_design.comparison.assumptions import Assumed, assumptions
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.judgement import OF_PLACES, Judgement, together
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.limits import Beyond
from syncline_design.diagnosis.noise_split import NoiseFactor, NoiseFactors
from syncline_design.diagnosis.result import (
    BlindSpot,
    Check,
    Diagnosis,
    Estimate,
    Informative,
    Rival,
)
from syncline_design.diagnosis.run import diagnose
from syncline_design.diagnosis.undone import LeftOpen
from syncline_design.effects import registry
from syncline_design.report.on_acceptance import render_acceptance
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.case import Case
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded
from tests.acceptance_samples import (
    AS_SPECIFIED,
    EXAMPLE,
    LATENCY_S,
    ROOT,
    first_rows,
    found_in_first_rows,
    judged,
    rival,
    rows_of,
    run,
)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first rows of the example's log."""
    return first_rows(tmp_path_factory.mktemp("log"))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return found_in_first_rows()


@pytest.fixture(scope="module")
def late(short: Path, found: Diagnosis) -> Acceptance:
    """The acceptance on that log, whose diagnosis is made once."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(acceptance, "sighted", lambda *_: Sighted(found))
        return accept(load(EXAMPLE), [short], AcceptSettings(), seed=0)


@pytest.fixture(scope="module")
def known(short: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Case, Diagnosis]:
    """The same log, and a spec that knows of its latency (so nothing is missing)."""
    path = tmp_path_factory.mktemp("known") / "known.yaml"
    listed = (
        "effects:\n  - {effect: latency, sensor: position, stage: multirotor, "
        f"parameters: {{latency_s: {LATENCY_S} s}}}}\n"
    )
    text = EXAMPLE.read_text("utf-8").replace("limit: 0.3 m", "limit: 30 m")
    text = text.replace("stages:", "  - {id: S, kind: sync, limit: 1000}\nstages:")
    path.write_text(text + listed, "utf-8")
    case = load(path)
    return case, diagnose(case, [short])


def test_the_hidden_latency_is_broken_by_as_much_as_was_hidden(late: Acceptance) -> None:
    row = rows_of(late)["position", "latency"]
    assert (late.verdict, late.exit_code, row.status) == ("broken", 1, "broken")
    assert row.measured is not None
    assert row.measured.value == pytest.approx(LATENCY_S, abs=1e-3)
    assert row.measured.low is not None
    assert row.measured.high is not None
    assert row.measured.low < LATENCY_S < row.measured.high
    broken = [key for key, one in rows_of(late).items() if one.status == "broken"]
    assert broken == [("position", "latency")]
    line = EXAMPLE.read_text("utf-8").splitlines()[row.line - 1]
    assert line.strip().startswith("timestamping:")


def test_what_no_log_of_places_can_show_is_not_shown(late: Acceptance) -> None:
    rows = rows_of(late)
    assert {rows[role, "timing"].status for role in ("position", "attitude", "ranging")} == {
        "not_shown"
    }
    assert rows["platform", "speed"].assumed == 9.0
    assert {one for _, one in rows} == set(NAMES) - {"clock"}


def test_a_latency_that_the_spec_lists_is_no_broken_assumption(
    known: tuple[Case, Diagnosis],
) -> None:
    case, found = known
    assert found.verdict == "agrees"
    rows = dict(judged(case, found))
    assert rows["position", "latency"].status == "holds"
    assert rows["platform", "rate"].status == "holds"


def test_a_log_that_is_not_explained_shows_nothing(
    known: tuple[Case, Diagnosis], found: Diagnosis
) -> None:
    case, right = known
    unexplained = dict(judged(case, replace(right, verdict="unexplained")))
    assert {one.status for key, one in unexplained.items() if key[0] != "platform"} == {"not_shown"}
    (late,) = [f for f in found.findings if f.effect == "latency"]
    near = replace(found, verdict="unexplained", findings=(replace(late, kind="stand_in"),))
    words = dict(judged(case, near))["attitude", "latency"].words
    assert f"the nearest word for it: {late.sentence}" in words


def test_a_blind_log_shows_only_what_it_is_not_blind_to(known: tuple[Case, Diagnosis]) -> None:
    case, found = known
    assert not any(spot.effect == "latency" for spot in found.informative.blind_to)
    hidden = BlindSpot("latency", "ranging", "multirotor", "latency_s", 1.0, 0.5)
    blind = replace(found, informative=Informative(False, (hidden,)))
    open_too = tuple(replace(one, within=None) for one in found.smallest_seen)
    rows = dict(judged(case, replace(blind, smallest_seen=open_too)))
    assert rows["ranging", "latency"].status == "not_shown"
    assert rows["position", "latency"].status == "holds"
    assert dict(judged(case, blind))["ranging", "latency"].status == "holds"  # it is excluded


def test_what_a_finding_may_be_instead_is_not_shown(found: Diagnosis) -> None:
    case = load(EXAMPLE)
    (finding,) = [f for f in found.findings if f.effect == "latency"]
    alias = Rival("lever_arm", "position", "multirotor", 1.0, 0.1)
    either = replace(found, findings=(replace(finding, aliases=(alias,)),))
    rows = dict(judged(case, either))
    assert rows["position", "latency"].status == "not_shown"
    assert rows["position", "lever_arm"].status == "not_shown"
    stand_in = replace(found, findings=(replace(finding, kind="stand_in"),), verdict="unexplained")
    assert dict(judged(case, stand_in))["position", "latency"].status == "not_shown"
    small = {"latency_s": replace(finding.parameters["latency_s"], value=1e-4)}
    kept = replace(finding, material=False, parameters=small)
    slight = replace(found, findings=(kept,), verdict="agrees")
    assert dict(judged(case, slight))["position", "latency"].status == "holds"
    small = {"latency_s": replace(finding.parameters["latency_s"], value=3.2e-3)}  # turns SYNC
    turning = replace(slight, findings=(replace(kept, parameters=small),))
    assert dict(judged(case, turning))["position", "latency"].status == "broken"


def test_what_holds_has_an_interval_that_what_is_undone_lies_in(
    known: tuple[Case, Diagnosis],
) -> None:
    """A delay that an arm of 6 cm undoes: the arm's row does not say that it is known to mm."""
    case, found = known
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    name = case.stages[-1].choice.name
    more = LeftOpen(("lever_arm", "position", 0), name, "x_m", "m", 0.06, 1e-3,
                    ("latency", "position", 0))  # fmt: skip
    log = LogEvidence(found, OnPaper(case, ()), name, sight=Sighted(found, open=(more,)))
    [one] = [a for a in assumptions(case, verdict) if (a.role, a.name) == ("position", "lever_arm")]
    row = by_log(one, log)
    assert row.status == "holds", row
    assert row.measured is not None
    assert (row.measured.low, row.measured.high) == (-0.06, 0.06)


@pytest.mark.parametrize(("low", "status"), [(0.98, "broken"), (0.5, "not_shown")])
def test_a_bias_that_slower_noise_could_leave_breaks_no_figure(
    found: Diagnosis, low: float, status: str
) -> None:
    """1.5 cm of 2 cm: beside 0.98 of the figure seen, 0.2 of it is left; beside 0.5, 0.87 of it."""
    case = load(EXAMPLE)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    part = replace(found.findings[0].parameters["latency_s"], value=0.015, unit="m")
    off = replace(found.findings[0], effect="range_bias", sensor="ranging", also=None,
                  parameters={"bias_m": part}, kind="cause", material=True, aliases=())  # fmt: skip
    ranges = NoiseFactor(1.0, low, 1.05, ("range",))
    split = NoiseFactors((ranges,), (1.0,), (0.02, 0.001, 0.001))
    one = next(a for a in assumptions(case, verdict) if (a.role, a.name) == ("ranging", "noise"))
    sight = Sighted(found, factors={f"{one.stage}/ranging": split})
    log = LogEvidence(replace(found, findings=(off,)), OnPaper(case, ()), one.stage, sight=sight)
    row = by_log(one, log)
    assert row.status == status, row
    assert ("slower than this log" in row.words) == (status == "not_shown")


@pytest.mark.parametrize(
    ("seconds", "low", "status"),
    [(120.0, 0.7, "not_shown"), (120.0, 0.95, "broken"), (1200.0, 0.7, "broken")],
)
def test_a_heading_drift_that_slower_noise_could_leave_breaks_no_figure(
    found: Diagnosis, seconds: float, low: float, status: str
) -> None:
    """5 deg/h is 0.083 deg off at the ends of two minutes, 0.83 deg at those of twenty; of 0.1 deg
    0.71 is left to slow noise beside 0.7 of the figure, 0.31 beside 0.95: 0.14 and 0.061 deg."""
    case = load(EXAMPLE)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    rate = math.radians(5.0) / 3600.0
    part = replace(found.findings[0].parameters["latency_s"], value=rate, unit="rad/s",
                   standard_uncertainty=0.2 * rate, interval95=None)  # fmt: skip
    off = replace(found.findings[0], effect="heading_drift", sensor="attitude", also=None,
                  parameters={"rate_radps": part}, material=True, aliases=())  # fmt: skip
    assert off.kind == "cause"
    sigma = math.radians(0.1)
    split = NoiseFactors((NoiseFactor(1.0, low, 1.05, ("yaw",)),), (1.0,), (sigma, sigma, sigma))
    one = next(a for a in assumptions(case, verdict) if (a.role, a.name) == ("attitude", "noise"))
    sight = Sighted(found, factors={f"{one.stage}/attitude": split}, ends_s=(0.0, seconds))
    told = replace(found, findings=(off,))
    row = by_log(one, LogEvidence(told, OnPaper(case, ()), one.stage, sight=sight))
    assert row.status == status, row
    assert ("slower than this log" in row.words) == (status == "not_shown")


@pytest.mark.parametrize(
    ("verdict", "low", "std_m", "status"),
    [
        ("unexplained", 0.0, 0.020, "not_shown"),
        ("unexplained", 1.2, 0.020, "broken"),
        ("explained", 0.0, 0.020, "broken"),  # 1.31 of the figure by itself
        ("explained", 0.0, 0.015, "not_shown"),  # 0.98: neither is beyond 1
        ("explained", 0.0, 0.050, "not_shown"),  # 3.3, and positions scatter 1.41 at most
    ],
)
def test_noise_in_the_shape_of_what_has_no_name_breaks_no_figure(
    found: Diagnosis, verdict: str, low: float, std_m: float, status: str
) -> None:
    """Slow noise takes the shape of whatever is missing, unless the figure itself is exceeded."""
    case = load(EXAMPLE)
    on_paper = check_loaded(case, CheckSettings(monte_carlo=False))
    part = replace(found.findings[0].parameters["latency_s"], value=std_m, unit="m",
                   standard_uncertainty=0.0005, interval95=None)  # fmt: skip
    slow = replace(found.findings[0], effect="correlated_noise", sensor="position", also=None,
                   parameters={"std_m": part}, kind="noise", material=True, aliases=())  # fmt: skip
    split = NoiseFactors((NoiseFactor(max(low, 0.5), low, 1.41),), (1.0,), (0.012, 0.012, 0.02))
    one = next(a for a in assumptions(case, on_paper) if (a.role, a.name) == ("position", "noise"))
    told = replace(found, findings=(slow,), verdict=verdict)
    sight = Sighted(told, factors={f"{one.stage}/position": split})
    row = by_log(one, LogEvidence(told, OnPaper(case, ()), one.stage, sight=sight))
    assert row.status == status, row
    assert ("has no name" in row.words) is (verdict == "unexplained" and low < 1.0)
    beyond = row.measured is not None and row.measured.low is not None and row.measured.low > 1.0
    assert beyond is (status == "broken")


@pytest.mark.parametrize(("low", "status"), [(0.98, "broken"), (0.8, "not_shown")])
@pytest.mark.parametrize("alias", [True, False])
def test_a_turn_that_slower_noise_could_leave_breaks_no_mounting(
    found: Diagnosis, short: Path, low: float, status: str, alias: bool
) -> None:
    """0.9, 0.3 and 0.1 of an attitude's sigmas: 0.91 in squares, of 7.81 (1 - f^2) that are left:
    2.8 beside 0.8 of the figure seen, 0.31 beside 0.98.
    """
    sigma = (5e-4, 5e-4, 1e-3)
    part = found.findings[0].parameters["latency_s"]
    turn = {f"{axis}_rad": replace(part, value=share * s, unit="rad", interval95=(0.0, 1e-3))
            for axis, share, s in zip("xyz", (0.9, 0.3, 0.1), sigma, strict=True)}  # fmt: skip
    others = (rival("boresight", "ranging", 0.4, x_rad=4e-4, y_rad=1e-4, z_rad=1e-4),)
    off = replace(found.findings[0], effect="mounting", sensor="attitude", also=None, kind="cause",
                  parameters=turn, material=True, aliases=others if alias else ())  # fmt: skip
    split = NoiseFactors((NoiseFactor(0.9, low, 1.0),), (1.0,), sigma)
    with pytest.MonkeyPatch.context() as patched:
        sight = Sighted(replace(found, findings=(off,)), factors={"multirotor/attitude": split})
        patched.setattr(acceptance, "sighted", lambda *_: sight)
        told = accept(load(EXAMPLE), [short], AcceptSettings(), seed=0)
    assert told.verdict == status
    assert rows_of(told)["attitude", "mounting"].status == ("not_shown" if alias else status)
    assert bool(told.groups) is (alias and status == "broken")


def test_the_figure_of_a_limit_is_the_one_that_its_interval_is_of(
    known: tuple[Case, Diagnosis],
) -> None:
    """The log's check says a quantile, 95 % below; the figure is the largest mean, in its interval.

    12.2 m/s by single readings, 11.9 by means over 2 s.
    """
    case, found = known
    check = Check("speed", found.findings[0].stage if found.findings else "multirotor", "caution",
                  "speed of multirotor reaches 11.2 m/s", 11.2, 9.0, "m/s", 0.4)  # fmt: skip
    mean = Beyond(11.9, 11.8, 12.0, 11.7, 9.0, 2.0, np.full(9, 11.9), 0.2)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    one = next(a for a in assumptions(case, verdict) if a.name == "speed")
    wrong = replace(found, checks=(replace(check, stage=one.stage),))
    sight = Sighted(wrong, beyond={("speed", one.stage): mean})
    row = by_log(one, LogEvidence(wrong, OnPaper(case, ()), one.stage, sight=sight))
    assert row.status == "broken"
    assert row.measured == MeasuredFigure(11.9, 11.8, 12.0)
    assert "largest mean over 2 s" in row.words


def test_a_wave_that_is_no_effect_leaves_the_rows_open(found: Diagnosis) -> None:
    """A stand-in has no entry among the effects: it was an internal error."""
    wave = replace(found.findings[0], effect="spectral_line", kind="stand_in", aliases=())
    rows = dict(judged(load(EXAMPLE), replace(found, findings=(wave,))))
    assert {one.status for key, one in rows.items() if key[0] != "platform"} == {"not_shown"}


def test_noise_that_a_constant_breaks_has_the_figure_of_both(found: Diagnosis) -> None:
    """Scatter as specified beside ranges 15 cm too long, where the spec's noise makes 4 cm.

    The row showed 1 time its figure and was broken.
    """
    bias = Estimate(0.15, 0.01, "m", True, "15 cm", (0.13, 0.17))
    long = replace(found.findings[0], effect="range_bias", sensor="ranging", aliases=(),
                   parameters={"bias_m": bias}, size_m=0.15, kind="cause")  # fmt: skip
    longer = replace(found, findings=(long,))
    case = load(EXAMPLE)
    sound = {key: replace(own, sigma=(0.02, 1e-3, 1e-3)) for key, own in AS_SPECIFIED.items()}
    sight = Sighted(longer, factors=sound, stated_m={"multirotor/ranging": 0.04})
    log = LogEvidence(longer, OnPaper(case, ()), "multirotor", sight=sight)
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    one = next(a for a in assumptions(case, verdict) if (a.role, a.name) == ("ranging", "noise"))
    row = by_log(one, log)
    assert row.status == "broken"
    assert row.measured is not None
    ends = [
        math.hypot(part, size / 0.04) for part, size in ((1.0, 0.15), (0.99, 0.13), (1.01, 0.17))
    ]
    assert (row.measured.value, row.measured.low, row.measured.high) == pytest.approx(ends)
    assert "with all of that" in row.words


def test_a_wave_of_one_sensor_is_no_noise_that_another_may_have(found: Diagnosis) -> None:
    """Where the split leaves a sensor room for more noise: it was an internal error as well."""
    case = load(EXAMPLE)
    wave = replace(found.findings[0], effect="spectral_line", kind="stand_in", aliases=())
    waved = replace(found, findings=(wave,))
    loud = {key: NoiseFactors((NoiseFactor(1.0, 0.4, 1.6),)) for key in AS_SPECIFIED}
    log = LogEvidence(waved, OnPaper(case, ()), "multirotor", sight=Sighted(waved, factors=loud))
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    rows = [by_log(one, log) for one in assumptions(case, verdict) if one.name == "noise"]
    assert {row.status for row in rows} == {"not_shown"}


def test_a_delay_that_several_sensors_share_breaks_each(found: Diagnosis) -> None:
    (finding,) = [f for f in found.findings if f.effect == "latency"]
    shared = replace(found, findings=(replace(finding, also=("attitude",)),))
    rows = dict(judged(load(EXAMPLE), shared))
    assert rows["attitude", "latency"].status == rows["position", "latency"].status == "broken"
    assert rows["ranging", "latency"].status != "broken"


def test_one_that_breaks_beats_one_that_holds_and_both_beat_silence() -> None:
    case = load(EXAMPLE)
    one = Assumed("multirotor", "position", "timing", 1e-8, ("stages", 0, "position"))
    holds, broken, silent = (Judgement(s, s) for s in ("holds", "broken", "not_shown"))
    assert together(case, one, [holds, broken, silent]).status == "broken"
    assert together(case, one, [silent, holds]).status == "holds"
    assert together(case, one, [silent]).status == "not_shown"
    assert together(case, one, []).status == "not_shown"
    assert together(case, one, [silent, OF_PLACES]).evidence == "not_shown"
    assert together(case, one, [OF_PLACES]).evidence == OF_PLACES.words


def test_every_effect_breaks_something_that_its_sensor_is_asked_for() -> None:
    for effect in registry().values():
        asked = {
            "lever_arm": {"position", "ranging"}, "mounting": {"attitude", "ranging", "position"},
        }.get(effect.breaks, {"position", "attitude", "ranging", "target"})  # fmt: skip
        assert set(effect.sensors) <= asked, effect.name


def test_a_moment_beyond_the_limit_is_no_proof_that_it_is_kept(
    known: tuple[Case, Diagnosis],
) -> None:
    case, found = known
    speed = replace(found.log.motion["speed"], most=14.1)
    beyond = replace(found, log=replace(found.log, motion={**found.log.motion, "speed": speed}))
    row = dict(judged(case, beyond))["platform", "speed"]
    assert row.status == "not_shown"
    assert row.measured is not None
    assert row.measured.value == 14.1


@pytest.mark.parametrize(("most", "status"), [(7.0, "holds"), (0.5, "not_shown")])
def test_an_earlier_stage_is_held_against_its_limits_too(
    known: tuple[Case, Diagnosis], most: float, status: str
) -> None:
    """Its motion is in the log as that of the last one is, as means over seconds."""
    case, found = known
    mean = Beyond(most, most - 0.1, most + 0.1, most - 0.3, 9.0, 2.0, np.full(9, most), 0.3)
    one = next(
        a
        for a in assumptions(case, check_loaded(case, CheckSettings(monte_carlo=False)))
        if a.name == "speed"
    )
    sight = Sighted(found, beyond={("speed", one.stage): mean})
    row = by_log(one, LogEvidence(found, OnPaper(case, ()), "another stage", sight=sight))
    assert row.status == status
    assert row.measured == MeasuredFigure(most, most - 0.1, most + 0.1)


def test_a_spec_of_several_missions_is_refused_at_its_place() -> None:
    spec = ROOT / "examples" / "uav_three_heights.yaml"
    lines = spec.read_text("utf-8").splitlines()
    at = 1 + next(k for k, line in enumerate(lines) if line.startswith("missions:"))
    done = run("accept", spec, EXAMPLE.with_suffix(".csv"))
    assert (done.exit_code, done.stdout) == (2, "")
    line = int(done.stderr.split("uav_three_heights.yaml:")[1].split(":")[0])
    assert line in (at, at + 1)
    assert "give it a spec of one mission" in done.stderr


def test_a_figure_and_its_interval_end_at_the_same_place(late: Acceptance) -> None:
    """`1.0427 (0.9111 to 1.1595)`, in one unit; a departure that was not found is a plain 0."""
    words = render_acceptance("html", late).replace("\u00a0", " ")
    number = r"\u2212?(\d+\.?\d*)( \S+)?"
    found = re.findall(rf"<bdi>{number} \({number} to {number}\)</bdi>", words)
    assert len(found) > 5
    for value, unit, low, low_unit, high, high_unit in found:
        ends = [len(text.partition(".")[2]) for text in (low, high)]
        assert ends == [ends[0]] * 2
        assert value == "0" or len(value.partition(".")[2]) == ends[0]
        assert low_unit == high_unit
        assert value == "0" or unit == low_unit


def test_every_format_says_the_same(late: Acceptance) -> None:
    written = json.loads(render_acceptance("json", late))
    jsonschema.validate(written, result_schema("acceptance"))
    suite = ElementTree.fromstring(render_acceptance("junit", late))[0]
    counts = [sum(r.status == s for r in late.assumptions) for s in ("broken", "not_shown")]
    assert [int(suite.get(key, "")) for key in ("failures", "errors")] == counts
    sarif = json.loads(render_acceptance("sarif", late))["runs"][0]["results"]
    assert [one["level"] for one in sarif].count("error") == sum(counts)
    lines = render_acceptance("github", late).splitlines()
    assert sum(line.startswith("::error") for line in lines) == sum(counts)
    for name in ("markdown", "html"):
        text = render_acceptance(name, late)
        assert "broken" in text
        assert "older than their stamps" in text
