"""Single stamps and receipts that are wrong by 0.1 s to 12 years: named, and the rest as it was."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.series import Array
from syncline_design.auditing.stream import Examined
from syncline_design.machine.random_numbers import generator
from tests.stamped_streams import of

YEARS_S = 12 * 365.25 * 86_400.0
SIZES = [0.1, 0.3, 0.7, 5.3, 100.0, 3600.3, 30 * 86_400.0, YEARS_S]


def sensor(seed: int, rate: float = 50.0) -> tuple[Array, Array, np.random.Generator]:
    rng = generator((60, seed, int(rate)))
    when = rng.uniform(0.0, 0.02) + np.arange(int(90.0 * rate)) / rate
    receive = np.maximum.accumulate(when + 1e-3 + rng.gamma(2.0, 2e-3, when.size))
    return when, receive, rng


def is_sound_but_for(one: Examined, name: str, count: int, size_s: float, true_s: float) -> None:
    assert [fault.fault for fault in one.faults] == [name]
    assert one.faults[0].parameters["count"] == count
    assert one.faults[0].parameters["seconds"] == pytest.approx(size_s, abs=true_s)
    assert one.residual.bound == pytest.approx(true_s, rel=0.1)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("size_s", SIZES)
def test_a_wrong_receipt_is_named_wherever_it_lies(size_s: float, sign: float, seed: int) -> None:
    """Of a late one only what came after it tells that it was not held up on its way."""
    when, receive, rng = sensor(seed)
    for place in (0, int(rng.integers(50, when.size - 50)), when.size - 1):
        if place == when.size - 1 and 0.0 < sign * size_s < 0.5:
            continue
        spoilt = receive.copy()
        spoilt[place] += sign * size_s
        kept = np.delete(receive - when, place)
        one = of(when, spoilt)
        is_sound_but_for(one, "wrong_receipts", 1, sign * size_s, float(np.ptp(kept)))


@pytest.mark.parametrize("size_s", [0.3, 0.7, 5.3, 3600.3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_block_of_wrong_receipts_is_one(size_s: float, sign: float) -> None:
    when, receive, _ = sensor(3)
    spoilt = receive.copy()
    spoilt[1000:1020] += sign * size_s
    true_s = float(np.ptp(receive - when))
    is_sound_but_for(of(when, spoilt), "wrong_receipts", 20, sign * size_s, true_s)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("size_s", [s for s in SIZES if s > 5.0])
def test_a_wild_stamp_is_named_wherever_it_lies(size_s: float, seed: int) -> None:
    when, receive, rng = sensor(seed)
    true_s = float(np.ptp(receive - when))
    for place in (0, int(rng.integers(50, when.size - 50)), when.size - 1):
        for sign in (1.0, -1.0):
            stamp = when.copy()
            stamp[place] += sign * size_s
            is_sound_but_for(of(stamp, receive), "backward_jump", 1, sign * size_s, true_s)


@pytest.mark.parametrize("seed", range(4))
def test_several_wild_stamps_of_any_size_are_left_out(seed: int) -> None:
    """A damaged figure here and there, by 20 s to years, before and after."""
    when, receive, rng = sensor(10 + seed)
    wild = np.sort(rng.choice(np.arange(60, when.size - 60), 8, replace=False))
    stamp = when.copy()
    stamp[wild] += rng.choice([-1.0, 1.0], 8) * 10.0 ** rng.uniform(1.3, 8.0, 8)
    one = of(stamp, receive)
    assert [fault.fault for fault in one.faults] == ["backward_jump"]
    assert one.faults[0].parameters["count"] == 8
    assert one.residual.bound == pytest.approx(np.ptp(receive - when), rel=0.05)


def test_messages_that_are_held_up_are_no_wrong_receipts() -> None:
    """A host that stood still for 0.4 s: what waited comes at once, and nothing comes before it."""
    when, receive, _ = sensor(4)
    late = np.maximum(receive, np.where((when > 40.0) & (when < 40.4), when[0] + 40.5, 0.0))
    assert not of(when, np.maximum.accumulate(late)).faults


@pytest.mark.parametrize(("size_s", "kind"), [(36.0, "tai"), (17.0, "gps"), (-36.0, "tai")])
def test_scales_of_before_2017_have_a_name(size_s: float, kind: str) -> None:
    when, receive, _ = sensor(5)
    (fault,) = of(when + size_s, receive).faults
    assert (fault.fault, fault.parameters["kind"]) == ("epoch_offset", kind)
    assert fault.parameters["seconds"] == size_s
    assert "2015" in fault.evidence


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clock_that_is_set_and_settles_within_a_second_is_no_wrong_receipt(sign: float) -> None:
    """Its stamps never fall, and lie among the others as those of wrong receipts do."""
    when, receive, _ = sensor(6)
    since = when - 40.0
    stamp = when + np.where(since > 0.0, sign * 0.3 * np.exp(-np.maximum(since, 0.0) / 0.4), 0.0)
    names = {fault.fault for fault in of(stamp, receive).faults}
    assert "wrong_receipts" not in names
    assert names & {"relock", "step", "backward_jump"}


@pytest.mark.parametrize("length_s", [0.4, 0.8, 1.5])
def test_what_a_host_held_up_for_long_makes_no_receipt_behind_it_wrong(length_s: float) -> None:
    """More messages wait than tell the level: those that came in time are not early."""
    when, receive, _ = sensor(7, 200.0)
    held = (when > 40.0) & (when < 40.0 + length_s)
    late = np.maximum.accumulate(np.maximum(receive, np.where(held, 40.0 + length_s, 0.0)))
    assert "wrong_receipts" not in {fault.fault for fault in of(when, late).faults}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("held_s", [0.06, 0.12, 0.2])
def test_first_messages_that_a_host_held_up_as_it_does_others_are_right(
    held_s: float, seed: int
) -> None:
    """A sensor of random intervals; the collector of a host's memory stops it every 3 to 15 s."""
    rng = generator((61, seed, int(1e3 * held_s)))
    when = np.cumsum(rng.exponential(0.025, 6000))
    came = when + 1e-3 + rng.gamma(2.0, 5e-4, when.size)
    begin = when[0] - 1e-3
    while begin < when[-1]:
        in_pause = (came >= begin) & (came < begin + held_s)
        came[in_pause] = begin + held_s + 2e-4 * np.arange(in_pause.sum())
        begin += rng.uniform(3.0, 15.0)
    found = of(when, np.maximum.accumulate(came))
    assert not any(fault.fault == "backward_jump" for fault in found.faults)
