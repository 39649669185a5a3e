"""A second corpus for `audit`, made by other choices than `audit_corpus`; for final figures only.

Other rates, lengths, resolutions of both stamps, laws of delay, and other shapes of the same
faults: a lock that is lost drifts away and is slewed back, packets end by their size as well as by
their timer, duplicates are whole messages sent twice, stamps go back because neighbours change
places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.audit_corpus import Made, MadeRecording

RATES = (8.0, 20.0, 30.0, 62.5, 125.0, 250.0)
Array = np.ndarray
UNIX = 1_700_000_000


class Bench:
    """True times, stamps and receipts of one stream as arrays of float seconds, origin apart."""

    def __init__(self, rng: np.random.Generator, rate: float | None = None) -> None:
        self.rng = rng
        self.rate = float(rng.choice(RATES)) if rate is None else rate
        self.length = float(rng.choice([60.0, 75.0, 120.0]))
        n = int(self.length * self.rate)
        self.measured = np.arange(n) / self.rate * (1 + rng.uniform(-5e-5, 5e-5)) + rng.uniform(
            0, 3
        )
        self.scale = min(0.1 / self.rate, 10 ** rng.uniform(-3.9, -2.2))
        shape = rng.uniform(1.5, 4.0)
        self.late = rng.gamma(shape, self.scale, n) + rng.uniform(0.0, 4.0) * self.scale
        if rng.uniform() < 0.15:  # rare long waits
            self.late += np.where(rng.uniform(size=n) < 0.01, rng.exponential(8 * self.scale, n), 0)
        self.stamp = self.measured.copy()
        self.epoch = UNIX + int(rng.integers(0, 60_000_000))
        self.order: Array | None = None
        self.left_out: Array | None = None
        self.excused: Array | None = None
        self.as_whole: Callable[[Array], Array] = lambda s: s
        self.bound = True
        self.sizes: dict[str, float] = {}
        self.resolution_ns = int(rng.choice([1, 1, 1000]))

    def made(self, name: str, planted: tuple[str, ...], sound_as: str = "") -> Made:
        arrived = np.maximum.accumulate(self.measured + self.late)
        origin = self.epoch * 10**9
        stamps = self.as_whole(origin + np.rint(self.stamp * 1e9).astype(np.int64))
        receive = origin + np.rint(arrived * 1e9).astype(np.int64)
        stamps = stamps // self.resolution_ns * self.resolution_ns
        waits = arrived - self.measured
        counted = np.ones(waits.size, bool)
        if self.excused is not None:
            counted &= ~self.excused
        if self.left_out is not None:
            counted &= ~self.left_out
        bound = float(np.ptp(waits[counted])) if self.bound else None
        if self.order is not None:
            stamps = stamps[self.order]
        if self.left_out is not None:
            stamps, receive = stamps[~self.left_out], receive[~self.left_out]
        return Made(name, stamps, receive, planted, self.sizes, bound, sound_as)

    def at(self, low: float, high: float) -> float:
        return float(self.measured[0] + self.length * self.rng.uniform(low, high))


def epoch_offset(b: Bench) -> None:
    seconds = b.rng.choice(
        [37.0, -37.0, 18.0, -18.0, 19.0, 7200.0, -25200.0, 34200.0, 0.0, 1e-3, 1e3]
    )
    if seconds == 0.0:
        start = b.epoch * 10**9 - int(b.rng.integers(1, 4000) * 10**9)
        b.as_whole = lambda s: s - start
    elif seconds == 1e-3:
        b.as_whole = lambda s: s // 1000
        b.bound = b.resolution_ns == 1
    elif seconds == 1e3:
        start = b.epoch * 10**9 - 20 * 10**9
        b.as_whole = lambda s: (s - start) * 1000
    else:
        b.stamp = b.stamp + seconds


def whole_second_slip(b: Bench) -> None:
    begin = b.at(0.2, 0.6)
    end = begin + b.length * (b.rng.uniform(0.1, 0.3) if b.rng.uniform() < 0.7 else 1.0)
    sign = b.rng.choice([-1.0, 1.0])
    b.stamp = np.where((b.measured > begin) & (b.measured <= end), b.stamp + sign, b.stamp)
    b.sizes["seconds"] = sign


def step(b: Bench) -> None:
    smallest = 1.5 if b.rate <= 10 else 1.0 if b.rate <= 30 else 0.75
    size = 1.6 * b.scale * smallest * 10 ** b.rng.uniform(0.1, 1.3) * b.rng.choice([-1.0, 1.0])
    begin = b.at(0.25, 0.75)
    b.stamp = np.where(b.measured > begin, b.stamp + size, b.stamp)
    b.sizes["seconds"] = size


def drift(b: Bench) -> None:
    ppm = b.rng.choice([-1, 1]) * b.scale * 10 ** b.rng.uniform(0.7, 2.0) / b.length * 1e6
    b.stamp = b.stamp + (b.measured - b.measured[0]) * ppm * 1e-6
    b.sizes["ppm"] = float(ppm)


def counter_wrap(b: Bench) -> None:
    wrap = int(
        b.rng.choice([3600 * 10**9, 86400 * 10**9, 2**32 * 1000, 65_536_000_000, 604800 * 10**9])
    )
    at = b.epoch * 10**9 + int(b.at(0.2, 0.8) * 1e9)
    b.as_whole = lambda s: (s - at) % wrap
    b.sizes["wrap_s"] = wrap / 1e9


def relock(b: Bench) -> None:
    lost, found = b.at(0.2, 0.3), b.at(0.45, 0.55)
    size = b.scale * 10 ** b.rng.uniform(1.2, 2.2) * b.rng.choice([-1.0, 1.0])
    settle = b.length * b.rng.uniform(0.02, 0.08)
    away = np.clip((b.measured - lost) / (found - lost), 0.0, 1.0)
    back = np.exp(-np.maximum(b.measured - found, 0.0) / settle)
    if b.rng.uniform() < 0.5:
        away = np.where(b.measured < found, 0.0, 1.0)
    b.stamp = b.stamp + size * away * back
    b.sizes["settling_s"] = settle


def packetised(b: Bench) -> None:
    """A serial chip's timer of 16 ms, or 62 bytes, whichever comes first; stamped by the host."""
    arrival = np.empty_like(b.measured)
    per_packet = int(b.rng.choice([1000, 1000, 3]))
    timer, k, n = 0.016, 0, b.measured.size
    phase = b.rng.uniform(0, timer)
    while k < n:
        flush = phase + np.ceil((b.measured[k] - phase) / timer) * timer
        j = k
        while j < n and b.measured[j] <= flush and j - k < per_packet:
            j += 1
        when = flush if j - k < per_packet else b.measured[j - 1]
        arrival[k:j] = when + b.rng.uniform(50e-6, 200e-6)
        k = max(j, k + 1)
    arrival = np.maximum.accumulate(arrival) + np.arange(n) * 2e-9
    b.stamp = arrival
    b.late = arrival - b.measured + b.rng.gamma(2.0, 5e-5, n)
    b.bound = False


