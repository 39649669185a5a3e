"""A shift of stamps that was undone and what is left of it: one delay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.plan import one_plan
from syncline_design.diagnosis.finding import estimate, finding
from syncline_design.diagnosis.one_delay import with_one_delay
from syncline_design.diagnosis.result import Finding
from syncline_design.effects import registry


def delay(value: float, spread: float | None, sensor: str = "position") -> Finding:
    ends = None if spread is None else (value - 2.0 * spread, value + 2.0 * spread)
    figures = {"latency_s": estimate(value, spread, "s", interval95=ends)}
    return finding(registry()["latency"], sensor, "auv", figures, "clear", 10.0, -5.0)


def test_both_are_told_as_their_sum_with_the_uncertainty_of_the_fit() -> None:
    arm = finding(registry()["lever_arm"], "position", "auv",
                  {name: estimate(0.1, 0.01, "m") for name in ("x_m", "y_m", "z_m")},
                  "clear", 3.0)  # fmt: skip
    first, second = with_one_delay((delay(0.788, None), arm, delay(-0.2187, 0.02)))
    assert second is arm
    found = first.parameters["latency_s"]
    assert found.value == pytest.approx(0.5693)
    assert found.standard_uncertainty == 0.02
    assert found.interval95 == pytest.approx((0.5293, 0.6093))
    assert first.sentence == "Position data are 569 ± 20 ms older than their stamps"
    assert first.gain_nat == 20.0


@pytest.mark.parametrize(
    "other",
    [
        delay(-0.2187, 0.02, "attitude"),
        replace(delay(-0.2187, 0.02), from_s=3.0, to_s=9.0),
        replace(delay(-0.2187, 0.02), kind="stand_in"),
    ],
    ids=["of another sensor", "of a part of the log", "a stand-in"],
)
def test_what_is_no_rest_of_it_stays(other: Finding) -> None:
    both = (delay(0.788, None), other)
    assert with_one_delay(both) == both


def test_a_slow_vehicle_with_half_a_second_has_one_delay(tmp_path: Path) -> None:
    """An AUV at 2 m/s brakes for 15 s: the best shift on the grid is off by 0.2 s."""
    row = one_plan(6, tmp_path)
    delays = [one for one in row["findings"] if one[:2] == ["latency", "position"]]  # type: ignore[attr-defined]
    assert len(delays) <= 1
    (z,) = [one[1] for one in row["z"] if one[0] == "latency.latency_s"]  # type: ignore[attr-defined]
    assert abs(z) < 4.0
