"""RTKLIB's solutions (.pos, .LLH): one epoch a line, what its columns are in the header.

Layout by RTKLIB's manual (version 2.4.2, appendix B.1): the time as a date or as GPS week and
seconds, in GPST, UTC or JST; the place as latitude, longitude and height, as earth-centred
coordinates or as a baseline; quality, satellites, standard deviations, age, ratio, and perhaps the
velocity.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts
from syncline_design.logs.readers.decimal_stamps import nanoseconds
from syncline_design.logs.readers.epochs import DAY_NS, NANO, UNIX_DAY, WEEK_NS, held, week_start_ns
from syncline_design.logs.readers.reader import BY_MAGIC, BY_SHAPE, NO, FileHead, Reader
from syncline_design.logs.readers.stream import Frame, Recording, Timeline
from syncline_design.logs.readers.text_lines import (
    BadLineError,
    Damage,
    Line,
    demand_text,
    head_lines,
    line_blocks,
    usual_width,
)
from syncline_design.machine.quick_dataclass import dataclass

DATE = re.compile(r"^(\d{4})/(\d\d?)/(\d\d?)$")
CLOCK = re.compile(r"^(\d\d?):(\d\d):(\d\d)(\.\d*)?$")
SYSTEM = re.compile(r"\b(GPST|UTC|JST)\b")
JST_NS = 9 * 3600 * NANO
LEAST_FIELDS = 7  # time (2), place (3), quality, satellites
# columns behind the place, in RTKLIB's order
BEHIND = (
    *("quality", "satellites", "sigma_north_m", "sigma_east_m", "sigma_up_m"),
    *("covariance_root_ne_m", "covariance_root_eu_m", "covariance_root_un_m", "age_s", "ratio"),
    *("velocity_north_mps", "velocity_east_mps", "velocity_up_mps"),
)
TITLES = re.compile(r"latitude|x-ecef|e-baseline")
Epoch = tuple[int, list[float], list[float]]  # time [ns], place, the rest


@dataclass(frozen=True, slots=True)
class PosHeader:
    """What the lines that begin with % say."""

    system: str = ""  # GPST, UTC, JST or nothing said
    place: str = "llh"  # llh, dms, xyz or enu
    sea_level: bool = False
    velocity: bool = False
    reference: str = ""
    fields: int = 0  # in a line below it; 0 where it names none


def header_of(lines: Sequence[str]) -> PosHeader:
    """Of the comment lines at the top."""
    comments = [line for line in lines if line.startswith("%")]
    title = next((line for line in reversed(comments) if TITLES.search(line)), "")
    said = SYSTEM.search(title)
    whole = "\n".join(comments)
    reference = re.search(r"ref pos\s*:\s*(.*)", whole)
    place = "llh"
    if "x-ecef" in title:
        place = "xyz"
    elif "e-baseline" in title:
        place = "enu"
    elif "latitude(d'" in title:
        place = "dms"
    return PosHeader(
        said[1] if said else "",
        place,
        "/geodetic" in whole,
        "vn(m/s)" in title,
        reference[1].strip() if reference else "",
        _fields_named(title, place),
    )


def _fields_named(title: str, place: str) -> int:
    """Fields of an epoch by the line of names: its time has two, an angle in minutes three."""
    names = fields_of(title.lstrip("% "))
    return len(names) + 1 + 4 * (place == "dms") if len(names) >= LEAST_FIELDS - 1 else 0


def fields_of(text: str) -> list[str]:
    """The fields of a line, separated by blanks, commas or semicolons."""
    return text.replace(",", " ").replace(";", " ").split()


class PosRecording(BatchRecording):
    """One solution file, line by line."""

    format = "RTKLIB solution"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            head = head_lines(file.read(1 << 16))
        self._header = header_of(head)
        self._name = path.stem
        self._fields = usual_width(self._widths(head), self._header.fields)

    def _widths(self, head: Sequence[str]) -> list[int]:
        """How many fields each of the first epochs has."""
        widths = []
        for line in head:
            fields = fields_of(line)
            if not line.startswith("%") and self._is_epoch(fields):
                widths.append(len(fields))
        return widths

    def _is_epoch(self, fields: Sequence[str]) -> bool:
        try:
            self._epoch(fields)
        except BadLineError:
            return False
        return True

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        rows, damage = 0, Damage()
        for block in line_blocks(self.path):
            read = list(self._epochs(block, damage))
            if read:
                rows += len(read)
                columns = self._columns(np.array([r[1] for r in read]), [r[2] for r in read])
                stamps = np.array([r[0] for r in read], np.int64)
                yield Batch(self._name, len(read), stamps, None, columns)
        if not rows:
            raise damage.refusal(self.path, "no epoch in the solution", "lines below the header")
        if damage.said():
            self._cut(damage.said(), rows)

    def _epochs(self, block: Sequence[Line], damage: Damage) -> Iterator[Epoch]:
        """Those of a block; what is none goes to the damage."""
        for line in block:
            if line.text.startswith("%"):
                continue
            fields = fields_of(line.text)
            if not line.whole and len(fields) < (self._fields or self._header.fields):
                damage.cut = line.text
                continue
            try:
                demand_text(line)
                self._demand_width(fields)
                yield self._epoch(fields)
            except BadLineError as error:
                damage.add(line, error)

    def _demand_width(self, fields: Sequence[str]) -> None:
        """As many fields as most epochs have; where none was seen yet, as the first has."""
        if self._fields and len(fields) != self._fields:
            message = f"an epoch of {len(fields)} fields among those of {self._fields}"
            raise BadLineError(message, f"{self._fields} fields in every line")
        if not self._fields and self._is_epoch(fields):
            self._fields = len(fields)

    def _epoch(self, fields: Sequence[str]) -> Epoch:
        """Time, place and the rest of a line; BadLineError where it is none."""
        size = 7 if self._header.place == "dms" else 3
        try:
            if len(fields) < LEAST_FIELDS + size - 3:
                raise ValueError
            stamp = self._stamp(fields[0], fields[1])
            place = [float(cell) for cell in fields[2 : 2 + size]]
            rest = [float(cell) for cell in fields[2 + size : 2 + size + len(BEHIND)]]
        except ValueError:
            expected = (
                "time, place, quality, satellites, as in 2026/03/01 12:00:00.000 47.1 8.5 ..."
            )
            raise BadLineError("no epoch of a solution", expected) from None
        if size == 7:
            place = _from_dms(fields[2:9])
        if not self._possible(place):
            raise BadLineError("no place on earth", "latitude, longitude, height")
        return stamp, place, rest

    def _stamp(self, day: str, clock: str) -> int:
        """A date and a time of day, or GPS week and seconds of it [ns]."""
        found, time = DATE.match(day), CLOCK.match(clock)
        if found is None or time is None:
            if not day.isdecimal() or len(day) > 4:
                raise ValueError
            tow = nanoseconds(clock)
            if not 0 <= tow <= 2 * WEEK_NS:
                raise ValueError
            return week_start_ns(int(day)) + tow
        days = date(int(found[1]), int(found[2]), int(found[3])).toordinal() - UNIX_DAY
        seconds = int(time[1]) * 3600 + int(time[2]) * 60 + int(time[3])
        rest = nanoseconds("0" + (time[4] or ".0"))
        shift = JST_NS if self._header.system == "JST" else 0
        return held(days * DAY_NS + seconds * NANO + rest - shift)

    def _possible(self, place: Sequence[float]) -> bool:
        if not all(np.isfinite(place)) or max(abs(x) for x in place) > 1e8:
            return False
        by_angles = self._header.place in ("llh", "dms")
        return not by_angles or (abs(place[0]) <= 90 and abs(place[1]) <= 360)

    def _columns(self, place: NDArray[Any], others: list[list[float]]) -> dict[str, NDArray[Any]]:
        columns: dict[str, NDArray[Any]] = {}
        if self._header.place == "enu":
            columns = {f"position_{a}_m": place[:, k] for k, a in enumerate("xyz")}
        else:
            if self._header.place == "xyz":
                from pymap3d import ecef2geodetic

                place = np.stack(ecef2geodetic(*place.T), axis=1)
            height = "height_msl_m" if self._header.sea_level else "height_m"
            names = ("latitude_deg", "longitude_deg", height)
            columns = {name: place[:, k] for k, name in enumerate(names)}
        width = min(len(row) for row in others)
        rest = np.array([row[:width] for row in others], dtype=float)
        known = len(BEHIND) if self._header.velocity else len(BEHIND) - 3
        for k, name in enumerate(BEHIND[: min(width, known)]):
            columns[name] = rest[:, k]
        up = columns.pop("velocity_up_mps", None)
        if up is not None:
            columns["velocity_down_mps"] = -up
        return columns

    def _facts(self, name: str) -> StreamFacts:
        header = self._header
        notes = []
        timeline: Timeline = "utc" if header.system in ("UTC", "JST") else "gps"
        if not header.system:
            notes.append("the file names no time system: RTKLIB's default, GPST, was taken")
        if header.system == "JST":
            notes.append("JST was read as UTC + 9 h")
        if header.place == "xyz":
            notes.append("earth-centred coordinates were made geodetic (WGS 84)")
        if header.sea_level:
            notes.append("heights are above the geoid (geodetic in the header)")
        if header.place == "enu":
            base = header.reference or "which the file does not give"
            notes.append(f"east, north, up from the reference station: {base}")
        if header.velocity:
            notes.append("velocity up was turned to down")
        frame: Frame = "enu" if header.place == "enu" else "wgs84"
        return StreamFacts(
            quantity=("position", "velocity") if header.velocity else ("position",),
            frame=frame,
            timeline=timeline,
            primary=header.system or "time",
            notes=tuple(notes),
            kind="RTKLIB " + header.place,
            nature="measured",
        )


def _from_dms(fields: Sequence[str]) -> list[float]:
    """`-8 32 44.1358` as degrees; the sign of -0 counts."""
    found = []
    for k in (0, 3):
        degrees, minutes, seconds = (float(cell) for cell in fields[k : k + 3])
        size = abs(degrees) + minutes / 60 + seconds / 3600
        found.append(-size if fields[k].startswith("-") else size)
    return [*found, float(fields[6])]


def _recognises(head: FileHead) -> int:
    lines = head_lines(head.start)
    if not lines:
        return NO
    if any(line.startswith("%") and TITLES.search(line) for line in lines):
        return BY_MAGIC
    rows = [line for line in lines if not line.startswith("%")]
    return BY_SHAPE if 2 * sum(map(_is_like_an_epoch, rows)) > len(rows) else NO


def _is_like_an_epoch(line: str) -> bool:
    fields = line.replace(",", " ").split()
    if len(fields) < LEAST_FIELDS or not fields[5].isdecimal() or not fields[6].isdecimal():
        return False
    dated = DATE.match(fields[0]) is not None and CLOCK.match(fields[1]) is not None
    weekly = fields[0].isdecimal() and len(fields[0]) <= 4 and len(fields) >= 13
    return dated or (weekly and all("." in cell for cell in fields[1:5]))


def _open(path: Path) -> Recording:
    return PosRecording(path)


READER = Reader(PosRecording.format, _recognises, _open)
