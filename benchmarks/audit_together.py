"""A fourth corpus for `audit`: stamp faults together, beside whatever changes messages' order.

What happens to a message happens in this order, and each step knows only what the ones before did:

    the sensor measures (an even rhythm, or a sonar whose interval follows the depth)
    its clock says when (drift, step, slip, epoch, a counter that begins anew)
    its driver spoils single stamps (repeated, set back, left at zero)
    transport loses messages and delays each; one may overtake others
    the recorder's clock says when each came (it may be set)
    the recorder writes them, some later than others
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from benchmarks.audit_corpus import Made, MadeRecording

Array = np.ndarray
LENGTH_S = 70.0
RATES = (4.0, 10.0, 25.0, 50.0, 125.0, 200.0)
EPOCH_NS = 1_710_000_000 * 10**9


@dataclass
class World:
    """One stream between its sensor and the file; times in seconds since the recording's begin."""

    rng: np.random.Generator
    rate: float
    measured: Array
    stamp: Array
    delay: Array
    spoiled: Array  # messages whose stamp says nothing of their delay
    lost: Array
    zero: Array
    whole: list[Callable[[Array], Array]] = field(default_factory=list)  # on whole stamps
    host: Callable[[Array], Array] = field(default=lambda receive: receive)
    queue: bool = True
    written: Callable[[Array], Array] | None = None  # places in the file, of receipts in order
    planted: list[str] = field(default_factory=list)
    sizes: dict[str, float] = field(default_factory=dict)

    def free(self, many: int) -> Array:
        """So many places that nothing was done to yet, none beside another."""
        taken = self.spoiled | self.lost
        taken = taken | np.roll(taken, 1) | np.roll(taken, -1)
        taken[:3] = taken[-3:] = True
        places = np.flatnonzero(~taken)
        places = np.sort(self.rng.choice(places, size=min(many, places.size // 4), replace=False))
        return places[np.diff(places, prepend=-9) > 2]


def world(rng: np.random.Generator, sensor: str, rate: float) -> World:
    n = int(LENGTH_S * rate)
    if sensor == "sonar":  # there and back through water, and a pause
        turn = 2 * np.pi * (np.arange(n) / n * rng.uniform(1.0, 4.0) + rng.uniform())
        interval = (1.0 + rng.uniform(0.2, 0.5) * np.sin(turn)) / rate
        measured = rng.uniform(0.2, 1.0) / rate + np.cumsum(interval)
    else:
        measured = (np.arange(n) + rng.uniform()) / (rate * (1.0 + rng.normal(0.0, 2e-5)))
        measured = measured + rng.normal(0.0, 1e-3 * rng.uniform() / rate, n)
    theta = min(10 ** rng.uniform(-3.5, -2.0), 0.1 / rate)
    delay = theta * rng.choice([0.0, 2.0]) + rng.gamma(2.0, theta, n)
    none = np.zeros(n, bool)
    return World(rng, rate, measured, measured.copy(), delay, none.copy(), none.copy(), none)


# ---- what changes the order ------------------------------------------------------------------


def in_turn(w: World) -> None:
    """Nothing does."""


def overtaking(w: World) -> None:
    """Every message waits by itself, for about its interval."""
    w.queue = False
    reach = w.rng.uniform(1.0, 4.0) / w.rate
    w.delay = w.delay + (w.rng.uniform(0.0, reach, w.delay.size) if w.rng.uniform() < 0.5
                         else w.rng.exponential(reach / 3.0, w.delay.size))  # fmt: skip


def a_few_overtaken(w: World) -> None:
    """One message in some hundred waits until others have passed it."""
    w.queue = False
    w.delay = np.maximum.accumulate(w.measured + w.delay) - w.measured
    held = w.rng.uniform(size=w.delay.size) < 10 ** w.rng.uniform(-2.5, -1.3)
    w.delay = w.delay + held * w.rng.uniform(0.5, 6.0, w.delay.size) / w.rate


def written_late(w: World) -> None:
    """Messages lie in the file some places behind their own, with both their times."""
    share, reach = w.rng.choice([0.01, 0.1, 0.5]), w.rng.integers(2, 12)

    def places(receive: Array) -> Array:
        late = w.rng.uniform(size=receive.size) < share
        return np.argsort(
            np.arange(receive.size) + late * w.rng.uniform(1.0, reach, receive.size), kind="stable"
        )

    w.written = places


def noted_by_threads(w: World) -> None:
    """A receipt is noted up to a millisecond early or late."""
    off = w.rng.uniform(0.0, min(1e-3, 0.1 / w.rate), w.delay.size)
    w.delay = np.maximum.accumulate(w.measured + w.delay) - w.measured + off
    w.queue = False
    w.written = lambda receive: np.arange(receive.size)


ORDERS: dict[str, Callable[[World], None]] = {
    f.__name__: f for f in (in_turn, overtaking, a_few_overtaken, written_late, noted_by_threads)
}


# ---- faults ----------------------------------------------------------------------------------


def _reach(w: World) -> float:
    """How far delays scatter [s]."""
    return float(np.subtract(*np.percentile(w.delay, [90.0, 10.0])))


def whole_second_slip(w: World) -> None:
    begin = w.rng.uniform(12.0, 40.0)
    end = begin + w.rng.uniform(4.0, 20.0)
    size = float(w.rng.choice([-2.0, -1.0, 1.0, 2.0]))
    w.stamp = w.stamp + size * ((w.measured > begin) & (w.measured < end))


def step(w: World) -> None:
    size = _reach(w) * 10 ** w.rng.uniform(0.3, 1.3) * w.rng.choice([-1.0, 1.0])
    w.stamp = w.stamp + size * (w.measured > w.rng.uniform(20.0, 50.0))
    w.sizes["seconds"] = float(size)


def drift(w: World) -> None:
    total = min(_reach(w) * 10 ** w.rng.uniform(0.4, 1.5), 0.01 * LENGTH_S)
    w.stamp = w.stamp + total * w.rng.choice([-1.0, 1.0]) * w.measured / LENGTH_S


def epoch_offset(w: World) -> None:
    w.stamp = w.stamp + float(w.rng.choice([37.0, -37.0, 18.0, 7200.0]))


def counter_wrap(w: World) -> None:
    wrap = int(w.rng.choice([10**9 * 60, 2**32, 2**24 * 1000, 2**15 * 10**6, 10**10, 2**32 * 1000]))
    wrap = max(wrap, round(8e9 / w.rate))
    first = int(w.rng.uniform(0.2, 0.8) * min(wrap, 60e9))
    w.whole.append(lambda s: (s - EPOCH_NS - first) % wrap)


def duplicates(w: World) -> None:
    at = w.free(int(w.rng.integers(2, max(4, w.stamp.size // 60))))
    w.stamp[at] = w.stamp[at - 1]
    w.spoiled[at] = True


def backward_jump(w: World) -> None:
    at = w.free(int(w.rng.integers(2, 7)))
    whole = w.rng.integers(1, 30, at.size)
    w.stamp[at] -= (whole + w.rng.uniform(0.25, 0.75, at.size)) / w.rate
    w.spoiled[at] = True


def unset_stamps(w: World) -> None:
    at = w.free(max(2, int(w.stamp.size * w.rng.choice([0.01, 0.05]))))
    w.zero[at] = True
    w.spoiled[at] = True


def lost_messages(w: World) -> None:
    w.lost |= w.rng.uniform(size=w.lost.size) < w.rng.uniform(0.01, 0.05)
    w.lost[w.lost.size // 2] = True
    w.lost[[0, -1]] = False


def gap(w: World) -> None:
    begin = w.rng.uniform(15.0, 50.0)
    w.lost |= (w.measured > begin) & (w.measured < begin + w.rng.uniform(4.0, 10.0))


FAULTS: dict[str, Callable[[World], None]] = {
    f.__name__: f for f in (whole_second_slip, step, drift, epoch_offset, counter_wrap, duplicates,
                            backward_jump, unset_stamps, lost_messages, gap)
}  # fmt: skip
_CLOCKS = ("whole_second_slip", "step", "drift", "epoch_offset", "counter_wrap")  # one of them
_LOSSES = ("lost_messages", "gap")
_NO_RHYTHM = ("lost_messages", "step")


def finish(w: World, name: str, sound_as: str = "") -> Made:
    stamp = EPOCH_NS + np.rint(w.stamp * 1e9).astype(np.int64)
    for change in w.whole:
        stamp = change(stamp)
    stamp = np.where(w.zero, 0, stamp)
    came = w.measured + w.delay
    came = came if not w.queue else np.maximum.accumulate(came)
    used = (came - w.measured)[~w.lost & ~w.spoiled]
    stamp, came = stamp[~w.lost], came[~w.lost]
    order = np.argsort(came, kind="stable") if w.written is None or w.queue else slice(None)
    stamp, came = stamp[order], came[order]
    if w.written is not None:
        places = w.written(came)
        stamp, came = stamp[places], came[places]
    receive = EPOCH_NS + np.rint(w.host(came) * 1e9).astype(np.int64)
    return Made(name, stamp, receive, tuple(w.planted), w.sizes, float(np.ptp(used)), sound_as)


def _turn(fault: str) -> int:
    """Losses are drawn first, as no driver repeats what is lost; clocks act before drivers."""
    return 0 if fault in _LOSSES else 1 if fault in _CLOCKS else 2


def made(
    rng: np.random.Generator, order: str, faults: tuple[str, ...], name: str, *,
    sensor: str = "even", beside: bool = False, host_s: float = 0.0,
) -> MadeRecording:  # fmt: skip
    """A recording of one stream, or of a second sound one beside it; host_s: the host's clock is
    set by so much."""
    at = rng.uniform(20.0, 50.0)
    streams = []
    for k in range(2 if beside else 1):
        w = world(rng, sensor if k == 0 else "even", float(rng.choice(RATES)))
        ORDERS[order if k == 0 else "in_turn"](w)
        for fault in sorted(faults, key=_turn) if k == 0 else ():
            FAULTS[fault](w)
            w.planted.append(fault)
        if host_s:
            w.host = lambda came: came + host_s * (came > at)
            w.planted.append("recorder_clock")
        streams.append(finish(w, f"{name}_{k}", "" if w.planted else f"{sensor}, {order}"))
    return MadeRecording(name, tuple(streams))


def _drawn(rng: np.random.Generator, sensor: str) -> tuple[str, ...]:
    """One to three faults that a stream can have at once."""
    able = [f for f in FAULTS if sensor == "even" or f not in _NO_RHYTHM]
    while True:
        names = tuple(str(f) for f in rng.choice(able, size=rng.integers(1, 4), replace=False))
        if sum(f in _CLOCKS for f in names) <= 1:
            return names


def corpus(seed: int, each: int = 8, sound_each: int = 10) -> Iterator[MadeRecording]:
    """Recordings of every order and sensor; each: of those with faults, for each of the orders."""
    root = np.random.SeedSequence([seed, 401])
    for order in ORDERS:
        for k, s in enumerate(root.spawn(6 * each)):
            rng = np.random.default_rng(s)
            sensor = "sonar" if k % 5 == 4 else "even"
            host = float(rng.choice([-1, 1]) * rng.uniform(0.1, 1.5)) if k % 6 == 5 else 0.0
            beside = bool(host) or k % 2 == 1
            faults = _drawn(rng, sensor)
            name = f"{order}_{sensor}_{'_'.join(faults)}_{k}"
            yield made(rng, order, faults, name, sensor=sensor, beside=beside, host_s=host)
        for k, s in enumerate(root.spawn(2 * sound_each)):
            rng = np.random.default_rng(s)
            sensor = "sonar" if k % 2 else "even"
            yield made(rng, order, (), f"sound_{order}_{sensor}_{k}", sensor=sensor)
