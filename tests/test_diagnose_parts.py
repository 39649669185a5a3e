"""Effects in a part of a log: found with their stretch, against plain least squares and the world.

A latency from one moment to another is, in the world, a clock that steps there and back.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis import Diagnosis, diagnose
from syncline_design.diagnosis.knocks import after_a_knock, within_words
from syncline_design.diagnosis.parts import LEAST, MOST, PartSums
from syncline_design.diagnosis.positive import inverse
from syncline_design.diagnosis.spans import StampSpan, span_of
from syncline_design.effects import registry
from syncline_design.report.on_diagnosis import sentence_text
from tests.world import hidden, make_log, scenario

Array = NDArray[np.float64]
FROM_S, TO_S, LATE_S = 20.0, 42.0, 0.06


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    folder = tmp_path_factory.mktemp("parts")
    steps = [
        hidden("timestamp_step", "position", step_s=size, time_s=at)
        for size, at in ((LATE_S, FROM_S), (-LATE_S, TO_S))
    ]
    log = make_log(scenario("multirotor_lines", 5, 64.0, 8.0), tuple(steps))
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    return diagnose(spec, [log.to_csv(folder / "log.csv")])


def test_a_latency_in_a_part_of_the_log_is_said_with_its_interval(found: Diagnosis) -> None:
    (one,) = found.findings
    assert (one.effect, one.sensor, one.kind, one.material) == (
        "latency", "position", "cause", True)  # fmt: skip
    assert one.from_s == pytest.approx(FROM_S, abs=1.0)
    assert one.to_s == pytest.approx(TO_S, abs=1.0)
    low, high = one.parameters["latency_s"].interval95 or (0.0, 0.0)
    assert low < LATE_S < high < 1.1 * LATE_S
    assert one.sentence.endswith(f"from {one.from_s:.4g} s to {one.to_s:.4g} s")
    assert found.verdict == "explained"


def test_the_gap_counts_the_effect_where_it_acts_alone(found: Diagnosis) -> None:
    held = found.gap.held_out
    assert held is not None
    assert found.gap.expected_rms_m is not None
    assert held.after.rms_m < 1.05 * found.gap.expected_rms_m
    outside = [
        signature
        for time_s, signature in zip(
            found.plots.residuals.time_s,
            found.plots.residuals.axes["north"].signature,
            strict=True,
        )
        if not FROM_S - 1.0 < time_s < TO_S + 1.0
    ]
    assert outside
    assert not any(outside)


def test_a_delay_of_a_while_is_no_slow_noise_of_hundreds_of_times_the_spec(tmp_path: Path) -> None:
    """Slow courses sized without it take up what begins and ends."""
    steps = [
        hidden("timestamp_step", "position", step_s=size, time_s=at)
        for size, at in ((0.15, 30.0), (-0.15, 60.0))
    ]
    log = make_log(scenario("car_stops", 5, 100.0, 5.0), tuple(steps))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    result = diagnose(spec, [log.to_csv(tmp_path / "log.csv")])
    (one,) = result.findings
    assert (one.effect, one.sensor, one.kind) == ("latency", "position", "cause")
    assert (one.from_s, one.to_s) == (pytest.approx(30.0, abs=0.25), pytest.approx(60.0, abs=0.25))
    low, high = one.parameters["latency_s"].interval95 or (0.0, 0.0)
    assert low < 0.15 < high < 0.16
    assert result.verdict == "explained"


def test_a_system_of_no_unknowns_is_solved_without_a_word_of_lapack(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert inverse(np.zeros((0, 0)), 1e-9).shape == (0, 0)
    said = capfd.readouterr()
    assert said.out + said.err == ""  # LAPACK complains on the former


def test_the_stretch_that_sums_by_block_say_is_the_best_by_plain_least_squares() -> None:
    rng = np.random.default_rng(4)
    blocks, rows = 16, 10
    column = rng.standard_normal(blocks * rows)
    others = rng.standard_normal((blocks * rows, 3))
    error = rng.standard_normal(blocks * rows) + others @ [1.0, -2.0, 0.5]
    inside = slice(5 * rows, 9 * rows)
    error[inside] += 1.5 * column[inside]
    prior = np.array([0.0, 0.0, 0.3])
    every = np.column_stack([column, others]).reshape(blocks, rows, 4)
    split = (error - 0.4 * column).reshape(blocks, rows)
    normal = np.einsum("gri,grj->gij", every, every)
    score = np.einsum("gri,gr->gi", every, split)

    def cost(a: int, b: int) -> float:
        cut = np.where(
            np.repeat((np.arange(blocks) >= a) & (np.arange(blocks) < b), rows), column, 0
        )
        stacked = np.vstack([np.column_stack([cut, others]), np.diag([0.0, *np.sqrt(prior)])])
        wanted = np.concatenate([error, np.zeros(4)])
        values = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
        return 0.5 * float(np.sum((wanted - stacked @ values) ** 2))

    tried = {
        (a, b): cost(a, b)
        for a in range(blocks)
        for b in range(a + LEAST, min(a + MOST, blocks) + 1)
    }
    best = min(tried, key=lambda pair: tried[pair])
    asked = PartSums(normal, score, np.array([0.0, *prior]), 2)
    found = asked.best(np.array([1.0, 0.0, 0.0, 0.0]), np.arange(1, 4), 0.4)
    assert (found.first, found.last) == best == (5, 9)
    assert found.better == pytest.approx(cost(0, blocks) - tried[best], rel=1e-6)


def test_a_cut_effect_departs_inside_alone_and_keeps_its_name() -> None:
    effect = registry()["latency"]
    cut = StampSpan(effect, 2.0, 3.0).cut
    span = span_of(cut)
    assert span is not None
    assert span_of(effect) is None
    assert cut.name == effect.name
    inside = span.mask(np.array([1.9, 2.0, 2.5, 3.0, 3.1]))
    assert inside.tolist() == [0.0, 1.0, 1.0, 1.0, 0.0]


def test_the_page_says_when(found: Diagnosis) -> None:
    text = sentence_text(found)
    assert f", from {found.findings[0].from_s:.4g} s to" in text


def test_an_antenna_that_was_knocked_is_the_cause_and_a_datum_that_jumps_is_none(
    found: Diagnosis,
) -> None:
    """What is built in does not come and go; a wrong fix does."""
    word = replace(found.findings[0], effect="lever_arm", kind="stand_in", changed_once=True,
                   from_s=30.0, to_s=63.9)  # fmt: skip
    other = replace(word, effect="datum_offset", sensor="target")
    noise = replace(word, effect="correlated_noise", kind="noise", changed_once=None)
    told = after_a_knock((word, noise))
    assert told is not None
    assert [one.kind for one in told] == ["cause", "noise"]
    assert told[0].sentence == f"{word.sentence}, as after a knock"
    assert after_a_knock((word, other)) is None
    assert after_a_knock((replace(word, changed_once=None), noise)) is None
    assert after_a_knock((noise,)) is None


def test_a_cause_within_the_while_of_a_word_is_a_word_too(found: Diagnosis) -> None:
    cause = replace(found.findings[0], from_s=27.0, to_s=29.0)
    word = replace(cause, effect="datum_offset", kind="stand_in", from_s=22.3, to_s=40.3)
    assert [one.kind for one in within_words((word, cause))] == ["stand_in", "stand_in"]
    beside = replace(cause, from_s=39.0, to_s=44.0)
    lasting = replace(cause, from_s=None, to_s=None)
    small = replace(word, material=False)
    for kept, other in ((beside, word), (lasting, word), (cause, small)):
        assert within_words((other, kept))[1] is kept


FAULTS = {
    "arm": hidden("lever_arm", "position", x_m=0.3, y_m=0.2, z_m=0.0),
    "heading": hidden("heading_bias", "attitude", bias_rad=0.03),
    "range": hidden("range_bias", "ranging", bias_m=0.3),
}


@pytest.mark.parametrize("what", FAULTS)
def test_what_was_knocked_or_disturbed_is_told_with_its_moment(what: str, tmp_path: Path) -> None:
    """Two logs of one drive, the second with the fault, joined at 30 s (and at 60 s)."""
    drive, fault = scenario("vessel_figure_eights", 5, 100.0, 5.0), FAULTS[what]
    sound, off = make_log(drive), make_log(drive, (fault,))
    spec = tmp_path / "spec.yaml"
    spec.write_text(sound.spec_yaml(), encoding="utf-8")
    lines, later = (
        one.to_csv(tmp_path / name).read_text("utf-8").splitlines()
        for one, name in ((sound, "a.csv"), (off, "b.csv"))
    )
    last_s = 1e9 if what == "arm" else 60.0
    head, rows = lines[0], zip(lines[1:], later[1:], strict=True)
    joined = [b if 30.0 < float(a.split(",")[0]) < last_s else a for a, b in rows]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([head, *joined]) + "\n", encoding="utf-8")
    result = diagnose(spec, [log])
    (one,) = [f for f in result.findings if f.kind == "cause"]
    assert result.verdict == "explained"
    assert one.from_s == pytest.approx(30.0, abs=0.5)
    if what == "arm":
        assert (one.effect, one.changed_once) == ("lever_arm", True)
        assert one.sentence.endswith(", as after a knock")
        assert one.parameters["x_m"].value == pytest.approx(0.3, abs=0.05)
    else:
        ((name, value),) = fault.parameters
        assert one.effect == fault.effect
        assert one.to_s == pytest.approx(60.0, abs=0.5)
        low, high = one.parameters[name].interval95 or (0.0, 0.0)
        assert low < float(value) < high
