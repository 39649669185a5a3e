"""Delimited text in blocks: how a file is written, and its rows without ever holding all of them.

Columns may be separated by commas, semicolons, tabs or bars; lines that begin with `#` are
comments, the last of which may hold the names.  Every row has as many cells as the header; only
the last one may be cut off, and a few may be damaged where they are counted (`Losses`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.cells import ISO, NOTHING
from syncline_design.logs.refusals import refuse
from syncline_design.machine.csv_cells import cells_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.sentences import left_out
from syncline_design.spec.load import BadInput

if TYPE_CHECKING:
    import polars as pl

BLOCK_BYTES = 1 << 20
MOST_HEAD = 1 << 20  # bytes in which the names have to come
MOST_LINE = 1 << 22
MOST_COLUMNS = 5_000
MOST_LEFT_OUT, MOST_UNSOUND = 500, 60  # lines of a file; the latter take whole columns each time
MOST_DAMAGED = 0.1  # of the lines; where more are not as the header says, it is how it was written
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
COMMENT, QUOTE, NEWLINE, BLANK = b"#"[0], b'"'[0], b"\n"[0], b" "[0]
BOM = b"\xef\xbb\xbf"
LINE_END = re.compile(rb"\r\n|\n|\r")  # one pass: looking for each mark is quadratic

Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a file is written: separator, names, and where its rows begin."""

    separator: str
    names: tuple[str, ...]
    line: int  # of the names
    body: int  # offset of the first byte below the header
    body_line: int  # its line

    @property
    def comma_is_decimal(self) -> bool:
        return self.separator != ","


@dataclass(frozen=True, slots=True)
class RowBlock:
    """Some rows as clean text, and the line each came from."""

    text: bytes
    lines: Index


def dialect(path: Path) -> Dialect:
    """Read the head of a file; refuses one that has no header."""
    with path.open("rb") as file:
        raw = file.read(MOST_HEAD)
        whole = not file.read(1)
    offset = len(BOM) if raw.startswith(BOM) else 0
    comments: list[tuple[int, str]] = []
    separator = ""
    line = 0
    while offset < len(raw):
        line += 1
        end, after = _line_end(raw, offset)
        if after > len(raw) - (not whole) and not whole:
            break
        text = _decoded(path, raw[offset:end], line)
        offset = after
        if text.lower().startswith("sep=") and len(text) == 5:
            separator = text[4]
        elif text.lstrip().startswith("#"):
            comments.append((line, text.lstrip("# \t")))
        elif text.strip():
            return _dialect(path, text, line, (offset, end), comments, separator)
    if whole and comments:
        at, text = comments[-1]
        names, mark = split_names(text, separator)
        return Dialect(mark, names, at, offset, line + 1)
    what = "no header" if whole else f"no header in the first {MOST_HEAD >> 20} MiB"
    raise refuse(path, what, line=1, column=1, expected="a line with the names of the columns")


def _dialect(
    path: Path,
    text: str,
    line: int,
    ends: tuple[int, int],
    comments: Sequence[tuple[int, str]],
    separator: str,
) -> Dialect:
    """From the first line that is no comment: the header, or the first row below a `#` header."""
    names, mark = split_names(text, separator)
    body, body_line = ends[0], line + 1
    rows = {m: split_line(text, m) for m in ([separator] if separator else SEPARATORS)}
    checked = {m: _is_row(row) for m, row in rows.items()}
    if any(checked.values()):
        for at, comment in reversed(comments):
            above, mark = split_names(comment, separator)
            row = rows[mark]
            if len(above) == len(row) and checked[mark] and not _is_row(above):
                start = ends[1] - len(text.encode())
                return Dialect(mark, _checked(path, above, at), at, start, line)
        _no_names(path, line, text)
    if len(names) == 1 and len(text.split()) > 2:
        raise refuse(
            path,
            "one column only",
            line=line,
            column=1,
            expected="names separated by commas, semicolons or tabs",
            found=repr(text[:40]),
            hint="are they separated by blanks? Replace these",
        )
    return Dialect(mark, _checked(path, names, line), line, body, body_line)


def _no_names(path: Path, line: int, text: str) -> NoReturn:
    raise refuse(
        path,
        "no header",
        line=line,
        column=1,
        expected="a line with the names of the columns above the rows, such as time_s,range_m",
        found=repr(text[:40]),
    )


def _line_end(raw: bytes, offset: int) -> tuple[int, int]:
    """End of a line and start of the next one; lines end with LF, CRLF or CR."""
    found = LINE_END.search(raw, offset)
    return (found.start(), found.end()) if found else (len(raw), len(raw) + 1)


def _decoded(path: Path, raw: bytes, line: int) -> str:
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise refuse(
            path, "not UTF-8", line=line, column=error.start + 1, hint="save the file as UTF-8"
        ) from None
    if "\x00" in text:
        column = text.index("\x00") + 1
        raise refuse(path, "not a text file", line=line, column=column, found="NUL")
    return text


