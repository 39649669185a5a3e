"""What the bound of stamps taken at the ticks of a timer can be at all, and what `audit` gives.

    python -m benchmarks.audit_ticks

A sensor measures evenly, a timer hands its messages over at its ticks, and a host that is late by
an interrupt stamps them.  The oracle knows that family and that crystals keep to 50 ppm, but not
the tick: of all ticks on whose comb the stamps lie and all intervals that they allow it takes the
largest spread of waits, as a bound must.  Prints one row a log, and last how many are within 10 %.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.run import audit

Array = NDArray[np.float64]
RATES = (200.0, 100.0, 62.5, 40.0, 25.0, 20.0)
TICKS_S = (4e-3, 2e-3, 1e-3)
POSSIBLE_S = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3)
PPM = (-45.0, -20.0, -5.0, 12.0, 35.0)
CRYSTALS = 5e-5
COMB_S = 3.5e-4  # interrupts that come later are rare
START_NS = 1_700_000_000 * 10**9
SECONDS, MOST = 60.0, 4000
NEAR = 0.1


def world(rate: float, tick_s: float, ppm: float) -> tuple[Array, Array, Array]:
    """When the sensor measured, the host stamped and the recorder received [s]."""
    rng = np.random.default_rng([int(rate * 10), int(tick_s * 1e3), int(ppm + 100)])
    count = int(min(SECONDS * rate, MOST))
    t = rng.uniform(0, 1) + np.arange(count) / rate * (1 + ppm * 1e-6)
    phase = rng.uniform(0, tick_s)
    ticked = np.ceil((t - phase) / tick_s) * tick_s + phase
    stamp = np.maximum.accumulate(ticked + 5e-6 + rng.exponential(2e-5, count))
    return t, stamp, np.maximum.accumulate(stamp + 2e-5 + rng.exponential(5e-5, count))


def oracle_s(stamp: Array, receive: Array, rate: float) -> float:
    """The largest spread of receipt minus measurement that the stamps allow [s]."""
    transport = float(np.ptp(receive - stamp))
    when, k = stamp - stamp[0], np.arange(stamp.size)
    best = 0.0
    for tick in POSSIBLE_S:
        number = np.concatenate([[0.0], np.cumsum(np.round(np.diff(when) / tick))])
        if float(np.max(np.abs(when - number * tick))) > COMB_S:
            continue
        intervals = (1 + np.linspace(-CRYSTALS, CRYSTALS, 2001)) / rate
        waits = np.array([float(np.ptp(number * tick - k * one)) for one in intervals])
        allowed = waits[waits < tick + 1e-9]
        best = max(best, float(allowed.max()) if allowed.size else 0.0)
    return best + transport


def audited_s(path: Path, stamp: Array, receive: Array) -> float:
    """The bound that `audit` gives [s]."""
    rows = [f"{START_NS + round(a * 1e9)},{START_NS + round(b * 1e9)}\n"
            for a, b in zip(stamp.tolist(), receive.tolist(), strict=True)]  # fmt: skip
    path.write_text("stamp_ns,receive_ns\n" + "".join(rows), "utf-8")
    bound = audit([path]).streams[0].residual_s.bound
    return float("nan") if bound is None else bound


def ratios() -> Iterator[tuple[float, float]]:
    """The oracle's bound and the audit's, over the true one."""
    with tempfile.TemporaryDirectory() as folder:
        for rate in RATES:
            for tick in TICKS_S:
                for ppm in PPM:
                    t, stamp, receive = world(rate, tick, ppm)
                    true = float(np.ptp(receive - t))
                    best = oracle_s(stamp, receive, rate)
                    ours = audited_s(Path(folder) / "s.csv", stamp, receive)
                    print(f"{rate} Hz, {1e3 * tick:.0f} ms, {ppm:+.0f} ppm: true "
                          f"{1e3 * true:.3f} ms, oracle {1e3 * best:.3f} ms, audit "
                          f"{1e3 * ours:.3f} ms", flush=True)  # fmt: skip
                    yield best / true, ours / true


def main() -> None:
    found = np.array(list(ratios()))
    oracle, ours = found[:, 0], found[:, 1]
    attainable, above = oracle <= 1 + NEAR, ours > 1 + NEAR
    print(f"{found.shape[0]} logs: oracle within 10 % in {attainable.sum()}; audit above in "
          f"{above.sum()}, {(above & attainable).sum()} of them where the oracle is not, and below "
          f"in {(ours < 1 - NEAR).sum()}")  # fmt: skip


if __name__ == "__main__":
    main()
