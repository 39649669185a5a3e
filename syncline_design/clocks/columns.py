"""A plain table of offsets: a time, `offset_UNIT` (local minus reference), perhaps more.

Columns: `time_s` (or `time`, ISO 8601), `offset_s`, `_ms`, `_us` or `_ns`; `bound_UNIT` what the
error is bounded by at that moment; `locked` 1 or 0; `session` a name or number of the session.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Final

from syncline_design.clocks import rollover
from syncline_design.clocks.damage import DamagedLines
from syncline_design.clocks.files import LogFile, refused
from syncline_design.clocks.series import FARTHEST_S, Row, Sheet, SourceKind
from syncline_design.machine.csv_cells import NotCellsError, cells_of
from syncline_design.machine.deadline import in_force
from syncline_design.spec.load import BadInput

_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\N{MICRO SIGN}s": 1e-6,
                 "\N{GREEK SMALL LETTER MU}s": 1e-6, "ns": 1e-9, "ps": 1e-12}  # fmt: skip
_QUANTITY: Final = re.compile(r"(time|t|offset|bound)(?:_|\s*[\[(]\s*)([a-z\u00b5\u03bc]+)[\])]?")
_TRUE, _FALSE = ("1", "true", "yes", "locked"), ("0", "false", "no", "unlocked")
_LEAP: Final = re.compile(r"(.+[T ]\d\d:\d\d):60(.*)")  # the hour is its zone's
_EARLIEST_UTC: Final = 3e8  # seconds; smaller stamps count from some start
MOST_CELL: Final = 200


def looks_like(lines: Sequence[str]) -> bool:
    """Whether the first line that is no comment is a header with an offset in it."""
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    names = [name.strip().lower() for name in cells_of(first, _mark(first))]
    return len(names) > 1 and any(re.match(r"offset|bound", name) for name in names)


def _mark(line: str) -> str:
    return max((";", "\t", ","), key=line.count)


def read(file: LogFile) -> tuple[list[Sheet], list[str]]:
    """The one source of a table of offsets, and what is said of rows without a figure."""
    numbered = ((n, line) for n, line in enumerate(file.lines, 1)
                if line.strip() and not line.startswith("#"))  # fmt: skip
    line, header = next(numbered)
    mark = _mark(header)
    names = [c.strip() for c in cells_of(header, mark)]
    columns = _columns(file, names, line)
    sheet = Sheet(SourceKind("CSV", "csv", 1, "unknown", "utc"))
    stamps_utc = True
    empty: list[int] = []
    damage = replace(file.no_text)
    for number, row in _rows(file, numbered, mark, columns, len(names), damage):
        if row is None:
            empty.append(number)
        else:
            stamps_utc &= row.time_s > _EARLIEST_UTC
            sheet.add(row)
    # many rows that are not as the header says are how the table was written, and no damage
    damage.demand_few(len(sheet.figures) // len(Row._fields) + len(empty), least=0)
    if not sheet.figures:
        raise refused(file.path, "no samples", expected="rows below the header", line=line)
    said = damage.said(file.path)
    if empty:
        said.append(f"{file.path}: {len(empty)} rows without time or offset left out, the first in "
                    f"line {empty[0]}")  # fmt: skip
    if not stamps_utc:
        sheet.kind = SourceKind("CSV", "csv", 1, "unknown", "boot")
        said += [f"{file.path}: {text}" for text in _count_on(sheet)]
    return [sheet], said


def _count_on(sheet: Sheet) -> list[str]:
    """Stamps over midnight or the end of a week as those of one session."""
    found = rollover.unfolded(sheet.columns[:, 0])
    if not found.folds:
        return []
    sheet.move(found.time_s)
    return [rollover.said(found)]


def _rows(
    file: LogFile, numbered: Iterator[tuple[int, str]], mark: str, columns: dict[str, int],
    width: int, damage: DamagedLines,
) -> Iterator[tuple[int, Row | None]]:  # fmt: skip
    """Every row by its line, None where it lacks a value; what is none goes to the damage."""
    session: str | None = None
    check: Callable[[], None] = in_force().check
    for count, (number, line) in enumerate(numbered):
        if not count % 4096:
            check()
        try:
            cells = _split(file, number, line, mark, columns, width)
            row, session = _Cells(file, number, cells, columns, mark != ",").row(session)
        except BadInput as error:
            damage.add(error)
        else:
            yield number, row


def _split(
    file: LogFile, number: int, line: str, mark: str, columns: dict[str, int], width: int
) -> list[str]:  # fmt: skip
    """The cells of a row: those that are needed, and none but blank ones beyond the header's."""
    try:
        cells = cells_of(line, mark)
    except NotCellsError as error:
        raise refused(file.path, f"not a row: {error}", line=number) from None
    least = max(columns.values()) + 1
    if len(cells) < least or any(cell.strip() for cell in cells[width:]):
        raise refused(file.path, "a row has not the header's cells", line=number,
                      expected=f"{least} to {width} cells", found=str(len(cells)))  # fmt: skip
    return cells


