"""Lines of text in blocks of bounded size, each with its number."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.load import BadInput

BLOCK = 1 << 20
MOST_LINE = 1 << 16
BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class Line:
    """A line without its end; whole: whether an end closed it."""

    number: int
    text: str
    whole: bool = True


def line_blocks(path: Path) -> Iterator[list[Line]]:
    """All lines that are not blank, some thousand at a time."""
    number, rest = 0, b""
    with path.open("rb") as file:
        while True:
            raw = file.read(BLOCK)
            held = rest + raw
            if number == 0:
                held = held.removeprefix(BOM)
            parts = held.split(b"\n")
            rest = parts.pop() if raw else b""
            if len(rest) > MOST_LINE:
                raise refuse(path, f"a line longer than {MOST_LINE >> 10} KiB", line=number + 1)
            last = not raw
            found = []
            for k, part in enumerate(parts):
                number += 1
                if part.strip():
                    found.append(
                        Line(number, _text(path, part, number), not (last and k == len(parts) - 1))
                    )
            if found:
                yield found
            if last:
                return


def _text(path: Path, raw: bytes, number: int) -> str:
    if b"\0" in raw:
        column = raw.index(b"\0") + 1
        raise refuse(path, "not a text file", line=number, column=column, found="NUL")
    if len(raw) > MOST_LINE:
        raise refuse(path, f"a line longer than {MOST_LINE >> 10} KiB", line=number, column=1)
    return raw.decode("utf-8", errors="replace").rstrip("\r")


def head_lines(start: bytes, most: int = 200) -> list[str]:
    """The first whole lines of a file that are not blank; none where it is no text."""
    start = start.removeprefix(BOM)
    whole = start[: start.rfind(b"\n") + 1] or start
    lines = [line for line in whole.split(b"\n")[: 2 * most] if line.strip()][:most]
    if any(b"\0" in line for line in lines[:3]):
        return []
    return [line.decode("utf-8", errors="replace").rstrip("\r") for line in lines]


def bad_line(path: Path, line: Line, message: str, expected: str, column: int = 1) -> BadInput:
    """The refusal of one line."""
    return refuse(
        path,
        message,
        line=line.number,
        column=column,
        expected=expected,
        found=repr(line.text.strip()[:60]),
    )
