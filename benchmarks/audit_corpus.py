"""Logs with planted stamp faults, and sound ones that look odd, for `benchmarks/audit.py`.

It knows nothing of the auditor: delays, sizes and places are drawn from what is known of recorders
and sensors.  Times are whole nanoseconds.  A recording holds one stream or several.

    stamp = measured at, as the faulty clock says          receive = measured at + delay
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
DURATION_S = 75.0
RATES = (5.0, 10.0, 23.0, 50.0, 100.0, 130.0, 200.0)
# smallest step [delay scales] that such a rate shows in 75 s
VISIBLE = {5.0: 1.5, 10.0: 1.5, 23.0: 1.0, 50.0: 0.75, 100.0: 0.5, 130.0: 0.5, 200.0: 0.5}


@dataclass(frozen=True)
class Made:
    """One stream: both times [ns], what was planted (names) and what must be left of its delay."""

    name: str
    stamp_ns: Whole
    receive_ns: Whole
    planted: tuple[str, ...] = ()
    sizes: dict[str, float] = field(default_factory=dict)
    bound_s: float | None = None  # largest minus smallest delay; None: not comparable
    sound_as: str = ""
    factor: int = 1  # by which the file's stamps are larger than stamp_ns: another unit


@dataclass(frozen=True)
class MadeRecording:
    name: str
    streams: tuple[Made, ...]
    planted: tuple[str, ...] = ()  # of the whole recording


@dataclass
class Draft:
    """A stream in the making: true times, stamps (as float offsets from true) and receipts."""

    rng: np.random.Generator
    rate: float
    theta: float
    true: Array  # seconds since the start
    stamp: Array  # seconds, same origin, as the clock of the stamps says
    delay: Array
    start_ns: int
    base: float
    planted: list[str] = field(default_factory=list)
    sizes: dict[str, float] = field(default_factory=dict)
    keep: NDArray[np.bool_] | None = None
    whole_ns: Callable[[Whole], Whole] | None = None  # last change, on the whole stamps
    comparable: bool = True
    factor: int = 1
    disorder: float = 0.0  # share of receipts noted out of order
    spoiled: NDArray[np.bool_] | None = None  # messages whose delay is not in the bound
    wrong_s: Array | None = None  # by how much receipts are wrong


def draft(rng: np.random.Generator, rate: float | None = None, law: str = "gamma") -> Draft:
    rate = float(rng.choice(RATES)) if rate is None else rate
    theta = (
        float(10 ** rng.uniform(-4.0, -2.3)) if rate > 50 else float(10 ** rng.uniform(-3.7, -2))
    )
    theta = min(theta, 0.15 / rate)
    n = int(DURATION_S * rate)
    own = rate * (1.0 + rng.normal(0.0, 30e-6))  # the sensor's own crystal
    true = (np.arange(n) + rng.uniform()) / own
    if rng.uniform() < 0.3:
        true = true + rng.normal(0.0, 10e-6, n)
    base = theta * float(rng.choice([0.0, 1.0, 5.0]))
    delay = base + draw_delays(rng, n, theta, law)
    start_ns = 1_600_000_000_000_000_000 + int(rng.integers(0, 10**17)) * 3
    return Draft(rng, rate, theta, true, true.copy(), delay, start_ns, base)


def draw_delays(rng: np.random.Generator, n: int, theta: float, law: str) -> Array:
    if law == "gamma":
        return rng.gamma(2.0, theta, n)
    if law == "lognormal":
        return theta * rng.lognormal(0.5, 0.6, n)
    if law == "exponential":
        return rng.exponential(1.5 * theta, n)
    if law == "weibull":
        return 2.0 * theta * rng.weibull(1.5, n)
    if law == "two paths":
        slow = rng.uniform(size=n) < 0.15
        return rng.gamma(2.0, theta, n) + np.where(slow, 3.0 * theta, 0.0)
    if law == "remembering":
        ar = np.zeros(n)
        shocks = rng.normal(0.0, 1.0, n)
        for k in range(1, n):
            ar[k] = 0.7 * ar[k - 1] + 0.71 * shocks[k]
        return theta * 2.0 * np.exp(0.5 * ar)
    raise ValueError(law)


LAWS = (
    "gamma",
    "gamma",
    "gamma",
    "lognormal",
    "exponential",
    "weibull",
    "two paths",
    "remembering",
)


def finish(d: Draft, name: str, sound_as: str = "") -> Made:
    receive = np.maximum.accumulate(d.true + d.delay)
    if d.disorder:  # two threads: a receipt is noted less than a millisecond before the one before
        at = np.flatnonzero(d.rng.uniform(size=receive.size) < d.disorder)
        at = at[at > 0]
        late = receive[at - 1] - d.rng.uniform(5e-5, 9e-4, at.size)
        near = np.abs(late - receive[at]) < 2.0 * d.theta
        receive[at[near]] = late[near]
    stamp_ns = d.start_ns + np.round(d.stamp * 1e9).astype(np.int64)
    receive_ns = d.start_ns + np.round(receive * 1e9).astype(np.int64)
    if d.whole_ns is not None:
        stamp_ns = d.whole_ns(stamp_ns)
    if d.wrong_s is not None:
        receive_ns += np.round(d.wrong_s * 1e9).astype(np.int64)
    used = (receive - d.true)[~d.spoiled] if d.spoiled is not None else receive - d.true
    if d.keep is not None:
        stamp_ns, receive_ns = stamp_ns[d.keep], receive_ns[d.keep]
        used = (receive - d.true)[d.keep]
    bound = float(used.max() - used.min()) if d.comparable else None
    return Made(
        name, stamp_ns, receive_ns, tuple(d.planted), d.sizes, bound, sound_as, d.factor
    )  # fmt: skip


# ---- faults ---------------------------------------------------------------------------------


def epoch_offset(d: Draft) -> None:
    kind = d.rng.choice(["tai", "gps", "tai_gps", "boot", "zone", "week", "gps_epoch", "unit",
                         "behind", "day", "unix unit"])  # fmt: skip
    start_s = d.start_ns // 10**9
    if kind in ("tai", "gps", "tai_gps"):
        d.stamp = d.stamp + {"tai": 37.0, "gps": 18.0, "tai_gps": 19.0}[kind] * d.rng.choice(
            [1, -1]
        )
    elif kind == "zone":
        d.stamp = d.stamp + 3600.0 * d.rng.choice([-8.0, -5.0, -3.5, 1.0, 2.0, 5.5, 9.0])
    elif kind == "boot":
        shift = d.start_ns - int(d.rng.uniform(5, 50_000) * 1e9)
        d.whole_ns = lambda s: s - shift
    elif kind == "week":
        gps_ns = d.start_ns - 315_964_800 * 10**9 + 18 * 10**9
        week = gps_ns // (604_800 * 10**9) * (604_800 * 10**9)
        d.whole_ns = lambda s: s - 315_964_800 * 10**9 + 18 * 10**9 - week
    elif kind == "behind":  # no whole second, no epoch that is known
        d.stamp = d.stamp - float(d.rng.choice([0.7, 1.5, 2.5, 5.5, 12.3, 23.0, 36.0]))
    elif kind == "day":  # of whichever weekday it is
        midnight = start_s // 86_400 * 86_400 * 10**9
        d.whole_ns = lambda s: s - midnight
    elif kind == "unix unit":  # milli-, micro-, nanoseconds since 1970 as if seconds
        d.factor = int(d.rng.choice([10**3, 10**6, 10**9]))
    elif kind == "gps_epoch":
        d.whole_ns = lambda s: s - 315_964_800 * 10**9 + 18 * 10**9
    else:
        factor = float(d.rng.choice([1e-3, 1e-6, 1e-9, 1e3]))
        if factor > 1:  # 64 bits of nanoseconds would not hold it from 1970: since boot
            d.whole_ns = lambda s: ((s - d.start_ns) + 10**12) * 1000
        else:
            d.whole_ns = lambda s: np.round(s.astype(np.float64) * factor).astype(np.int64)
        if factor < 1e-4:
            d.comparable = False  # what is left of the stamps is too coarse
        d.sizes["factor"] = factor
    assert start_s > 0
    d.planted.append("epoch_offset")


def whole_second_slip(d: Draft) -> None:
    begin = d.rng.uniform(15, 45)
    length = d.rng.uniform(4, 20)
    seconds = float(d.rng.choice([-1.0, 1.0, 2.0, -2.0], p=[0.4, 0.4, 0.1, 0.1]))
    d.stamp = d.stamp + np.where((d.true >= begin) & (d.true < begin + length), seconds, 0.0)
    d.planted.append("whole_second_slip")
    d.sizes |= {"seconds": seconds, "from_s": begin}


def whole_second_late(d: Draft) -> None:
    """The pulse of another second from the first message to the last."""
    d.stamp = d.stamp - float(d.rng.choice([1.0, 2.0, 3.0]))
    d.planted.append("whole_second_slip")


def step(d: Draft) -> None:
    at = d.rng.uniform(18, 57)
    smallest = VISIBLE[min(VISIBLE, key=lambda r: abs(r - d.rate))]
    size = d.theta * smallest * float(10 ** d.rng.uniform(0.0, 1.5)) * d.rng.choice([-1, 1])
    if d.rng.uniform() < 0.2:
        size = float(d.rng.uniform(0.1, 0.9)) * d.rng.choice([-1, 1])
    d.stamp = d.stamp + np.where(d.true >= at, size, 0.0)
    d.planted.append("step")
    d.sizes |= {"seconds": size, "from_s": at}


def drift(d: Draft) -> None:
    total = d.theta * float(10 ** d.rng.uniform(0.5, 2.0)) * d.rng.choice([-1, 1])
    d.stamp = d.stamp + total * d.true / DURATION_S
    d.planted.append("drift")
    d.sizes["ppm"] = 1e6 * total / DURATION_S


def counter_wrap(d: Draft) -> None:
    wrap = int(d.rng.choice([
        2**32 * 1000, 2**32, 2**31 * 1000, 2**16 * 10**6, 2**32 * 10**6, 2**24 * 1000, 10**9,
        2**24 * 100, 2**15 * 10**5, 2**16 * 10**5, 2**16 * 10**4, 60 * 10**9, 25 * 10**9, 10**10,
    ]))  # fmt: skip
    wrap = max(wrap, int(8e9 / d.rate))  # several messages between two of them
    at = int(d.rng.uniform(10, 60) * 1e9) if wrap > 75e9 else int(d.rng.integers(0, wrap))
    d.whole_ns = lambda s: (s - d.start_ns - at) % wrap
    d.planted.append("counter_wrap")
    d.sizes["wrap_s"] = wrap / 1e9


def relock(d: Draft) -> None:
    at = d.rng.uniform(10, 35)
    size = d.theta * float(10 ** d.rng.uniform(1.0, 2.3)) * d.rng.choice([-1, 1])
    settling = d.rng.uniform(2.0, 8.0)
    gone = np.where(d.true >= at, np.exp(-np.maximum(d.true - at, 0.0) / settling), 0.0)
    d.stamp = d.stamp + size * gone
    d.planted.append("relock")
    d.sizes |= {"seconds": size, "settling_s": settling, "from_s": at}


def packetised(d: Draft) -> None:
    phase = d.rng.uniform(0, 0.016)
    arrival = np.ceil((d.true - phase) / 0.016) * 0.016 + phase
    if d.rng.uniform() < 0.5:
        arrival = arrival + d.rng.gamma(2.0, 30e-6, arrival.size)
    d.stamp = np.maximum.accumulate(arrival)
    d.delay = d.stamp - d.true + d.delay * 0.05
    d.planted.append("packetised")
    d.comparable = False


def whole_packets(d: Draft) -> None:
    """Packets that hold the same number of messages every time."""
    each = int(d.rng.choice([2, 4, 5, 8]))
    tick = each / d.rate
    d.true = (np.arange(d.true.size) + d.rng.uniform(0.05, 0.95)) / d.rate
    d.stamp = np.ceil(d.true / tick) * tick
    if d.rng.uniform() < 0.5:
        d.delay = d.stamp - d.true + np.maximum.accumulate(d.delay * 0.05)
    else:
        d.delay = tick + d.delay
    d.planted.append("packetised")
    d.comparable = False


def truncated_stamps(d: Draft) -> None:
    resolution = 0.001 if d.theta < 2e-4 or d.rng.uniform() < 0.5 else 0.01
    d.whole_ns = lambda s: s // int(resolution * 1e9) * int(resolution * 1e9)
    d.planted.append("truncated_stamps")
    d.sizes["resolution_s"] = resolution
    d.comparable = False


def stamped_on_arrival(d: Draft) -> None:
    d.stamp = np.maximum.accumulate(d.true + d.delay)
    d.delay = d.stamp - d.true + d.rng.gamma(2.0, d.theta / 20, d.true.size)
    d.planted.append("stamped_on_arrival")
    d.comparable = False


def duplicates(d: Draft) -> None:
    n = d.true.size
    places = d.rng.choice(
        np.arange(2, n), size=int(d.rng.integers(2, max(3, n // 50))), replace=False
    )
    for k in np.sort(places):
        d.stamp[k] = d.stamp[k - 1]
    d.spoiled = np.isin(np.arange(n), places)
    d.planted.append("duplicates")


def backward_jump(d: Draft) -> None:
    n = d.true.size
    places = d.rng.choice(np.arange(2, n - 2), size=int(d.rng.integers(1, 6)), replace=False)
    back = d.rng.uniform(1.5, 40) / d.rate
    d.stamp[places] -= back
    d.spoiled = np.isin(np.arange(n), places)
    d.planted.append("backward_jump")


def gap(d: Draft) -> None:
    begin, length = d.rng.uniform(15, 50), d.rng.uniform(2, 12)
    d.keep = ~((d.true >= begin) & (d.true < begin + length))
    d.planted.append("gap")
    d.sizes |= {"from_s": begin, "interval_s": length}


def lost_messages(d: Draft) -> None:
    n = d.true.size
    lost = d.rng.uniform(size=n) < 10 ** d.rng.uniform(-2.0, -1.3)
    lost[[0, -1]] = False
    lost[int(n // 2)] = True
    d.keep = ~lost
    d.planted.append("lost_messages")


def unset_stamps(d: Draft) -> None:
    n = d.true.size
    share = d.rng.choice([0.01, 0.1, 1.0])
    mask = d.rng.uniform(size=n) < share
    mask[n // 3] = True
    d.whole_ns = lambda s: np.where(mask, 0, s)
    d.comparable = False
    d.planted.append("unset_stamps")


def _somewhere(d: Draft, most: int) -> NDArray[np.int64]:
    """One message, some, or the first or the last of the log."""
    n = d.true.size
    where = d.rng.choice(["one", "some", "first", "last"])
    if where in ("first", "last"):
        return np.asarray([0 if where == "first" else n - 1])
    inside = np.arange(n // 20, n - n // 20, 7)
    return np.sort(d.rng.choice(inside, 1 if where == "one" else most, replace=False))


def wrong_receipts(d: Draft) -> None:
    """Figures that are damaged, of any size that no thread waits for; a block of them at times."""
    n = d.true.size
    least = max(0.1, 60.0 * d.theta, 6.0 / d.rate)
    size = 10.0 ** d.rng.uniform(np.log10(least), 8.0) * d.rng.choice([-1.0, 1.0])
    places = _somewhere(d, 5)
    if places[0] == n - 1 and size > 0.0:
        size = max(size, 1.0)
    if places.size > 1 and d.rng.uniform() < 0.5:  # longer than it is off, so that receipts fall
        places = places[0] + np.arange(int(d.rng.integers(6, 40)))
        size = np.sign(size) * max(abs(size), 2.0 * places.size / d.rate)
    d.wrong_s = np.zeros(n)
    d.wrong_s[places] = size
    d.spoiled = d.wrong_s != 0.0
    d.planted.append("wrong_receipts")
    d.sizes["seconds"] = float(size)


def wild_stamps(d: Draft) -> None:
    """By seconds to years, one, several, the first or the last."""
    places = _somewhere(d, int(d.rng.integers(2, 9)))
    sizes = 10.0 ** d.rng.uniform(1.2, 8.0, places.size) * d.rng.choice([-1.0, 1.0], places.size)
    d.stamp[places] += sizes
    d.spoiled = np.isin(np.arange(d.true.size), places)
    d.planted.append("backward_jump")


def ahead_of_receipt(d: Draft) -> None:
    d.stamp = d.stamp + d.base + d.theta * 10 + d.rng.uniform(0.002, 0.4)
    d.planted.append("ahead_of_receipt")


FAULTS: dict[str, Callable[[Draft], None]] = {
    f.__name__: f
    for f in (epoch_offset, whole_second_slip, step, drift, counter_wrap, relock, packetised,
              truncated_stamps, stamped_on_arrival, duplicates, backward_jump, gap, lost_messages,
              unset_stamps, ahead_of_receipt, whole_second_late, whole_packets, wrong_receipts,
              wild_stamps)
}  # fmt: skip
PAIRS = (
    ("epoch_offset", "drift"), ("epoch_offset", "whole_second_slip"), ("step", "gap"),
    ("drift", "lost_messages"), ("drift", "duplicates"), ("whole_second_slip", "drift"),
    ("relock", "gap"), ("step", "duplicates"), ("whole_second_slip", "lost_messages"),
    ("backward_jump", "drift"), ("step", "drift"), ("ahead_of_receipt", "gap"),
    ("packetised", "whole_second_slip"),
)  # fmt: skip
_RATE_OF = {
    "whole_packets": (50.0, 100.0, 200.0),
    "packetised": (25.0, 50.0, 100.0, 200.0, 400.0),
    "truncated_stamps": (23.0, 30.0, 130.0),
}


# ---- sound but odd --------------------------------------------------------------------------


def plain(d: Draft) -> None:
    pass


def scheduling_batches(d: Draft) -> None:
    quantum = float(d.rng.choice([0.004, 0.005, 0.01, 0.02, 0.03]))
    wake = (
        np.arange(0.0, DURATION_S + 1.0, quantum)
        + d.rng.uniform(0, 0.2 * quantum, int((DURATION_S + 1) / quantum) + 1)[
            : np.arange(0.0, DURATION_S + 1.0, quantum).size
        ]
    )
    arrived = d.true + d.delay
    d.delay = wake[np.searchsorted(wake, arrived)] - d.true + d.rng.gamma(2.0, 2e-5, d.true.size)


def load_episodes(d: Draft) -> None:
    for _ in range(int(d.rng.integers(1, 4))):
        begin, length = d.rng.uniform(5, 55), d.rng.uniform(4, 20)
        d.delay = np.where((d.true > begin) & (d.true < begin + length), 3.0 * d.delay, d.delay)


def host_stalls(d: Draft) -> None:
    arrived = d.true + d.delay
    for _ in range(int(d.rng.integers(1, 6))):
        begin, length = d.rng.uniform(2, 70), d.rng.uniform(0.05, 0.8)
        held = (arrived > begin) & (arrived < begin + length)
        arrived = np.where(held, begin + length, arrived)
    d.delay = np.maximum.accumulate(arrived) - d.true


def exact_epochs(d: Draft) -> None:
    n = d.true.size
    d.rate = 10.0
    d.start_ns = d.start_ns // 10**9 * 10**9
    d.true = np.arange(int(DURATION_S * 10)) * 0.1
    d.stamp = d.true.copy()
    d.delay = np.resize(d.delay, d.true.size) + d.rng.uniform(0.02, 0.08)
    assert n > 0


def triggered(d: Draft) -> None:
    n = d.true.size
    law = d.rng.choice(["exponential", "uniform", "walk"])
    if law == "exponential":
        intervals = 0.3 / d.rate + d.rng.exponential(0.7 / d.rate, n)
    elif law == "uniform":
        intervals = d.rng.uniform(0.5, 1.5, n) / d.rate
    else:
        intervals = (1.0 + 0.4 * np.sin(np.arange(n) / 50.0) + d.rng.normal(0, 0.05, n)) / d.rate
    d.true = np.cumsum(intervals)
    d.stamp = d.true.copy()


def wandering_sampling(d: Draft) -> None:
    d.true = d.true + d.rng.normal(0.0, 0.05 / d.rate, d.true.size)
    d.stamp = d.true.copy()


def breathing(d: Draft) -> None:
    """Latency that goes up and down, slowly."""
    period = d.rng.uniform(15.0, 80.0)
    size = float(10 ** d.rng.uniform(-2.5, -1.2))
    turn = 2 * np.pi * (d.true / period + d.rng.uniform())
    shape = np.sin(turn) if d.rng.uniform() < 0.6 else 2 / np.pi * np.arcsin(np.sin(turn))
    d.delay = d.delay + size * (1.0 + shape)


def wandering_transport(d: Draft) -> None:
    """Latency that walks, or climbs while a queue fills and falls when it is emptied."""
    n = d.true.size
    size = float(10 ** d.rng.uniform(-2.5, -1.2))
    if d.rng.uniform() < 0.5:
        walk = np.cumsum(d.rng.normal(0.0, 1.0, n)) / np.sqrt(n)
        d.delay = d.delay + size * 2.0 * (walk - walk.min())
    else:
        length = d.rng.uniform(10.0, 30.0)
        d.delay = d.delay + size * 2.0 * ((d.true / length + d.rng.uniform()) % 1.0)


def noted_out_of_order(d: Draft) -> None:
    d.disorder = float(d.rng.choice([0.0005, 0.01, 0.1]))


SOUND: dict[str, Callable[[Draft], None]] = {
    f.__name__: f for f in (plain, scheduling_batches, load_episodes, host_stalls, exact_epochs,
                            triggered, wandering_sampling, breathing, wandering_transport,
                            noted_out_of_order)
}  # fmt: skip


# ---- the corpus -----------------------------------------------------------------------------


def one_fault(
    rng: np.random.Generator, names: tuple[str, ...], label: str, law: str
) -> MadeRecording:
    rates = next((_RATE_OF[n] for n in names if n in _RATE_OF), None)
    d = draft(rng, None if rates is None else float(rng.choice(rates)), law)
    for name in names:
        FAULTS[name](d)
    return MadeRecording(label, (finish(d, label),))


def sound(rng: np.random.Generator, name: str, label: str, law: str) -> MadeRecording:
    d = draft(rng, None, law)
    SOUND[name](d)
    return MadeRecording(label, (finish(d, label, name),))


def several(rng: np.random.Generator, kind: str, label: str) -> MadeRecording:
    """Three streams of one recorder: its clock steps or drifts, or it writes in batches."""
    start = 1_600_000_000_000_000_000 + int(rng.integers(0, 10**17)) * 3
    made = []
    at = rng.uniform(20, 50)
    flush = rng.uniform(0.25, 1.0)
    size = float(rng.choice([-1, 1])) * rng.uniform(0.03, 1.7)
    for k, rate in enumerate(rng.choice([10.0, 23.0, 50.0, 100.0], size=3, replace=False)):
        d = draft(rng, float(rate))
        d.start_ns = start
        if kind == "batched_by_recorder":
            d.delay = np.ceil((d.true + d.delay) / flush) * flush - d.true + 1e-5 * k
            d.delay = d.delay + np.arange(d.true.size) * 1e-9
        one = finish(d, f"{label}_{k}", "" if kind == "recorder_clock" else kind)
        if kind == "recorder_clock":
            moved = one.receive_ns + np.where(
                one.receive_ns - start >= at * 1e9, int(size * 1e9), 0)  # fmt: skip
            one = replace(one, receive_ns=moved, planted=("recorder_clock",))
        made.append(one)
    return MadeRecording(label, tuple(made), (kind,))


def corpus(seed: int, each: int = 12, sound_each: int = 20) -> Iterator[MadeRecording]:
    """All recordings; each: of every fault."""
    root = np.random.SeedSequence(seed)
    for name in FAULTS:
        for k, s in enumerate(root.spawn(each)):
            rng = np.random.default_rng(s)
            yield one_fault(rng, (name,), f"{name}_{k}", LAWS[k % len(LAWS)])
    for pair in PAIRS:
        for k, s in enumerate(root.spawn(max(1, each // 3))):
            yield one_fault(np.random.default_rng(s), pair, f"{'_and_'.join(pair)}_{k}", "gamma")
    for kind in ("recorder_clock", "batched_by_recorder"):
        for k, s in enumerate(root.spawn(max(1, each // 2))):
            yield several(np.random.default_rng(s), kind, f"{kind}_{k}")
    for name in SOUND:
        for k, s in enumerate(root.spawn(sound_each)):
            rng = np.random.default_rng(s)
            yield sound(rng, name, f"sound_{name}_{k}", LAWS[k % len(LAWS)])
