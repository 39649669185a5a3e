"""LAS and LAZ clouds as a stream of points with their GPS times.

The header says whether times are seconds of the GPS week or adjusted standard time (GPS seconds
minus 1e9); where the values cannot be what it says, the values count, and that is said.
"""

from __future__ import annotations

import logging
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts
from syncline_design.logs.readers.epochs import (
    ADJUSTED_S,
    GPS_EPOCH_S,
    NANO,
    WEEK_S,
    WEEK_SECONDS,
    nanoseconds_of,
)
from syncline_design.logs.readers.las_header import MAGIC, TIMED, LasClaims, claims_of
from syncline_design.logs.readers.laz_cut import mended, whole_points
from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader, library
from syncline_design.logs.readers.stream import UNSET, Frame, Nanoseconds, Recording
from syncline_design.logs.refusals import refuse
from syncline_design.machine.outside import Outside
from syncline_design.spec.load import BadInput

FORMAT = "LAS or LAZ cloud"
CRASH = "the library that unpacks its points crashes there"
PIECE_BYTES = 1 << 25
LEAST_RECORD = 34  # bytes of LASzip's record without items
PANIC = "PanicException"  # what a library in Rust raises beside all exceptions of Python
MOST_ROWS = 50_000  # the size of a chunk as most writers pack them
NARROWER = 30  # times fewer points at once, where a piece cannot be read as a whole
LAST_WEEK_SECOND = 2.0 * WEEK_S  # seconds may run on past the end of the week
SHIFT_NS = (ADJUSTED_S + GPS_EPOCH_S) * NANO  # adjusted standard time to `gps`


