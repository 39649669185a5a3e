"""What gpsd reports, one JSON object a line: TPV, ATT and SKY, beside lines of another kind.

Fields by gpsd's public description (gpsd_json): time in UTC, degrees, metres, metres a second;
track from true north; altHAE above the ellipsoid, altMSL above sea level.  A plain log of the
reports holds no time of arrival.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts
from syncline_design.logs.readers.decimal_stamps import calendar_ns
from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader
from syncline_design.logs.readers.stream import UNSET, Recording
from syncline_design.logs.readers.text_lines import (
    BadLineError,
    Damage,
    Line,
    demand_text,
    head_lines,
    line_blocks,
)
from syncline_design.machine.quick_dataclass import dataclass

SURER = BY_MAGIC + 1  # than of the NMEA that gpsd puts between its reports
BEGINNING = '{"class":"'
NAN = math.nan
# report -> its field to the contract's name
FIELDS: dict[str, dict[str, str]] = {
    "TPV": {
        **{"lat": "latitude_deg", "lon": "longitude_deg", "altHAE": "height_m"},
        **{"altMSL": "height_msl_m", "geoidSep": "separation_m", "mode": "mode"},
    },
    "ATT": {"heading": "yaw_deg", "pitch": "pitch_deg", "roll": "roll_deg"},
}
VELOCITY = tuple(f"velocity_{a}_mps" for a in ("north", "east", "down"))


@dataclass(slots=True)
class _Rows:
    stamps: list[int] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)


class GpsdRecording(BatchRecording):
    """A file of reports; other lines are passed over."""

    format = "gpsd JSON log"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._timed: set[str] = set()
        self._lacking: dict[str, int] = {}

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        total, damage = 0, Damage()
        lacking: dict[str, int] = {}
        for block in line_blocks(self.path):
            held: dict[str, _Rows] = {}
            for report, stamp in _reports(block, damage):
                total += 1
                rows = held.setdefault(str(report["class"])[:40], _Rows())
                rows.stamps.append(stamp)
                rows.values.append(_figures(report))
            for name, rows in held.items():
                lacking[name] = lacking.get(name, 0) + rows.stamps.count(UNSET)
                if wanted is None or wanted == name:
                    yield self._batch(name, rows)
        if not total:
            raise damage.refusal(self.path, "no report of gpsd in the file", "one object a line")
        self._lacking = lacking
        if damage.said():
            self._cut(damage.said(), total)

    def _batch(self, name: str, rows: _Rows) -> Batch:
        stamps = None
        if name in self._timed or any(stamp != UNSET for stamp in rows.stamps):
            self._timed.add(name)
            stamps = np.array(rows.stamps, dtype=np.int64)
        columns: dict[str, NDArray[Any]] = {}
        if name in FIELDS:
            table = np.array(rows.values, dtype=float)
            columns = {own: table[:, k] for k, own in enumerate(_names(name))}
        return Batch(name, len(rows.stamps), stamps, None, columns)

    def _facts(self, name: str) -> StreamFacts:
        notes = []
        lacking = self._lacking.get(name, 0)
        if lacking and name in self._timed:
            notes.append(f"{lacking} reports have no time")
        if name == "TPV":
            notes.append("north and east are speed along track, down is minus climb")
        return StreamFacts(
            quantity={"TPV": ("position", "velocity"), "ATT": ("attitude",)}.get(name, ()),
            frame={"TPV": "wgs84", "ATT": "ned"}.get(name, "unknown"),  # type: ignore[arg-type]
            timeline="utc",
            primary="time",
            notes=tuple(notes),
            body="frd" if name == "ATT" else "unknown",
            kind=name,
            columns=_names(name),
            nature="measured" if name in FIELDS else "unknown",
        )


def _reports(block: Sequence[Line], damage: Damage) -> Iterator[tuple[Mapping[str, Any], int]]:
    """The reports of a block with their times [ns]; what is none goes to the damage."""
    for line in block:
        if not line.text.startswith("{") and not line.flaw:
            continue
        try:
            demand_text(line)
            report = _report(line.text)
            yield report, _stamp(report)
        except BadLineError as error:
            if line.whole:
                damage.add(line, error)
            else:
                damage.cut = line.text


def _report(text: str) -> Mapping[str, Any]:
    """A line as an object with a class; BadLineError where it is none."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not isinstance(found.get("class"), str):
        raise BadLineError("no report", "one object with its class")
    return found


def _stamp(report: Mapping[str, Any]) -> int:
    """When a report was made [ns]; UNSET where it does not say so."""
    at = report.get("time")
    if at is None:
        return UNSET
    try:
        return calendar_ns(at if isinstance(at, str) else "")
    except ValueError:
        expected = "an ISO 8601 time such as 2026-03-01T12:00:00.125Z"
        raise BadLineError(f"no time of a report: {str(at)[:40]!r}", expected) from None


def _names(report: str) -> tuple[str, ...]:
    own = tuple(FIELDS.get(report, {}).values())
    return (*own, *VELOCITY) if report == "TPV" else own


def _figures(report: Mapping[str, Any]) -> list[float]:
    name = str(report["class"])
    values = [_number(report, one) for one in FIELDS.get(name, {})]
    if name != "TPV":
        return values
    speed, track = _number(report, "speed"), math.radians(_number(report, "track"))
    along = 0.0 if speed == 0 else track
    north, east = speed * math.cos(along), speed * math.sin(along)
    return [*values, north, east, -_number(report, "climb")]


def _number(report: Mapping[str, Any], name: str) -> float:
    value = report.get(name)
    known = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if known and abs(value) < 1e300 else NAN  # type: ignore[arg-type]


def _recognises(head: FileHead) -> int:
    lines = head_lines(head.start, 2_000)
    return SURER if any(line.startswith(BEGINNING) for line in lines) else NO


def _open(path: Path) -> Recording:
    return GpsdRecording(path)


READER = Reader(GpsdRecording.format, _recognises, _open)
