"""Files of clock logs to series: one for each source and log, whatever format each file has."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.clocks import chrony, columns, linuxptp, ntpd, pulses
from syncline_design.clocks.files import LogFile, no_text, read_files, refused
from syncline_design.clocks.repeats import demand_once
from syncline_design.clocks.series import FARTHEST_S, ClockSeries, Row, Sheet, SourceKind, series_of
from syncline_design.clocks.starts import with_starts
from syncline_design.machine.deadline import in_force
from syncline_design.machine.input_files import FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.load import BadInput

_Read = Callable[[str], tuple[SourceKind, Row, str] | None]
_LINE_READERS: Final[dict[str, Callable[[], _Read]]] = {
    "chrony": lambda: chrony.ChronyReader().row,
    "ntpd": lambda: ntpd.row,
    "linuxptp": lambda: linuxptp.PtpReader().row,
    "gpsd": lambda: pulses.gpsd_row,
    "ppstest": lambda: pulses.ppstest_row,
}
_HEAD: Final = 2000  # lines by which a format is told
_FIRST_BYTES: Final = 2**18  # of a file by which it is told from others
_JOURNALS: Final = ("linuxptp", "gpsd", "ppstest")  # formats that stand among other lines
_FORMATS: Final = (
    "a log of chrony (tracking, statistics, measurements, refclocks), ntpd (loopstats, peerstats), "
    "ptp4l, phc2sys, ts2phc, gpsd (JSON), ppstest, or a table with time_s and offset_s"
)
MOST_ROWS: Final = 5_000_000


@dataclass(frozen=True, slots=True)
class ClockLogs:
    """All that was read: series by source, the files, and what has to be said of them."""

    series: tuple[ClockSeries, ...]
    files: tuple[FileRead, ...]
    notes: tuple[str, ...]


def read_logs(paths: Sequence[Path]) -> ClockLogs:
    """Read the logs; BadInput names the first that cannot be used."""
    in_force().doing("reading the logs")
    files = read_files(paths)
    notes = [f"{one.path}: {one.cut_short}" for one in files if one.cut_short]
    sheets: dict[tuple[str, str], list[tuple[LogFile, Sheet]]] = {}
    for file in files:
        read, said = _sheets(file)
        notes += said
        for sheet in read:
            sheets.setdefault((file.log, sheet.kind.name), []).append((file, sheet))
    series = with_starts([_joined(parts) for parts in sheets.values()])
    demand_once(series)
    freed = [_free_running(one) for one in series]
    notes += [said for _, said in freed if said]
    hashes = tuple(FileRead(str(file.path), file.sha256) for file in files)
    return ClockLogs(tuple(one for one, _ in freed), hashes, tuple(notes))


def is_clock_log(path: Path) -> bool:
    """Whether a file begins as one of the logs that are read here; False where it cannot be."""
    try:
        with path.open("rb") as stream:
            head = stream.read(_FIRST_BYTES)
    except OSError:
        return False
    if head.startswith(b"\x1f\x8b"):
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, _FIRST_BYTES)
        except zlib.error:
            return False
    lines = [one for one in head.decode("utf-8-sig", errors="replace").splitlines() if one.strip()]
    text = tuple(line for line in lines if no_text(path, line, 0) is None)
    if 2 * len(text) <= len(lines):
        return False
    try:
        return bool(_format(LogFile(path, "", text, "", (0, ""))))
    except BadInput:
        return False


def _sheets(file: LogFile) -> tuple[list[Sheet], list[str]]:
    name = _format(file)
    if name == "csv":
        return columns.read(file)
    read = _LINE_READERS[name]()
    found: dict[str, Sheet] = {}
    damage = replace(file.no_text)
    journal = name in _JOURNALS
    last = total = 0
    for number, line in enumerate(file.lines, 1):
        if not number % 4096:
            in_force().check()
        parsed = read(line)
        if parsed is None or not _is_finite(parsed[1]):
            if not journal and not _is_decoration(line) and not chrony.is_repeat(line):
                damage.add(_strange(file, number))
                last = number
            continue
        kind, row, reference = parsed
        sheet = found.setdefault(kind.name, Sheet(kind))
        sheet.add(row)
        if reference:
            sheet.references.add(reference)
        total += 1
        if total > MOST_ROWS:
            raise refused(file.path, "too many lines", line=number, expected=f"at most {MOST_ROWS}")
    if last == len(file.lines) and damage.count == 1:
        return list(found.values()), [f"{file.path}: the last line is cut off and left out"]
    if not journal:  # in one, damaged lines count among those of others
        damage.demand_few(total, least=2)
    return list(found.values()), damage.said(file.path)


def _is_finite(row: Row) -> bool:
    """Figures that are some; only a line that says that lock was lost has no offset."""
    known = abs(row.offset_s) < FARTHEST_S or (math.isnan(row.offset_s) and not row.locked)
    return abs(row.time_s) < FARTHEST_S and known and not abs(row.hard_s) >= FARTHEST_S


def _strange(file: LogFile, line: int) -> BadInput:
    """Why a line of a daemon's own log is none of it."""
    return refused(
        file.path, "no line of this log", line=line,
        expected="dates, sources and figures as the daemon writes them",
        found=repr(file.lines[line - 1][:60]),
    )  # fmt: skip