def truncated_stamps(b: Bench) -> None:
    grain = int(b.rng.choice([1_000_000, 10_000_000, 15_625_000]))
    b.as_whole = lambda s: s // grain * grain
    b.sizes["resolution_s"] = grain / 1e9
    b.bound = False


def stamped_on_arrival(b: Bench) -> None:
    b.stamp = np.maximum.accumulate(b.measured + b.late)
    b.late = b.stamp - b.measured + b.rng.uniform(2e-6, 2e-5, b.stamp.size)
    b.bound = False


def duplicates(b: Bench) -> None:
    """A message sent twice: a copy a moment later."""
    n = b.measured.size
    twice = np.zeros(n, int)
    twice[b.rng.choice(np.arange(3, n - 3), int(b.rng.integers(1, 12)), replace=False)] = 1
    copies = np.repeat(np.arange(n), 1 + twice)
    again = np.concatenate([[False], copies[1:] == copies[:-1]])
    b.measured, b.stamp, late = b.measured[copies], b.stamp[copies], b.late[copies]
    b.late = late + np.where(again, b.rng.exponential(0.1 / b.rate, copies.size), 0.0)
    b.excused = again


def backward_jump(b: Bench) -> None:
    """Neighbours that change places."""
    n = b.measured.size
    order = np.arange(n)
    b.excused = np.zeros(n, bool)
    for k in np.sort(b.rng.choice(np.arange(4, n - 4), int(b.rng.integers(1, 6)), replace=False)):
        order[[k, k + 1]] = order[[k + 1, k]]
        b.excused[[k, k + 1]] = True
    b.order = order


def gap(b: Bench) -> None:
    begin = b.at(0.2, 0.7)
    b.left_out = (b.measured > begin) & (b.measured < begin + b.rng.uniform(1.5, 10.0))