def split_names(text: str, separator: str = "") -> tuple[tuple[str, ...], str]:
    """Cells of one line, by the separator that gives most of them, and that separator."""
    marks = [separator] if separator else list(SEPARATORS)
    found = [tuple(c.strip() for c in split_line(text, mark)) for mark in marks]
    best = max(range(len(marks)), key=lambda k: (len(found[k]), -k))
    return found[best], marks[best]


def split_line(text: str, separator: str) -> list[str]:
    """Cells of one line."""
    return cells_of(text, separator, MOST_LINE)


def _is_row(cells: Sequence[str]) -> bool:
    """Whether a line holds values, of which some may be text, and no names."""
    some = [c.strip() for c in cells if c.strip() not in NOTHING]
    values = sum(_is_number(c) or bool(re.match(ISO, c)) for c in some)
    return bool(some) and 2 * values >= len(some)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _checked(path: Path, names: tuple[str, ...], line: int) -> tuple[str, ...]:
    if len(names) > MOST_COLUMNS:
        raise refuse(
            path,
            "too many columns",
            line=line,
            column=1,
            expected=f"at most {MOST_COLUMNS}",
            found=str(len(names)),
        )
    seen: set[str] = set()
    for k, name in enumerate(names):
        if name and name in seen:
            raise refuse(path, "a column is there twice", line=line, column=k + 1, field=name[:80])
        seen.add(name)
    return names


def last_line(path: Path, start: int) -> tuple[int, str] | None:
    """Offset and text of a last line that no line end closes; None where there is none."""
    size = path.stat().st_size
    with path.open("rb") as file:
        first = max(start, size - MOST_LINE)
        file.seek(first)
        tail = file.read()
    if not tail or tail[-1:] in (b"\n", b"\r"):
        return None
    at = max(tail.rfind(b"\n"), tail.rfind(b"\r")) + 1
    return first + at, tail[at:].decode("utf-8", errors="replace")


@dataclass(slots=True)
class Losses:
    """Damaged lines that are left out, instead of refusing their file for them.

    demand: what a block of rows has to stand besides having the header's cells; raises BadInput.
    """

    demand: Callable[[RowBlock], object]
    count: int = 0
    first: BadInput | None = None

    def add(self, error: BadInput, lines: int, most: int = MOST_LEFT_OUT) -> None:
        """One more of so many lines; refuses where they are more than damage explains."""
        self.count += 1
        self.first = self.first or error
        if self.count > min(MOST_DAMAGED * lines, most):
            raise self.first

    def said(self) -> str:
        """For people; empty where every line was read."""
        if self.first is None:
            return ""
        (flaw,) = self.first.problems
        return left_out(self.count, flaw.line, flaw.message)


def blocks(path: Path, how: Dialect, end: int, losses: Losses | None = None) -> Iterator[RowBlock]:
    """All rows up to an offset, in order; refuses a row that has not the header's cells.

    losses: where such rows go instead.
    """
    line, rest = how.body_line, b""
    with path.open("rb") as file:
        file.seek(how.body)
        left = end - how.body
        while left > 0:
            raw = file.read(min(BLOCK_BYTES, left))
            left -= len(raw)
            if not raw:
                break
            raw = rest + raw
            cut = len(raw) if left <= 0 else _last_break(raw)
            rest = raw[cut:]
            if len(rest) > MOST_LINE:
                raise refuse(path, f"a line longer than {MOST_LINE >> 20} MiB", line=line, column=1)
            if cut:
                plain = _plain(raw[:cut])
                if losses is None:
                    found, line = _block(path, how, plain, line)
                else:
                    found = _joined(_good(path, how, plain, line, losses))
                    line += plain.count(b"\n")
                    if found is not None:
                        found = _joined(_sound(found, losses, line - how.body_line))
                if found is not None:
                    yield found


def _good(
    path: Path, how: Dialect, raw: bytes, line: int, losses: Losses, lines: int = 0
) -> Iterator[RowBlock]:
    """The rows of a block: it is halved as long as there is a line in it that is no row."""
    lines = lines or line - how.body_line + raw.count(b"\n")
    try:
        found, _ = _block(path, how, raw, line)
    except BadInput as error:
        middle = _middle(raw)
        if middle == len(raw):
            losses.add(error, lines)
            return
        yield from _good(path, how, raw[:middle], line, losses, lines)
        after = line + raw.count(b"\n", 0, middle)
        yield from _good(path, how, raw[middle:], after, losses, lines)
    else:
        if found is not None:
            yield found


def _sound(block: RowBlock, losses: Losses, lines: int) -> Iterator[RowBlock]:
    """Rows that stand what is demanded of them, found by halves as well."""
    try:
        losses.demand(block)
    except BadInput as error:
        middle = _middle(block.text)
        if middle == len(block.text):
            losses.add(error, lines, MOST_UNSOUND)
            return
        rows = block.text.count(b"\n", 0, middle)
        yield from _sound(RowBlock(block.text[:middle], block.lines[:rows]), losses, lines)
        yield from _sound(RowBlock(block.text[middle:], block.lines[rows:]), losses, lines)
    else:
        yield block