def _is_decoration(line: str) -> bool:
    """Banners, headers, comments and empty lines."""
    text = line.strip()
    return not text or text[0] in "=#" or text.startswith(("Date (UTC)", "MJD"))


def _format(file: LogFile) -> str:
    head = [line for line in file.lines[:_HEAD] if line.strip()]
    counts = {name: _count(make(), head) for name, make in _LINE_READERS.items()}
    best = max(counts, key=lambda name: counts[name])
    if counts[best] == 0 and columns.looks_like(head):
        return "csv"
    if counts[best] == 0 and len(file.lines) > _HEAD:
        for name in ("linuxptp", "gpsd", "ppstest"):  # a journal that is long before they begin
            if _count(_LINE_READERS[name](), file.lines):
                return name
    if counts[best] == 0:
        shown = next((line.strip() for line in head if not _is_decoration(line)), "")
        if not shown:
            raise refused(file.path, "no samples", expected=_FORMATS, found="only headers")
        if any(chrony.is_repeat(line) for line in head):
            raise refused(file.path, "only filtered samples of refclocks.log",
                          expected="the raw ones, too, between which chrony writes these",
                          found=repr(shown[:60]))  # fmt: skip
        columns_hint = "a table needs offset_s (or _ms, _us, _ns): local minus reference"
        raise refused(file.path, "no clock log that is known", expected=_FORMATS,
                      found=repr(shown[:60]), hint=columns_hint)  # fmt: skip
    return best


def _count(read: Callable[[str], object], lines: Iterable[str]) -> int:
    return sum(read(line) is not None for line in lines)


def _joined(parts: list[tuple[LogFile, Sheet]]) -> ClockSeries:
    """Rotations of one log, the oldest first: by their stamps where these are of UTC."""
    kind = parts[0][1].kind
    if kind.stamps == "utc":
        parts = sorted(parts, key=lambda part: part[1].figures[0])
    else:
        parts = sorted(parts, key=lambda part: part[0].order)
    files = tuple(str(file.path) for file, _ in parts)
    return series_of(kind, files, [sheet for _, sheet in parts])


def _free_running(one: ClockSeries) -> tuple[ClockSeries, str]:
    """A servo that never steered: it only compares, so its offsets are no servo's own."""
    if one.kind.family != "linuxptp" or not len(one) or bool(np.any(one.locked)):
        return one, ""
    kind = replace(one.kind, steering="independent", whole_way=True)
    locked = np.isfinite(one.offset_s)
    return replace(one, kind=kind, locked=locked), (
        f"{one.kind.name} never steered (state s0 throughout): taken as a comparison only"
    )