def _columns(file: LogFile, names: Sequence[str], line: int) -> dict[str, int]:
    """`offset_us` and the like to their places; a key `offset 1e-06` carries the scale."""
    found: dict[str, int] = {}
    for place, name in enumerate(names):
        lower = name.lower()
        match = _QUANTITY.fullmatch(lower)
        if match and match[2] in _UNITS:
            key = f"{'time' if match[1] == 't' else match[1]} {_UNITS[match[2]]!r}"
        elif lower in ("time", "timestamp", "date", "datetime", "time_iso", "utc"):
            key = "stamp"
        elif lower in ("locked", "synchronised", "synchronized", "session"):
            key = "session" if lower == "session" else "locked"
        else:
            continue
        if any(k.split(" ")[0] == key.split(" ")[0] for k in found):
            raise refused(file.path, f"two columns of one meaning: {name[:40]}", line=line,
                          column=place + 1, expected="one")  # fmt: skip
        found[key] = place
    _demand(file, found, names, line)
    return found


def _demand(file: LogFile, found: dict[str, int], names: Sequence[str], line: int) -> None:
    listed = ", ".join(names)[:MOST_CELL]
    if not any(key.startswith("offset") for key in found):
        raise refused(
            file.path, "no offset whose unit and sign are known", line=line, found=listed,
            expected="a column offset_s, offset_ms, offset_us or offset_ns: local minus reference",
        )  # fmt: skip
    if not any(key.startswith(("time", "stamp")) for key in found):
        raise refused(file.path, "no time", line=line, found=listed,
                      expected="a column time_s, or time in ISO 8601")  # fmt: skip


def _unix(text: str) -> float | None:
    """Unix seconds where a column of times holds numbers."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if _EARLIEST_UTC < value < 1e11 else None


def _iso(text: str) -> float | None:
    """Unix seconds of a date and time; a leap second is the one after 59, as Unix counts it."""
    leap = _LEAP.fullmatch(text)
    try:
        read_as = datetime.fromisoformat(f"{leap[1]}:59{leap[2]}" if leap else text)
    except ValueError:
        return None
    read_as = read_as if read_as.tzinfo else read_as.replace(tzinfo=UTC)
    return read_as.timestamp() + (1.0 if leap else 0.0)


class _Cells:
    """One row of a table."""

    def __init__(
        self, file: LogFile, line: int, cells: Sequence[str], columns: dict[str, int], comma: bool
    ) -> None:
        self.file, self.line, self.cells = file, line, cells
        self.columns, self.comma = columns, comma

    def row(self, before: str | None) -> tuple[Row | None, str | None]:
        """The row, None where a value is missing; and the session that it is in."""
        time_s, offset_s = self._time(), self._number("offset")
        if time_s is None or offset_s is None:
            return None, before
        bound = self._number("bound")
        own = self._text("session")
        restart = own is not None and before is not None and own != before
        if bound is not None and bound < 0.0:
            raise refused(self.file.path, "a bound below 0", line=self.line,
                          expected="how far off the clock may be, to either side")  # fmt: skip
        hard = math.nan if bound is None else bound
        return Row(time_s, offset_s, hard, self._locked(), restart=restart), own

    def _text(self, key: str) -> str | None:
        place = self.columns.get(key)
        return None if place is None else self.cells[place].strip()

    def _number(self, name: str) -> float | None:
        for key, place in self.columns.items():
            if not key.startswith(name + " "):
                continue
            text = self.cells[place].strip()
            if text.lower() in ("", "nan", "na", "null", "none", "-"):
                return None
            try:
                value = float(text.replace(",", ".") if self.comma else text)
            except ValueError:
                value = math.inf
            value *= float(key.split(" ")[1])
            if not abs(value) < FARTHEST_S:
                raise refused(self.file.path, f"no number in column {name}", line=self.line,
                              column=place + 1, found=repr(text[:40]))  # fmt: skip
            return value
        return None

    def _time(self) -> float | None:
        if "stamp" not in self.columns:
            return self._number("time")
        text = self.cells[self.columns["stamp"]].strip()
        if not text:
            return None
        seconds = _iso(text)
        seconds = _unix(text) if seconds is None else seconds
        if seconds is None:
            raise refused(self.file.path, "no time", line=self.line,
                          column=self.columns["stamp"] + 1, expected="ISO 8601, or time_s",
                          found=repr(text[:40]))  # fmt: skip
        return seconds

    def _locked(self) -> bool:
        text = self._text("locked")
        if text is None or text.lower() in _TRUE:
            return True
        if text.lower() in _FALSE:
            return False
        raise refused(self.file.path, "neither locked nor unlocked", line=self.line,
                      column=self.columns["locked"] + 1, expected="1 or 0",
                      found=repr(text[:40]))  # fmt: skip