class LasRecording(BatchRecording):
    """One cloud, some hundred thousand points at a time."""

    format = FORMAT

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            self._claims: LasClaims = claims_of(path, file.read(4096), path.stat().st_size)
        self._laspy = library("laspy", path, FORMAT)
        if self._claims.packed:
            library("lazrs", path, FORMAT)
        self.sound: int | None = None  # points that unpack without harm, once that was tried
        self._adjusted: bool | None = None  # what the values say
        self._not_finite = 0
        self._back = 0
        self._frame: Frame = "unknown"
        self._zone = 0

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        timed = self._claims.point_format in TIMED
        count = unknown = back = 0
        last = -np.inf
        for points in self.clouds():
            stamps = None
            if timed:
                times = np.asarray(points.gps_time, dtype=float)
                if self._adjusted is None:
                    self._adjusted = _look_adjusted(times)
                stamps = self._stamps(times)
                known = times[np.isfinite(times)]
                unknown += times.shape[0] - known.shape[0]
                back += int(np.count_nonzero(np.diff(np.concatenate([[last], known])) < 0))
                last = float(known[-1]) if known.shape[0] else last
            count += len(points)
            columns = dict.fromkeys(_NAMES, _NONE) if wanted is None else _columns(points)
            if wanted is not None and self._zone:
                columns["utm_zone"] = np.full(len(points), float(self._zone))
            yield Batch(self.path.stem, len(points), stamps, None, columns)
        if not count:
            raise refuse(self.path, "no point in the cloud")
        self._not_finite, self._back = unknown, back

    def clouds(self) -> Iterator[Any]:
        """Points, up to the last that can be read."""
        claims, there = self._claims, self._there()
        count = 0
        if claims.packed and self.sound is None:
            outside = Outside(f"{__name__}:unpacked")
            for points in self._unpacked(outside):
                count += len(points)
                yield points
            self.sound = count if outside.died and count < there else there
        end = there if self.sound is None else min(there, self.sound)
        said = "" if end == there else CRASH
        rows = min(MOST_ROWS, max(1, PIECE_BYTES // claims.record))
        while rows and count < end:
            try:
                for points in self._from(count, end, rows):
                    count += len(points)
                    yield points
            except BadInput:
                raise
            except BaseException as error:  # lazrs and laspy raise many kinds, lazrs panics too
                said = said or _said(error)
                if not claims.packed:
                    break
                rows = rows // NARROWER if rows > NARROWER else rows // 2
            else:
                break
        self._demand_points(count, said)

    def _unpacked(self, outside: Outside) -> Iterator[Any]:
        """Points that another process unpacks; it ends where any are damaged.

        lazrs 0.8.2 reads outside its memory where the layers of a chunk are damaged.
        """
        header = self._header()
        if header is None:
            return
        form = header.point_format
        for piece in outside.pieces(os.fsencode(self.path)):
            raw = np.frombuffer(piece, form.dtype())
            yield self._laspy.ScaleAwarePointRecord(raw, form, header.scales, header.offsets)

    def _header(self) -> Any:
        """laspy's, and what it says of the frame; None of one that it cannot read."""
        try:
            with self.path.open("rb") as file, quiet("laspy"):
                header = self._laspy.LasHeader.read_from(file)
        except Exception:  # said by `_record` and `_from`, which read it again
            return None
        self._frame, self._zone = _frame(header), _zone(header)
        return header

    def _there(self) -> int:
        """Points that the file is long enough for."""
        claims = self._claims
        if claims.packed:
            return whole_points(self.path, claims, self._record())
        return min(claims.points, (self.path.stat().st_size - claims.offset) // claims.record)

    def _demand_points(self, count: int, said: str) -> None:
        """Some, or a refusal; fewer than the header claims are a cut file."""
        if not count and said:
            raise refuse(self.path, "no readable LAS or LAZ cloud", found=said)
        if count < self._claims.points:
            reason = f"{count} of {self._claims.points} points are there"
            self._cut(f"{reason}: {said}" if said else reason, count)

    def _from(self, first: int, end: int, rows: int) -> Iterator[Any]:
        """Points from one on, some at a time; those before are unpacked once more."""
        with self.path.open("rb") as file, quiet("laspy"):
            with no_panic_shown() if self._claims.packed else nullcontext():
                reader = self._reader(file)
            self._frame, self._zone = _frame(reader.header), _zone(reader.header)
            at = 0
            while at < end:
                wanted = min(first - at, MOST_ROWS) if at < first else min(rows, end - at)
                with no_panic_shown() if self._claims.packed else nullcontext():
                    points = reader.read_points(wanted)
                if not len(points):
                    return
                at += len(points)
                if at > first:
                    yield points

    def _record(self) -> bytes:
        """LASzip's own record of the header."""
        try:
            with self.path.open("rb") as file:
                header = self._laspy.LasHeader.read_from(file)
            found = header.vlrs.get("LasZipVlr")
            record = bytes(found[0].record_data_bytes()) if found else b""
        except Exception as error:  # as below
            record, found = b"", str(error)
        if len(record) < LEAST_RECORD:
            raise refuse(self.path, "no record of LASzip in a packed cloud", found=str(found)[:120])
        return record

    def _reader(self, file: BinaryIO) -> Any:
        """laspy's, unpacking from front to back: a cut file has lost its table of chunks."""
        if not self._claims.packed:
            return self._laspy.open(file, closefd=False, read_evlrs=False)
        source = mended(self.path, file, self._claims, self._record())
        source.seek(0)
        backend = self._laspy.LazBackend.Lazrs
        return self._laspy.open(source, closefd=False, laz_backend=backend, read_evlrs=False)

    def _stamps(self, times: NDArray[np.float64]) -> Nanoseconds:
        stamps = nanoseconds_of(times)
        if not self._adjusted:
            return stamps
        lost = (stamps == UNSET) | (stamps >= 2**63 - SHIFT_NS)
        shifted: Nanoseconds = np.where(lost, UNSET, np.where(lost, 0, stamps) + SHIFT_NS)
        return shifted

    def _facts(self, name: str) -> StreamFacts:
        claims = self._claims
        of_times = self._time_notes()
        notes = []
        if self._frame == "unknown":
            notes.append("the file does not say in which frame its points are")
        return StreamFacts(
            quantity=("points",),
            frame=self._frame,
            timeline="gps" if self._adjusted else "unknown",
            primary="GPS time" if self._adjusted else WEEK_SECONDS,
            notes=tuple(notes),
            of_times=of_times,
            kind=f"LAS {claims.version}, point format {claims.point_format}",
            columns=_NAMES,
            nature="measured",
        )

    def _time_notes(self) -> tuple[str, ...]:
        claims = self._claims
        said = []
        if self._adjusted:
            said.append("adjusted standard GPS time: GPS seconds minus 1e9")
        else:
            said.append("seconds of the GPS week: the week is not in the file")
        if self._adjusted and not claims.standard_time:
            said.append(
                "the header says seconds of the GPS week, but the values are larger than any: they "
                "are adjusted standard time"
            )
        elif claims.standard_time and not self._adjusted:
            said.append(
                "the header says adjusted standard time, but the values are seconds of a week "
                "(else they would be of September 2011)"
            )
        if self._not_finite:
            said.append(f"{self._not_finite} points have no finite time")
        if self._back:
            said.append(f"points are not in the order of their times: {self._back} steps back")
        return tuple(said)


def unpacked(request: bytes) -> Iterator[bytes]:
    """The points of the cloud at a path, piece by piece as they unpack (in `Outside`)."""
    recording = LasRecording(Path(os.fsdecode(request)))
    recording.sound = sys.maxsize
    for points in recording.clouds():
        yield points.array.tobytes()


@contextmanager
def quiet(name: str) -> Iterator[None]:
    """Without what a library logs of an error that it also raises."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


@contextmanager
def no_panic_shown() -> Iterator[None]:
    """Without the trace that a library in Rust writes to the second stream when it panics."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


_FIELDS = ("intensity", "point_source_id", "user_data")
_NAMES = ("point_x_m", "point_y_m", "point_z_m", *_FIELDS)
_LABEL = "target_id"  # an extra dimension: which surveyed target a point is of
_ZONE = re.compile(r"UTM[ _]+zone[ _]*(\d{1,2})[ _]*([NS])", re.IGNORECASE)
_GRIDS = {32_600: 1, 32_700: -1}  # EPSG's codes of UTM on WGS 84: these plus the zone
_PROJECTED = 3072  # GeoTIFF's key of the projected coordinate system
_NONE: NDArray[Any] = np.zeros(0)


def _said(error: BaseException) -> str:
    """What a library says of a damaged cloud; anything else that ends a program goes on."""
    if not isinstance(error, Exception) and type(error).__name__ != PANIC:
        raise error
    return (str(error).splitlines() or [type(error).__name__])[0][:120]


def _columns(points: Any) -> dict[str, NDArray[Any]]:
    with np.errstate(over="ignore", invalid="ignore"):  # of scales that a damaged header claims
        columns = {f"point_{a}_m": np.asarray(getattr(points, a), dtype=float) for a in "xyz"}
    labelled = _LABEL in points.point_format.extra_dimension_names
    for name in (*_FIELDS, _LABEL) if labelled else _FIELDS:
        columns[name] = np.asarray(points[name])
    return columns


def _look_adjusted(times: NDArray[np.float64]) -> bool:
    """Whether times are adjusted standard ones: no second of a week is as large, or below zero."""
    known = times[np.isfinite(times)]
    if not known.shape[0]:
        return False
    middle = float(np.median(known))
    return not 0 <= middle < LAST_WEEK_SECOND


def _zone(header: Any) -> int:
    """The zone of UTM on WGS 84, below zero south of the equator; 0 where the file tells none."""
    words, codes = "", set()
    for record in header.vlrs:
        for name in ("string", "strings"):
            words += str(getattr(record, name, ""))
        codes |= {k.value_offset for k in getattr(record, "geo_keys", ()) if k.id == _PROJECTED}
    for code in codes:
        for first, sign in _GRIDS.items():
            if 0 < code - first <= 60:
                return int(sign * (code - first))
    found = _ZONE.search(words)
    if found is None or not 0 < int(found[1]) <= 60:
        return 0
    return int(found[1]) * (1 if found[2].upper() == "N" else -1)


def _frame(header: Any) -> Frame:
    """By the words of the coordinate system, where the header holds one."""
    words = ""
    for record in header.vlrs:
        for name in ("string", "strings"):
            words += str(getattr(record, name, ""))
    return "utm" if "UTM" in words or _zone(header) else "unknown"


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start.startswith(MAGIC) and len(head.start) > 104 else NO


def _open(path: Path) -> Recording:
    return LasRecording(path)


READER = Reader(FORMAT, _recognises, _open)
