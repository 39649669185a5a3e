"""Sensors that are switched on now and then, beside sensors whose link breaks now and then.

What is expected is what was written down: which moments were measured, and which messages a link
swallowed.
"""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.stream import Stamps, Stream

START = 1_780_000_000_000_000_000


def audited(true: np.ndarray, rng: np.random.Generator) -> tuple[Examined, np.ndarray]:
    """Right stamps that a queue delays; with the delays [s]."""
    came = np.maximum.accumulate(true + 2e-3 + rng.gamma(2.0, 1e-3, true.size))
    came += 1e-9 * np.arange(true.size)  # one after the other
    stamp, receive = (START + np.round(t * 1e9).astype(np.int64) for t in (true, came))
    stamps = Stamps("header.stamp", "log time", stamp, receive)
    return examined(Stream("x", (), true.size, stamps)), (receive - stamp) / 1e9


def bursts(begins: np.ndarray, messages: int, rate_hz: float) -> np.ndarray:
    return np.asarray((begins[:, None] + np.arange(messages) / rate_hz).ravel())


def sound(one: Examined, late: np.ndarray) -> None:
    assert one.faults == ()
    assert one.residual.bound == pytest.approx(float(np.ptp(late)), rel=1e-3)


@pytest.mark.parametrize(
    ("rate_hz", "messages"), [(10.0, 25), (50.0, 25), (100.0, 40), (50.0, 300)]
)
@pytest.mark.parametrize("seed", range(4))
def test_bursts_of_a_phase_of_their_own_are_how_messages_come(
    rate_hz: float, messages: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    length = messages / rate_hz
    begins = np.cumsum(rng.uniform(1.8 * length + 0.5, 3.0 * length + 4.0, 18))
    one, late = audited(bursts(begins, messages, rate_hz), rng)
    sound(one, late)
    assert one.pace.pauses is not None
    assert (one.pace.pauses.count, one.pace.pauses.anew) == (17, True)


@pytest.mark.parametrize(
    ("rate_hz", "messages", "every_s"), [(100.0, 12, 1.5), (1000.0, 3, 1.0), (50.0, 9, 2.0)]
)
@pytest.mark.parametrize("jitter_s", [0.0, 0.01])
def test_short_bursts_are_no_packets(
    rate_hz: float, messages: int, every_s: float, jitter_s: float
) -> None:
    """A packet hands over its messages at once; these are as far apart as they were measured."""
    rng = np.random.default_rng(5)
    begins = every_s * np.arange(100) + jitter_s * rng.standard_normal(100)
    sound(*audited(bursts(begins, messages, rate_hz), rng))


def test_bursts_of_any_number_are_no_packets() -> None:
    rng = np.random.default_rng(6)
    counts, begins = rng.integers(4, 15, 75), 2.0 * np.arange(75) + 0.1 * rng.standard_normal(75)
    true = np.concatenate(
        [begin + 0.02 * np.arange(count) for begin, count in zip(begins, counts, strict=True)]
    )
    sound(*audited(true, rng))


@pytest.mark.parametrize("rate_hz", [10.0, 50.0])
@pytest.mark.parametrize(("on_s", "off_s", "cycles"), [(2.0, 3.0, 18), (4.0, 2.0, 15), (10, 20, 4)])
def test_a_duty_cycle_is_how_messages_come(
    rate_hz: float, on_s: float, off_s: float, cycles: int
) -> None:
    begins = (on_s + off_s) * np.arange(cycles)
    sound(*audited(bursts(begins, int(on_s * rate_hz), rate_hz), np.random.default_rng(2)))


@pytest.mark.parametrize("anew", [True, False])
def test_messages_that_events_set_off_come_when_there_are_some(anew: bool) -> None:
    """A tracker at 20 Hz that sees something for 2 s in the mean, and then for 6 s nothing."""
    rng = np.random.default_rng(3)
    seen, parts, at = [], rng.exponential([2.0, 6.0], (15, 2)) + 0.5, 0.0
    for on, off in parts:
        begin = at if anew else np.ceil(at * 20.0) / 20.0
        seen.append(begin + np.arange(0.0, on, 0.05))
        at = at + on + off
    sound(*audited(np.concatenate(seen), rng))


@pytest.mark.parametrize("rate_hz", [10.0, 50.0])
def test_breaks_of_a_link_are_gaps(rate_hz: float) -> None:
    """Seven, 0.8 to 6 s long, at any time: the sensor goes on to measure."""
    true = np.arange(0.0, 150.0, 1.0 / rate_hz)
    lost = np.zeros(true.size, bool)
    ends = {9.0: 9.8, 23.0: 29.0, 41.0: 43.2, 48.0: 49.1, 90.0: 94.4, 108.0: 108.9, 131.0: 134.0}
    for begin, end in ends.items():
        lost |= (true > begin) & (true < end)
    one, _ = audited(true[~lost], np.random.default_rng(1))
    assert [f.fault for f in one.faults] == ["gap"] * 7


def test_breaks_in_a_beat_that_take_little_of_the_time_are_gaps() -> None:
    true = np.arange(0.0, 120.0, 0.02)
    one, _ = audited(true[(true % 15.0 < 14.0) | (true % 15.0 > 14.7)], np.random.default_rng(4))
    assert [f.fault for f in one.faults] == ["gap"] * 8


@pytest.mark.parametrize(
    ("on_s", "off_s", "length_s"), [(60.0, 60.0, 600.0), (10.0, 20.0, 90.0), (30.0, 10.0, 130.0)]
)
def test_equal_silences_of_one_cycle_are_how_messages_come(
    on_s: float, off_s: float, length_s: float
) -> None:
    rng = np.random.default_rng(7)
    true = 0.013 + np.arange(int(20.0 * length_s)) / 20.0
    sound(*audited(true[np.mod(true, on_s + off_s) < on_s], rng))


@pytest.mark.parametrize(
    "silences",
    [
        [(20.0, 100.0)],  # one, of more than half of the log
        [(20.0, 40.0), (60.0, 80.3)],  # two of no one length
        [(60.0, 80.0), (90.0, 110.0)],  # two of one length, longer apart from the ends
    ],
)
def test_silences_of_no_cycle_are_gaps(silences: list[tuple[float, float]]) -> None:
    rng = np.random.default_rng(8)
    true = 0.013 + np.arange(3000) / 20.0
    kept = np.all([(true < begin) | (true > end) for begin, end in silences], axis=0)
    one, _ = audited(true[kept], rng)
    assert [f.fault for f in one.faults] == ["gap"] * len(silences)