def lost_messages(b: Bench) -> None:
    b.left_out = b.rng.uniform(size=b.measured.size) < b.rng.choice([0.01, 0.03, 0.06])
    b.left_out[[0, 1, 2, -1]] = False
    b.left_out[b.measured.size // 3] = True


def unset_stamps(b: Bench) -> None:
    count = int(b.rng.choice([3, 20]))
    first = b.rng.uniform() < 0.5
    n = b.measured.size
    places = np.arange(count) if first else b.rng.choice(n, count, replace=False)
    b.as_whole = lambda s: np.where(np.isin(np.arange(n), places), 0, s)
    b.excused = np.isin(np.arange(n), places)


def ahead_of_receipt(b: Bench) -> None:
    b.stamp = b.stamp + float(b.late.max()) + b.rng.uniform(0.003, 0.3)


def steady(b: Bench) -> None:
    pass


def batches(b: Bench) -> None:
    quantum = b.rng.choice([0.003, 0.008, 0.0125, 0.025])
    arrived = b.measured + b.late
    ticks = np.cumsum(quantum * b.rng.uniform(0.8, 1.2, int((b.length + 10) / quantum / 0.8)))
    b.late = ticks[np.searchsorted(ticks, arrived)] - b.measured


def busy(b: Bench) -> None:
    begin = b.at(0.1, 0.7)
    inside = (b.measured > begin) & (b.measured < begin + b.length * b.rng.uniform(0.05, 0.25))
    b.late = np.where(inside, b.late * 3.0, b.late)


def stalls(b: Bench) -> None:
    arrived = b.measured + b.late
    for _ in range(int(b.rng.integers(1, 4))):
        begin = b.at(0.0, 0.9)
        end = begin + b.rng.uniform(0.1, 1.5)
        arrived = np.where((arrived > begin) & (arrived < end), end, arrived)
    b.late = arrived - b.measured


def epochs(b: Bench) -> None:
    n = int(b.length * 10)
    b.measured = np.arange(n) * 0.1 + 1.0
    b.stamp = b.measured.copy()
    b.late = np.resize(b.late, n) + b.rng.uniform(0.0, 0.12)


def on_demand(b: Bench) -> None:
    n = b.measured.size
    b.measured = 1.0 + np.cumsum(b.rng.gamma(b.rng.choice([1.0, 3.0, 30.0]), 1.0, n))
    b.measured = b.measured / b.measured[-1] * b.length
    b.stamp = b.measured.copy()
    b.late = np.resize(b.late, n)


def camera(b: Bench) -> None:
    b.measured = b.measured + b.rng.uniform(0.0, 0.02 / b.rate, b.measured.size)
    b.stamp = b.measured.copy()


FAULTS = (epoch_offset, whole_second_slip, step, drift, counter_wrap, relock, packetised,
          truncated_stamps, stamped_on_arrival, duplicates, backward_jump, gap, lost_messages,
          unset_stamps, ahead_of_receipt)  # fmt: skip
SOUND = (steady, batches, busy, stalls, epochs, on_demand, camera)
PAIRS = ((epoch_offset, gap), (drift, whole_second_slip), (epoch_offset, relock), (duplicates, gap),
         (step, lost_messages), (drift, backward_jump), (whole_second_slip, duplicates),
         (unset_stamps, drift))  # fmt: skip
ODD_RATES = {packetised: (20.0, 62.0, 125.0, 250.0, 330.0), truncated_stamps: (12.0, 31.0, 97.0)}


def corpus(seed: int, each: int = 10, sound_each: int = 15) -> Iterator[MadeRecording]:
    root = np.random.SeedSequence([seed, 77])
    kinds = [(f,) for f in FAULTS] + list(PAIRS)
    for planted in kinds:
        for k, s in enumerate(root.spawn(each if len(planted) == 1 else max(1, each // 2))):
            rng = np.random.default_rng(s)
            rates = ODD_RATES.get(planted[0])
            b = Bench(rng, None if rates is None else float(rng.choice(rates)))
            for fault in planted:
                fault(b)
            names = tuple(f.__name__ for f in planted)
            label = f"{'_and_'.join(names)}_{k}"
            yield MadeRecording(label, (b.made(label, names),))
    for odd in SOUND:
        for k, s in enumerate(root.spawn(sound_each)):
            b = Bench(np.random.default_rng(s))
            odd(b)
            label = f"sound_{odd.__name__}_{k}"
            yield MadeRecording(label, (b.made(label, (), odd.__name__),))
