"""Lost messages where transport swells or lasts longer from some message on: whole intervals of the
sensor are missing from its stamps, and receipts shift by as much.

Every world says itself when a sensor measured and when its messages came; stamps are right.
"""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import Series, series_of
from syncline_design.auditing.shifts import without_shifts

BEGAN_NS = 1_790_000_000 * 10**9
Times = np.ndarray


def series(stamp: Times, receive: Times) -> Series:
    ns = [np.rint(t * 1e9).astype(np.int64) + BEGAN_NS for t in (stamp, receive)]
    return series_of(ns[0], ns[1], None)


def shifts(stamp: Times, receive: Times) -> tuple[StampFault, ...]:
    return without_shifts(series(stamp, receive), least_s=1e-6).faults


def measured(rng: np.random.Generator, rate: float, lost: float) -> Times:
    """For 100 s, by a crystal that is some ppm off; some messages are lost."""
    t = rng.uniform(0.0, 0.3) + np.arange(int(100.0 * rate)) / rate * (1.0 + rng.normal(0.0, 2e-5))
    return t[rng.random(t.size) >= lost]


def swelling(t: Times, begin_s: float, height_s: float) -> Times:
    """Delays that grow and return within 8 s [s]."""
    return height_s * np.sin(np.pi * np.clip((t - begin_s) / 8.0, 0.0, 1.0))


def came(t: Times, rng: np.random.Generator, scale_s: float, more_s: Times) -> Times:
    return np.maximum.accumulate(t + 0.03 + rng.gamma(2.0, scale_s, t.size) + more_s)


@pytest.mark.parametrize("rate", [2.0, 5.0])
@pytest.mark.parametrize("height", [0.9, 1.1, 2.0])
def test_a_message_that_is_lost_in_a_swell_of_transport_is_no_step(
    rate: float, height: float
) -> None:
    """A step that lasts would leave receipts nearer to the stamps by an interval; they are as far
    from them after the swell as before it."""
    for seed in range(8):
        rng = np.random.default_rng([seed, int(rate)])
        t = measured(rng, rate, 0.08)
        receive = came(t, rng, 0.005, swelling(t, rng.uniform(25.0, 60.0), height / rate))
        assert not shifts(t, receive), seed


@pytest.mark.parametrize("rate", [2.0, 5.0, 20.0])
def test_a_step_of_an_interval_beside_a_swell_is_named(rate: float) -> None:
    for seed in range(4):
        rng = np.random.default_rng([seed, int(rate)])
        t = measured(rng, rate, 0.03)
        receive = came(t, rng, 0.005, swelling(t, 30.0, 1.1 / rate))
        at = rng.uniform(50.0, 80.0)
        (fault,) = shifts(t + (t >= at) / rate, receive)
        assert fault.fault == "step"
        assert fault.parameters["seconds"] == pytest.approx(1.0 / rate, rel=0.01)
        assert fault.from_s == pytest.approx(at - t[0], abs=0.2 + 2.0 / rate)


def without(t: Times, begin_s: float, length_s: float) -> Times:
    return t[(t < begin_s) | (t >= begin_s + length_s)]


@pytest.mark.parametrize("rate", [5.0, 50.0])
def test_the_last_messages_of_a_log_later_at_once_are_no_drift(rate: float) -> None:
    """The stamps go on at a + kT, with holes of whole intervals where messages are lost."""
    for seed in range(16):
        rng = np.random.default_rng([seed, 5, int(rate)])
        t = measured(rng, rate, 0.08)
        later = (t > 100.0 - rng.uniform(3.0, 6.0)) * rng.uniform(0.2, 0.9)
        assert not shifts(t, came(t, rng, 0.05 / rate, later)), seed


@pytest.mark.parametrize("length", [0.0, 2.0])
@pytest.mark.parametrize("rate", [2.0, 5.0, 20.0])
def test_another_way_after_an_outage_or_a_loss_is_no_step(rate: float, length: float) -> None:
    """From then on receipts come later by no whole number of intervals, by which alone stamps that
    keep their rhythm may have been set back."""
    for seed in range(8):
        rng = np.random.default_rng([seed, int(rate), int(length)])
        at = rng.uniform(30.0, 70.0)
        t = without(measured(rng, rate, 0.03), at, max(length, 1.0 / rate))
        longer = (rng.integers(0, 4) + rng.uniform(0.35, 0.65)) / rate
        assert not shifts(t, came(t, rng, 0.01 / rate, longer * (t >= at))), seed


@pytest.mark.parametrize("rate", [2.0, 5.0, 20.0])
def test_stamps_that_are_set_back_by_whole_intervals_in_a_hole_are_named(rate: float) -> None:
    for seed in range(8):
        rng = np.random.default_rng([seed, int(rate), 7])
        at, back = rng.uniform(30.0, 60.0), int(rng.integers(1, 4))
        t = without(measured(rng, rate, 0.03), at, (back + 7) / rate)
        stamp = t - (t >= at) * back / rate
        (fault,) = shifts(stamp, came(t, rng, 0.01 / rate, 0.0 * t))
        assert fault.fault in ("step", "whole_second_slip")
        assert fault.parameters["seconds"] == pytest.approx(-back / rate, abs=0.1 / rate)
