"""SBET, a smoothed best estimate of trajectory, and its smrmsg of errors: plain doubles, no head.

A record of an SBET is 17 doubles, of a smrmsg 10 (Applanix; as public readers of the format, PDAL
and others, describe it).  The wander frame has x at the azimuth -wander, y to its left and z up, so
true heading = platform heading - wander, and

    v_north =  vx cos(wander) - vy sin(wander)
    v_east  = -vx sin(wander) - vy cos(wander)          [m/s]
    v_down  = -vz

which is what the positions of a real file do: their slope over a second agrees to 3 mm/s.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts
from syncline_design.logs.readers.epochs import WEEK_S, WEEK_SECONDS, nanoseconds_of
from syncline_design.logs.readers.reader import BY_SHAPE, NO, FileHead, Reader
from syncline_design.logs.readers.stream import Recording
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

SBET = (
    *("time", "latitude", "longitude", "height", "vx", "vy", "vz"),
    *("roll", "pitch", "heading", "wander", "ax", "ay", "az", "wx", "wy", "wz"),
)
SMRMSG = (
    *("time", "north", "east", "down", "v_north", "v_east", "v_down"),
    *("roll", "pitch", "heading"),
)
PIECE = 20_000  # records
LATEST_S = 2.0 * WEEK_S  # seconds may run on past the end of the week
LONGEST_S = 3600.0  # after which records behind damage count as of the same trajectory
LOOKED_AT = 64  # records at the beginning, by which a file is told
PI = np.pi
MOST = np.array(
    [LATEST_S, PI / 2, 2 * PI, 1e5, *[1e4] * 3, *[2.001 * PI] * 4, *[1e4] * 3, *[1e3] * 3]
)
MOST_ERROR = np.array([LATEST_S, *[1e5] * 3, *[1e4] * 3, *[1e5] * 3])


def possible(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which records can be any: the format has no checksum, damage shows as what cannot be."""
    most = MOST if rows.shape[1] == len(SBET) else MOST_ERROR
    good = np.all(np.isfinite(rows), axis=1) & np.all(np.abs(rows) <= most, axis=1)
    good &= (rows[:, 0] >= 0) & np.any(rows != 0, axis=1)
    if rows.shape[1] == len(SMRMSG):
        good &= np.all(rows[:, 1:] >= 0, axis=1)
    kept: NDArray[np.bool_] = good
    return kept


@dataclass(slots=True)
class _Damage:
    """Records that one pass left out, the first of them, and what is wrong behind the last.

    time_s: of the last good record; behind: whether the record before was left out.
    """

    count: int = 0
    first: int = 0
    first_time_s: float = 0.0
    time_s: float | None = None
    behind: bool = False
    cut: str = ""

    def kept(self, table: NDArray[np.float64], before: int) -> NDArray[np.float64]:
        """The good records of a table, `before` others in front of it.

        Behind damage a stretch counts only where its time goes on from that of the last good one:
        lost bytes shift what follows, which then is no record although its figures may be possible.
        """
        good = possible(table)
        if np.all(good) and not self.behind:
            self.time_s = float(table[-1, 0])
            return table
        edges = np.flatnonzero(np.diff(good)) + 1
        for rows in np.split(np.arange(table.shape[0]), edges):
            times = table[rows, 0]
            if good[rows[0]] and self.behind:
                good[rows[: self._astray(times)]] = False
            self.behind = not good[rows[-1]]
            if not self.behind:
                self.time_s = float(times[-1])
        if lost := int(np.count_nonzero(~good)):
            at = int(np.argmin(good))
            if not self.count:
                self.first, self.first_time_s = before + at + 1, float(table[at, 0])
            self.count += lost
        return table[good]

    def _astray(self, times: NDArray[np.float64]) -> int:
        """How many records come before one that follows the last good one, also in a new week."""
        if self.time_s is None:
            return times.size
        follows = (times - self.time_s) % WEEK_S < LONGEST_S
        return int(np.argmax(follows)) if np.any(follows) else times.size

    def said(self) -> str:
        """For people; empty where every record was read."""
        parts = []
        if self.count:
            time = f"(time {to_digits(self.first_time_s, 6)} s)"
            parts.append(
                f"record {self.first} cannot be one {time}"
                if self.count == 1
                else f"{self.count} records cannot be any, the first record {self.first} {time}"
            )
        return "; ".join([*parts, *([self.cut] if self.cut else [])])


