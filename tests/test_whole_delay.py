"""The largest delay of a sensor on a log, against the same reckoned at every instant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.comparison.whole_delay import Passing, whole_delay
from syncline_design.diagnosis.result import Diagnosis, Finding
from syncline_design.spec.load import load
from tests.acceptance_samples import EXAMPLE, found_in_first_rows

ONE = Assumed("multirotor", "position", "latency", 0.0, ("stages", 0, "position", "timestamping"))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return found_in_first_rows()


def finding(found: Diagnosis, effect: str, **figures: float) -> Finding:
    part = found.findings[0].parameters["latency_s"]
    told = {name: replace(part, value=value, interval95=(0.9 * value, 1.1 * value))
            for name, value in figures.items()}  # fmt: skip
    return replace(found.findings[0], effect=effect, sensor="position", also=None, kind="cause",
                   parameters=told, material=True, aliases=(), from_s=None, to_s=None)  # fmt: skip


def told(found: Diagnosis, constant: float, rate: float, step: float, at_s: float) -> Diagnosis:
    parts = [finding(found, "clock_drift", rate=rate),
             finding(found, "timestamp_step", step_s=step, time_s=at_s)]  # fmt: skip
    if constant:
        parts.append(finding(found, "latency", latency_s=constant))
    return replace(found, findings=tuple(parts), verdict="explained")


def test_the_largest_delay_is_that_of_some_instant(found: Diagnosis) -> None:
    """A constant, a ramp and a step of either sign: 40 of them at 20 001 instants."""
    rng = np.random.default_rng(3)
    duration_s = found.log.duration_s
    time_s = np.linspace(0.0, duration_s, 20_001)
    for _ in range(40):
        constant, rate, step = rng.normal(size=3) * (0.02, 0.03 / duration_s, 0.02)
        at_s = float(rng.uniform(0.05, 0.95)) * duration_s
        delay = constant + rate * time_s + step * (time_s >= at_s)
        figure = whole_delay(ONE, told(found, constant, rate, step, at_s))
        assert figure is not None
        assert figure.value is not None
        most = delay[np.argmax(np.abs(delay))]
        assert abs(figure.value) == pytest.approx(abs(most), abs=2e-5)
        assert figure.low is not None
        assert figure.high is not None
        assert figure.low <= figure.value <= figure.high


def test_one_departure_alone_is_told_as_before(found: Diagnosis) -> None:
    alone = finding(found, "latency", latency_s=0.02)
    assert whole_delay(ONE, replace(found, findings=(alone,))) is None
    other = replace(ONE, name="timing")
    assert whole_delay(other, told(found, 0.01, 1e-4, 0.01, 5.0)) is None


def test_a_delay_that_drifts_is_broken_with_the_largest_that_acted(found: Diagnosis) -> None:
    """14 ms and 117 ppm: 14 ms at the start alone, and more by the drift at the end."""
    drift = finding(found, "clock_drift", rate=1.17e-4)
    late = finding(found, "latency", latency_s=0.014)
    both = replace(found, findings=(late, drift), verdict="explained")
    row = by_log(ONE, LogEvidence(both, OnPaper(load(EXAMPLE), ()), ONE.stage))
    most = 0.014 + 1.17e-4 * found.log.duration_s
    assert row.status == "broken"
    assert row.measured is not None
    assert row.measured.value == pytest.approx(most)
    assert (row.measured.low, row.measured.high) == pytest.approx((0.9 * most, 1.1 * most))
    assert "in all a delay of up to" in row.words


def test_a_ramp_after_a_knee_is_a_drift_less_its_step(found: Diagnosis) -> None:
    """473 ppm and a step back of 8.5 ms near the start: not the drift alone at the end."""
    duration_s = found.log.duration_s
    knee = told(found, 0.0, 0.0473 / duration_s, -0.0085, 0.08 * duration_s)
    row = by_log(ONE, LogEvidence(knee, OnPaper(load(EXAMPLE), ()), ONE.stage))
    assert row.status == "broken"
    assert row.measured is not None
    assert row.measured.value == pytest.approx(0.0388)


def test_what_is_late_for_a_while_comes_on_top(found: Diagnosis) -> None:
    """A constant and two whiles that overlap or not, at 20 001 instants."""
    rng = np.random.default_rng(5)
    duration_s = found.log.duration_s
    time_s = np.linspace(0.0, duration_s, 20_001)
    part = found.findings[0].parameters["latency_s"]
    for _ in range(40):
        constant, *late = rng.normal(size=3) * 0.03
        spans = np.sort(rng.uniform(size=(2, 2))) * duration_s
        delay = np.full(time_s.shape, constant)
        passing = []
        for value, (begin, end) in zip(late, spans, strict=True):
            delay += value * ((time_s >= begin) & (time_s <= end))
            told_as = replace(
                part, value=value, interval95=tuple(sorted((0.9 * value, 1.1 * value)))
            )
            passing.append(Passing(told_as, float(begin), float(end)))
        alone = replace(found, findings=(finding(found, "latency", latency_s=constant),))
        figure = whole_delay(ONE, alone, passing)
        assert figure is not None
        assert figure.value == pytest.approx(delay[np.argmax(np.abs(delay))], abs=1e-9)
        assert figure.low is not None
        assert figure.high is not None
        assert figure.low <= figure.value <= figure.high


def test_a_constant_alone_is_no_sum(found: Diagnosis) -> None:
    alone = replace(found, findings=(finding(found, "latency", latency_s=0.02),))
    assert whole_delay(ONE, alone) is None