def _middle(text: bytes) -> int:
    """Where the line begins that is about the middle one; behind the text where it is the only."""
    return text.rfind(b"\n", 0, len(text) // 2) + 1 or text.find(b"\n") + 1


def _joined(found: Iterable[RowBlock]) -> RowBlock | None:
    pieces = list(found)
    if len(pieces) < 2:
        return pieces[0] if pieces else None
    return RowBlock(
        b"".join(piece.text for piece in pieces), np.concatenate([p.lines for p in pieces])
    )


def _last_break(raw: bytes) -> int:
    """Where the last whole line ends; a CR at the very end may still get its LF."""
    return max(raw.rfind(b"\n"), raw.rfind(b"\r", 0, len(raw) - 1)) + 1


def _plain(raw: bytes) -> bytes:
    """Lines that end with LF, the last one too."""
    if b"\r" in raw:
        raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return raw if raw.endswith(b"\n") else raw + b"\n"


def _block(path: Path, how: Dialect, raw: bytes, line: int) -> tuple[RowBlock | None, int]:
    """Rows of a block without comments and empty lines; and the line after it."""
    data = np.frombuffer(raw, dtype=np.uint8)
    starts, ends = _bounds(data)
    lines = line + np.arange(ends.shape[0])
    after = line + ends.shape[0]
    _demand_text(path, raw, ends, line)
    ink = np.flatnonzero(data > BLANK)  # a row of tabs alone is as empty as one of blanks
    first = np.searchsorted(ink, starts)
    filled = np.searchsorted(ink, ends) > first
    if not np.any(filled):
        return None, after
    rows = filled & (data[ink[np.minimum(first, ink.shape[0] - 1)]] != COMMENT)
    if not np.all(rows):
        data = data[np.repeat(rows, ends - starts + 1)]
        raw, lines = data.tobytes(), lines[rows]
        starts, ends = _bounds(data)
    if not lines.shape[0]:
        return None, after
    marks = _separators(path, data, ends, starts, lines, how.separator)
    count = np.searchsorted(marks, ends) - np.searchsorted(marks, starts) + 1
    wrong = np.flatnonzero(count != len(how.names))
    if wrong.shape[0]:
        _refuse_ragged(path, how, int(lines[wrong[0]]), int(count[wrong[0]]))
    return RowBlock(raw, lines), after


def _bounds(data: NDArray[np.uint8]) -> tuple[Index, Index]:
    """First byte of every line and the place of its end."""
    ends = np.flatnonzero(data == NEWLINE)
    return np.concatenate([np.zeros(1, dtype=np.int64), ends[:-1] + 1])[: ends.shape[0]], ends


def _demand_text(path: Path, raw: bytes, ends: Index, line: int) -> None:
    bad = raw.find(b"\x00")
    message = "not a text file"
    if bad < 0 and not raw.isascii():
        try:
            raw.decode("utf-8")
        except UnicodeDecodeError as error:
            bad, message = error.start, "not UTF-8"
    if bad >= 0:
        row = int(np.searchsorted(ends, bad))
        column = bad - (int(ends[row - 1]) + 1 if row else 0) + 1
        hint = "save the file as UTF-8" if message == "not UTF-8" else ""
        raise refuse(path, message, line=line + row, column=column, hint=hint)


def _separators(
    path: Path, data: NDArray[np.uint8], ends: Index, starts: Index, lines: Index, mark: str
) -> Index:
    """Places of the separators that are not within quotes."""
    marks = np.flatnonzero(data == ord(mark))
    quotes = np.flatnonzero(data == QUOTE)
    if not quotes.shape[0]:
        return marks
    before = np.searchsorted(quotes, starts)
    odd = (np.searchsorted(quotes, ends) - before) % 2 == 1
    if np.any(odd):
        line = int(lines[np.flatnonzero(odd)[0]])
        raise refuse(path, "a quote is not closed in its line", line=line, column=1)
    outside: Index = marks[np.searchsorted(quotes, marks) % 2 == 0]
    return outside


def _refuse_ragged(path: Path, how: Dialect, line: int, cells: int) -> NoReturn:
    hint = "a row cut off is left out only at the very end of a file"
    if cells > len(how.names) and how.separator == ",":
        hint = "with decimal commas, separate the columns by ; or tabs"
    raise refuse(
        path,
        f"row {line} has not the header's cells",
        line=line,
        column=1,
        expected=f"{len(how.names)} cells separated by {SEPARATORS.get(how.separator, 'marks')}",
        found=str(cells),
        hint=hint,
    )


def parsed(block: RowBlock, how: Dialect, wanted: Sequence[int], as_text: bool) -> pl.DataFrame:
    """Some columns of a block, in the order of their places in the file."""
    import polars as pl

    kind = pl.String if as_text else pl.Float64
    names = [f"column_{k + 1}" for k in range(len(how.names))]
    places = sorted(wanted)
    chosen = {names[k]: kind for k in places}
    return pl.read_csv(
        block.text,
        has_header=False,
        separator=how.separator,
        schema={name: chosen.get(name, pl.String) for name in names},
        columns=[names[k] for k in places],
        null_values=list(NOTHING),
    )