class SbetRecording(BatchRecording):
    """An SBET or a smrmsg, some thousand records at a time."""

    def __init__(self, path: Path, width: int) -> None:
        super().__init__(path)
        self._width = width
        self.format = "SBET" if width == len(SBET) else "smrmsg of an SBET"
        self._past_week = 0
        self._wraps = 0

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        rows, last = 0, 0.0
        past = wraps = 0
        damage = _Damage()
        for table in self._tables(damage):
            count = table.shape[0]
            times = np.concatenate([[last if rows else table[0, 0]], table[:, 0]])
            wraps += int(np.count_nonzero(np.diff(times) < -WEEK_S / 2))
            past += int(np.count_nonzero(table[:, 0] >= WEEK_S))
            rows, last = rows + count, float(table[-1, 0])
            columns = _columns(table) if table.shape[1] == len(SBET) else _errors(table)
            yield Batch(self.path.stem, count, nanoseconds_of(table[:, 0]), None, columns)
        self._past_week, self._wraps = past, wraps
        if said := damage.said():
            self._cut(said, rows)

    def _tables(self, damage: _Damage) -> Iterator[NDArray[np.float64]]:
        """Whole and possible records; notes which are none."""
        size, before = 8 * self._width, 0
        with self.path.open("rb") as file:
            while raw := file.read(PIECE * size):
                whole = len(raw) // size * size
                table = np.frombuffer(raw[:whole], dtype="<f8").reshape(-1, self._width)
                kept = damage.kept(table, before) if table.shape[0] else table
                before += table.shape[0]
                if kept.shape[0]:
                    yield kept.astype(float)
                if whole < len(raw):
                    left = len(raw) - whole
                    damage.cut = f"{left} bytes at the end are no whole record of {size}"

    def _facts(self, name: str) -> StreamFacts:
        of_times: tuple[str, ...] = (
            "seconds of the GPS week: neither the week nor whether they are GPS or UTC is in the "
            "file; give log: {gps_week, timeline}",
        )
        if self._past_week:
            of_times += (f"{self._past_week} stamps run past the end of the week (604 800 s)",)
        if self._wraps:
            of_times += (f"seconds of the week begin again {self._wraps} times",)
        if self._width == len(SMRMSG):
            notes: tuple[str, ...] = ("errors of a trajectory [rms], attitude in minutes of arc",)
            return StreamFacts(primary=WEEK_SECONDS, of_times=of_times, notes=notes, kind="smrmsg")
        return StreamFacts(
            quantity=("position", "attitude", "velocity", "rate", "acceleration"),
            frame="wgs84",
            primary=WEEK_SECONDS,
            of_times=of_times,
            notes=(
                "yaw is platform heading minus wander; velocities (y to the left, z up) were "
                "turned from the wander frame to north, east, down",
            ),
            body="frd",
            kind="SBET",
            nature="fused",
        )


def _columns(table: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    f = {name: table[:, k] for k, name in enumerate(SBET)}
    c, s = np.cos(f["wander"]), np.sin(f["wander"])
    return {
        "latitude_deg": np.degrees(f["latitude"]),
        "longitude_deg": np.degrees(f["longitude"]),
        "height_m": f["height"],
        "velocity_north_mps": f["vx"] * c - f["vy"] * s,
        "velocity_east_mps": -f["vx"] * s - f["vy"] * c,
        "velocity_down_mps": -f["vz"],
        "roll_rad": f["roll"],
        "pitch_rad": f["pitch"],
        "yaw_rad": (f["heading"] - f["wander"]) % (2 * PI),
        "wander_rad": f["wander"],
        **{f"acceleration_{a}_mps2": f[f"a{a}"] for a in "xyz"},
        **{f"rate_{a}_radps": f[f"w{a}"] for a in "xyz"},
    }


def _errors(table: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    f = {name: table[:, k] for k, name in enumerate(SMRMSG)}
    return {
        **{f"sigma_{a}_m": f[a] for a in ("north", "east", "down")},
        **{f"sigma_velocity_{a}_mps": f[f"v_{a}"] for a in ("north", "east", "down")},
        **{f"sigma_{a}_deg": f[a] / 60 for a in ("roll", "pitch")},
        "sigma_yaw_deg": f["heading"] / 60,
    }


def _width(head: FileHead) -> int:
    """Doubles of a record, 0 where the file is neither; told by the first records alone."""
    for names in (SBET, SMRMSG):
        width = len(names)
        records = min(len(head.start) // (8 * width), LOOKED_AT)
        if not records:
            continue
        table = np.frombuffer(head.start[: records * 8 * width], dtype="<f8").reshape(-1, width)
        good = possible(table)
        end = records if np.all(good) else int(np.argmin(good))
        times = table[:end, 0]
        steps = np.diff(times)
        # tiny doubles are bytes of something else read as figures
        real = bool(np.all((table[:end] == 0) | (np.abs(table[:end]) > 1e-25)))
        real = real and bool(np.any(times > 1) and np.all(np.any(table[:end, 1:] != 0, axis=1)))
        rising = end < 2 or bool(np.mean(steps > 0) > 0.9 and np.median(steps) < 3600)
        if end and real and rising and (end == records or end > 2):
            return width
    return 0


def _recognises(head: FileHead) -> int:
    return BY_SHAPE if not head.folder and _width(head) else NO


def _open(path: Path) -> Recording:
    with path.open("rb") as file:
        head = FileHead(path, file.read(1 << 16), path.stat().st_size)
    width = _width(head)
    if not width:
        raise refuse(path, "no SBET", expected="records of 17 doubles with possible figures")
    return SbetRecording(path, width)


READER = Reader("SBET", _recognises, _open)
