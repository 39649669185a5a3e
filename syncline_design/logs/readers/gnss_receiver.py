"""What GNSS receivers send, as it was logged: NMEA sentences and u-blox messages, mixed or alone.

Every kind of sentence and message is a stream.  A plain log holds no time of arrival.  GGA, RMC,
GLL, GNS and GST of one epoch are one fix, in the stream `fix`.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers import nmea, ubx
from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts
from syncline_design.logs.readers.epochs import DAY_SECONDS, WEEK_SECONDS, gps_minus_utc_s
from syncline_design.logs.readers.reader import BY_MAGIC, BY_SHAPE, NO, FileHead, Reader, library
from syncline_design.logs.readers.receiver_frames import UBX, FrameCount, frames
from syncline_design.logs.readers.stream import UNSET, Recording
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass

FIX = "fix"
MOST_ROWS = 20_000
MGA = 0x13  # of these the first byte of the payload belongs to the name
FORMAT = "NMEA or u-blox log"
HIGH = "NAV-HPPOSLLH"
WHOLE, PARTS = "NAV-PVT", (HIGH, "NAV-POSLLH", "NAV-VELNED")


@dataclass(slots=True)
class _Rows:
    """Messages of one stream on their way to a batch."""

    stamps: list[int] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    key: bytes = b""
    timed: bool = False


class ReceiverRecording(BatchRecording):
    """One file of frames."""

    format = FORMAT

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._names: dict[bytes, str] = library("pyubx2", path, FORMAT).UBX_MSGIDS
        self._known: dict[bytes, str] = {}
        self._tow_places: dict[str, int | None] = {}
        self._vtg_leads = False
        self._first_day, self._first_week = self._first_moments()
        self._jumps: list[str] = []
        self._kinds: dict[str, str] = {}
        self._leaps: set[int] = set()
        self._high: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None

    def _first_moments(self) -> tuple[int | None, int | None]:
        """The first sentence with a day, and the first message with a week."""
        day: int | None = None
        week: int | None = None
        good, told = 0, False
        with self.path.open("rb") as file:
            for what, body in frames(file, FrameCount()):
                good += 1
                if what == "nmea" and (day is None or not told):
                    said = nmea.parsed(body)
                    self._vtg_leads |= said.kind == "VTG" and not told
                    told = told or said.kind in nmea.PLACES
                    own = nmea.day_ns(said)
                    if day is None and own is not None and said.tod_ns not in (None, UNSET):
                        day = own + (said.tod_ns or 0)
                elif what == "ubx" and week is None:
                    week = _week_said(body)
                if day is not None and week is not None and told:
                    break
        if not good:
            raise refuse(self.path, "no sentence or message with a right checksum")
        return day, week

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        days, weeks = nmea.DayClock(self._first_day), ubx.WeekClock(self._first_week)
        fixes = nmea.Fixes(self._vtg_leads)
        count, total = FrameCount(), 0
        held: dict[str, _Rows] = {}
        if wanted == WHOLE and self._high is None:
            self._high = self._high_precision()
        with self.path.open("rb") as file:
            for what, body in frames(file, count):
                if what == "nmea":
                    self._take_sentence(nmea.parsed(body), days, fixes, held)
                else:
                    self._take_message(body, weeks, held, wanted is not None)
                total += 1
                if total % MOST_ROWS == 0:
                    yield from self._emptied(held, wanted)
        last = fixes.last()
        if last is not None:
            _add_fix(held, last)
        yield from self._emptied(held, wanted)
        if wanted is None:
            self._jumps = days.jumps
            self._note_end(count, total)

    def _note_end(self, count: FrameCount, total: int) -> None:
        said = []
        if count.refused:
            said.append(f"{count.refused} sentences or messages refused: their checksum is wrong")
        if count.stray:
            said.append(f"{count.stray} bytes between them belong to none")
        if count.cut:
            said.append(f"the last one is cut after {count.cut} bytes")
        if said:
            self._cut("; ".join(said), total)

    def _take_sentence(
        self,
        said: nmea.Sentence,
        days: nmea.DayClock,
        fixes: nmea.Fixes,
        held: dict[str, _Rows],
    ) -> None:
        rows = held.setdefault(said.name, _Rows())
        self._kinds[said.name] = said.kind
        moment = UNSET
        if said.tod_ns is not None:
            moment = days.moment(said)
            rows.timed = True
        rows.stamps.append(moment)
        turn = nmea.turn(said)
        if turn is not None:
            rows.values.append(turn)
        done = fixes.add(said, moment)
        if done is not None:
            _add_fix(held, done)

    def _take_message(
        self, body: bytes, weeks: ubx.WeekClock, held: dict[str, _Rows], whole: bool
    ) -> None:
        key, payload = body[:2], body[4:]
        name = self._name(body)
        row = _row(body)
        if row is None and key in ubx.DTYPES:  # a poll, or of another version than that known
            name, payload = f"{name} ({len(payload)} bytes)", b""
        rows = held.setdefault(name, _Rows())
        rows.key = key
        tow = self._time_of_week(name, payload) if row is None else ubx.tow_ns(key, row)
        tag = row is not None and "timeTag" in (row.dtype.names or ())
        if tag:
            rows.stamps.append(int(row["timeTag"]) * ubx.MS)
            rows.timed = True
        elif tow is not None:
            rows.stamps.append(UNSET if tow == UNSET else weeks.moment(key, row, tow))
            rows.timed = rows.timed or tow != UNSET
            self._compare_leaps(row, rows.stamps[-1])
        else:
            rows.stamps.append(UNSET)
        if whole:
            rows.payloads.append(payload)

    def _compare_leaps(self, row: Any, gps_ns: int) -> None:
        """Whole seconds between the GPS time and the UTC of one message."""
        if row is None or gps_ns == UNSET or len(self._leaps) > 3:
            return
        utc = ubx.utc_ns(row)
        if utc is not None:
            self._leaps.add(round((gps_ns - utc) / 1e9) - gps_minus_utc_s(utc))

    def _name(self, body: bytes) -> str:
        """As the library calls it; a message that it does not know by its class and id."""
        key = body[:2] + (body[4:5] if body[0] == MGA else b"")
        name = self._known.get(key)
        if name is None:
            name = self._names.get(key, self._names.get(key[:2], f"UBX-{key[:2].hex().upper()}"))
            self._known[key] = name
        return name

    def _time_of_week(self, name: str, payload: bytes) -> int | None:
        """iTOW of a message whose layout only the library knows [ns]; None where there is none."""
        if name not in self._tow_places:
            self._tow_places[name] = _place_of_itow(name, self.path)
        at = self._tow_places[name]
        if at is None or len(payload) < at + 4:
            return None
        tow_ms = int.from_bytes(payload[at : at + 4], "little")
        return tow_ms * ubx.MS if tow_ms <= 604_800_000 else UNSET

    def _emptied(self, held: dict[str, _Rows], wanted: str | None) -> Iterator[Batch]:
        for name in list(held):
            rows = held.pop(name)
            if wanted is not None and name != wanted:
                continue
            columns = self._columns(name, rows) if wanted is not None else {}
            stamps = np.array(rows.stamps, dtype=np.int64) if rows.timed else None
            yield Batch(name, len(rows.stamps), stamps, None, columns)

    def _columns(self, name: str, rows: _Rows) -> dict[str, NDArray[Any]]:
        if rows.values:
            names = nmea.FIX_COLUMNS if name == FIX else nmea.TURN_COLUMNS
            table = np.array(rows.values, dtype=float)
            return {own: table[:, k] for k, own in enumerate(names)}
        found = ubx.rows_of(rows.key, rows.payloads) if rows.payloads else None
        if found is None:
            return {}
        columns = ubx.columns_of(name, found)
        if name == WHOLE and self._high is not None:
            self._join(columns, np.array(rows.stamps, dtype=np.int64))
        return columns

    def _high_precision(self) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
        """Positions of NAV-HPPOSLLH by their time, where the log has them."""
        stamps, places = [], []
        for batch in self._batches(HIGH):
            if batch.primary_ns is not None and "height_m" in batch.columns:
                stamps.append(batch.primary_ns)
                names = ("latitude_deg", "longitude_deg", "height_m", "height_msl_m")
                places.append(np.stack([batch.columns[n] for n in names], axis=1))
        if not stamps:
            return None
        at, first = np.unique(np.concatenate(stamps) // ubx.MS, return_index=True)
        return at, np.concatenate(places)[first]

    def _join(self, columns: dict[str, NDArray[Any]], stamps: NDArray[np.int64]) -> None:
        """NAV-PVT with the digits of the NAV-HPPOSLLH of its iTOW."""
        if self._high is None:
            return
        known, places = self._high
        wanted = (stamps + ubx.MS // 2) // ubx.MS
        place = np.minimum(np.searchsorted(known, wanted), known.shape[0] - 1)
        same = known[place] == wanted
        for k, name in enumerate(("latitude_deg", "longitude_deg", "height_m", "height_msl_m")):
            columns[name] = np.where(same, places[place, k], columns[name])

    def _facts(self, name: str) -> StreamFacts:
        if name == FIX or name in self._kinds:
            return self._facts_of_nmea(name)
        return self._facts_of_ubx(name)

    def _facts_of_nmea(self, name: str) -> StreamFacts:
        notes: tuple[str, ...] = ()
        of_times = tuple(self._jumps)
        dated = self._first_day is not None
        if not dated:
            of_times += ("times of the day without a day: they count from the first midnight",)
        kind = self._kinds.get(name, "")
        quantity: tuple[str, ...] = ()
        columns: tuple[str, ...] = ()
        if name == FIX:
            moves = bool({"RMC", "VTG"} & set(self._kinds.values()))
            quantity = ("position", "velocity") if moves else ("position",)
            columns = nmea.FIX_COLUMNS
            notes += (
                "sentences of one epoch (GGA, RMC, GLL, GNS, GST) are one fix",
                *self._of_vtg(),
                "height_m is the height above sea level plus the separation that GGA says",
                "stamps are the times of the fixes: when they arrived is not in the log",
            )
        elif kind in nmea.PLACES:
            notes += (f"its places are in the stream {FIX}",)
        elif kind in ("HDT", "THS", "PASHR", "PTNLAVR"):
            quantity, columns = ("attitude",), nmea.TURN_COLUMNS
            if kind in ("HDT", "THS"):
                notes += ("its sentences carry no time",)
        return StreamFacts(
            quantity=quantity,
            frame="wgs84" if name == FIX else "ned" if quantity else "unknown",
            timeline="utc" if dated else "unknown",
            primary="UTC" if dated else DAY_SECONDS,
            notes=notes,
            of_times=of_times,
            body="frd" if "attitude" in quantity else "unknown",
            kind=kind or "GGA, RMC, GLL, GNS, GST",
            nature="measured" if quantity else "unknown",
            columns=columns,
        )

    def _of_vtg(self) -> tuple[str, ...]:
        """Which epoch its speed and course were taken as of."""
        if "VTG" not in self._kinds.values():
            return ()
        side = "after" if self._vtg_leads else "before"
        return (f"VTG carries no time: it counts with the fix {side} it, as the file begins",)

    def _facts_of_ubx(self, name: str) -> StreamFacts:
        if name in ("ESF-MEAS", "ESF-RAW"):
            return StreamFacts(timeline="boot", primary="timeTag", kind=name)
        quantity = ubx.quantity_of(name)
        known = self._first_week is not None
        notes: tuple[str, ...] = ()
        of_times = () if known else ("seconds of the GPS week: no message of the log says which",)
        wrong = {leap for leap in self._leaps if leap}
        if wrong and quantity:
            off = ", ".join(str(leap) for leap in sorted(wrong))
            notes += (
                f"UTC in the messages is off by {off} s from the table of leap seconds (before "
                "the almanac a receiver only guesses them); stamps are GPS time of week",
            )
        if "position" in quantity:
            fine = "0.1 mm" if name == HIGH else "1e-7 deg (1.1 cm)"
            notes += (f"positions in steps of {fine}",)
            if name == WHOLE and self._has_high():
                notes += (f"joined with {HIGH} by iTOW: steps of 0.1 mm",)
        columns = tuple(ubx.columns_of(name, _empty(name))) if quantity else ()
        if name in PARTS and WHOLE in self._known.values():
            quantity = ()
            notes += (f"what it measures is in {WHOLE} too, whose times are not rounded to 1 ms",)
        frame = "wgs84" if "position" in quantity else "ned" if quantity else "unknown"
        return StreamFacts(
            quantity=quantity,
            frame=frame,  # type: ignore[arg-type]
            timeline="gps" if known else "unknown",
            primary="iTOW" if known else WEEK_SECONDS,
            notes=notes,
            of_times=of_times,
            body="frd" if "attitude" in quantity or "rate" in quantity else "unknown",
            kind="",
            columns=columns,
            nature="fused" if "attitude" in quantity else "measured" if quantity else "unknown",
        )

    def _has_high(self) -> bool:
        return HIGH in self._known.values()


def _add_fix(held: dict[str, _Rows], fix: tuple[int, list[float]]) -> None:
    rows = held.setdefault(FIX, _Rows(timed=True))
    rows.stamps.append(fix[0])
    rows.values.append(fix[1])


def _week_said(body: bytes) -> int | None:
    """The moment that a message tells with its week; None where it tells none."""
    row = _row(body)
    tow = UNSET if row is None else ubx.tow_ns(body[:2], row)
    return None if tow == UNSET else ubx.said_moment(body[:2], row, tow)


def _row(body: bytes) -> Any:
    rows = ubx.rows_of(body[:2], [body[4:]])
    return None if rows is None else rows[0]


def _empty(name: str) -> NDArray[Any]:
    return np.zeros(0, next(dtype for own, dtype in ubx.DTYPES.values() if own == name))


def _place_of_itow(name: str, path: Path) -> int | None:
    """Where iTOW stands in a payload, by the library's table of what comes before it."""
    table = library("pyubx2.ubxtypes_get", path, FORMAT).UBX_PAYLOADS_GET.get(name, {})
    at = 0
    for field_name, kind in table.items():
        if field_name == "iTOW":
            return at if kind == "U004" else None
        code = kind[0] if isinstance(kind, (list, tuple)) else kind
        if not isinstance(code, str) or not code[-3:].isdecimal():
            return None
        at += int(code[-3:])
    return None


MOST_STRAY = 0.7  # of a head: bytes in no frame


def _recognises(head: FileHead) -> int:
    """A sentence or message with a right checksum, and at its very beginning nothing binary.

    Packed bytes of any format hold eight that look like an empty message: what begins otherwise,
    as from the middle of a frame on, has to hold more than such by chance.
    """
    begins = head.start[:1] in (b"$", b"!", b"#", UBX[:1])
    if head.folder or not (begins or b"\n$" in head.start):
        return NO
    count = FrameCount()
    found = frames(io.BytesIO(head.start), count)
    if next(found, None) is None:
        return NO
    if head.start[:1] in (b"$", b"!", UBX[:1]) or b"\0" not in head.start:
        return BY_MAGIC
    for _ in found:
        pass
    return BY_MAGIC if count.stray < MOST_STRAY * len(head.start) else BY_SHAPE


def _open(path: Path) -> Recording:
    return ReceiverRecording(path)


READER = Reader(FORMAT, _recognises, _open)
