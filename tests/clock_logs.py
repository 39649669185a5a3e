"""Logs of clocks whose truth is known: written line by line as the daemons do."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
START = 1_800_000_000.0  # 2027-01-15T08:00:00Z
BANNER = "=" * 131


def _date(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%d %H:%M:%S")


def tracking_line(
    time_s: float, late_s: float, *, hard_s: float = 0.0, leap: str = "N", skew_ppm: float = 0.05,
    reference: str = "192.0.2.1", delay_s: float = 4e-4, dispersion_s: float = 1e-4,
) -> str:  # fmt: skip
    """A clock that is `late_s` late has a local minus reference of -late_s."""
    return (
        f"{_date(time_s)} {reference:<15} 2 -3.114 {skew_ppm:11.3f} {-late_s: .3e} {leap} 1 "
        f"1.000e-06 -1.000e-07 {delay_s:.3e} {dispersion_s:.3e} {hard_s:.3e}"
    )


def tracking(times: Iterable[float], late: Iterable[float], hard_s: float = 0.0) -> list[str]:
    lines = [BANNER, "   Date (UTC) Time     IP Address   St   Freq ppm", BANNER]
    return lines + [tracking_line(t, x, hard_s=hard_s) for t, x in zip(times, late, strict=True)]


def statistics_line(time_s: float, late_s: float) -> str:
    return (f"{_date(time_s)} 192.0.2.1        1.617e-06 {-late_s: .3e}  1.768e-06 -4.025e-06  "
            "4.885e-07 2.0e-03   3   0   3  0.00")  # fmt: skip


def measurements_line(time_s: float, late_s: float, *, tests: str = "111") -> str:
    return (f"{_date(time_s)} 192.0.2.1       N  2 {tests} 111 1111   6  6 0.00 {late_s: .3e}  "
            "4.000e-04  1.000e-05  6.000e-04  2.000e-05 7F7F0101 4B K K")  # fmt: skip


def refclock_lines(time_s: float, late_s: float, name: str = "PPS2") -> list[str]:
    date = _date(time_s)
    return [f"{date}.000000 {name:<5} 7 N 1  1.000e-07 {late_s: .6e}  1.000e-06",
            f"{date}.000000 {name:<5} - N -       -    {late_s: .6e}  1.000e-06"]  # fmt: skip


def _mjd(time_s: float) -> str:
    day, second = divmod(time_s, 86400.0)
    return f"{int(day) + 40587} {second:.3f}"


def loopstats_line(time_s: float, late_s: float) -> str:
    return f"{_mjd(time_s)} {late_s:.9f} 12.345 0.000001000 0.002000 6"


def peerstats_line(time_s: float, late_s: float, status: str = "961a") -> str:
    return f"{_mjd(time_s)} 192.0.2.1 {status} {late_s:.9f} 0.000400000 0.000100000 0.000001000"


def ptp4l_line(time_s: float, late_s: float, state: int = 2, delay_ns: int = 1500) -> str:
    return (f"ptp4l[{time_s:.3f}]: master offset {round(-1e9 * late_s):10d} s{state} "
            f"freq {-300:+7d} path delay {delay_ns:9d}")  # fmt: skip


def phc2sys_line(time_s: float, late_s: float) -> str:
    return (f"phc2sys[{time_s:.3f}]: CLOCK_REALTIME phc offset {round(-1e9 * late_s):9d} s2 "
            "freq   +2748 delay    500")  # fmt: skip


def ts2phc_line(time_s: float, late_s: float) -> str:
    return f"ts2phc[{time_s:.3f}]: /dev/ptp0 offset {round(-1e9 * late_s):10d} s2 freq      +0"


def gpsd_line(time_s: float, late_s: float, kind: str = "PPS") -> str:
    clock_ns = int(time_s) * 10**9 - round(late_s * 1e9)
    return (f'{{"class":"{kind}","device":"/dev/ttyS0","real_sec":{int(time_s)},"real_nsec":0,'
            f'"clock_sec":{clock_ns // 10**9},"clock_nsec":{clock_ns % 10**9},"precision":-20}}'
            )  # fmt: skip


def ppstest_line(time_s: float, late_s: float) -> str:
    clock_ns = int(time_s) * 10**9 - round(late_s * 1e9)
    return (f"source 0 - assert {clock_ns // 10**9}.{clock_ns % 10**9:09d}, "
            f"sequence: {int(time_s) % 10**6 + 1} - clear  0.000000000, sequence: 0")  # fmt: skip


def csv_lines(times: Iterable[float], late: Iterable[float]) -> list[str]:
    rows = [f"{t:.3f},{-1e6 * x:.6f}" for t, x in zip(times, late, strict=True)]
    return ["time_s,offset_us", *rows]


def write(path: Path, lines: Sequence[str]) -> Path:
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def sessions_csv(
    folder: Path,
    levels_s: Sequence[float],
    *,
    count: int = 200,
    step_s: float = 10.0,
    seed: int = 0,
) -> list[Path]:
    """One table a session: normal offsets with the given standard deviations."""
    source = np.random.default_rng(seed)
    paths = []
    for k, level in enumerate(levels_s):
        times = START + 86400.0 * k + step_s * np.arange(count)
        late = source.normal(0.0, level, count)
        paths.append(write(folder / f"run{k:03d}.csv", csv_lines(times, late)))
    return paths
