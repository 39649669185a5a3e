"""Lines of text in blocks of bounded size, each with its number, and what is said of damaged ones.

A damaged line (cut and joined to the next one, a block of NUL that a power cut left, no figures)
costs itself, not its file: it is left out, counted, and said.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.sentences import left_out
from syncline_design.spec.load import BadInput

BLOCK = 1 << 20
MOST_LINE = 1 << 16
BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class Line:
    """A line without its end; whole: whether an end closed it; flaw: why it is no text."""

    number: int
    text: str
    whole: bool = True
    flaw: str = ""


class BadLineError(ValueError):
    """A line that is no row of its format: what is wrong, and what a row would be."""

    def __init__(self, message: str, expected: str) -> None:
        super().__init__(message)
        self.message, self.expected = message, expected


@dataclass(slots=True)
class Damage:
    """The lines of one pass that were left out."""

    count: int = 0
    first: Line | None = None
    error: BadLineError | None = None
    cut: str = ""  # the last line, where no end closed it

    def add(self, line: Line, error: BadLineError) -> None:
        self.count += 1
        if self.first is None:
            self.first, self.error = line, error

    def said(self) -> str:
        """For people; empty where every line was read."""
        parts = []
        if self.first is not None and self.error is not None:
            parts.append(left_out(self.count, self.first.number, self.error.message))
        if self.cut:
            parts.append(f"the last line is cut: {self.cut[:40]!r}")
        return "; ".join(parts)

    def refusal(self, path: Path, nothing: str, expected: str) -> BadInput:
        """Of a file without a good line: its first damaged one, else that nothing is in it."""
        if self.first is None or self.error is None:
            return refuse(path, nothing, expected=expected)
        return refuse(
            path,
            self.error.message,
            line=self.first.number,
            column=1,
            expected=self.error.expected,
            found=repr(self.first.text.strip()[:60]),
        )


def usual_width(widths: Sequence[int], stated: int = 0) -> int:
    """How many cells the rows of a file have: most of them, of equally many the header's, the most.

    stated: what the header says; 0 where neither it nor a row tells.
    """
    if not widths:
        return 0
    counted = Counter(widths)
    return max(counted, key=lambda width: (counted[width], width == stated, width))


def line_blocks(path: Path) -> Iterator[list[Line]]:
    """All lines that are not blank, some thousand at a time; of one too long only its beginning."""
    number, rest = 0, b""
    with path.open("rb") as file:
        while True:
            raw = file.read(BLOCK)
            held = rest + raw
            if number == 0:
                held = held.removeprefix(BOM)
            parts = held.split(b"\n")
            rest = parts.pop()[: MOST_LINE + 1] if raw else b""
            last = not raw
            found = []
            for k, part in enumerate(parts):
                number += 1
                if part.strip():
                    found.append(_line(number, part, not (last and k == len(parts) - 1)))
            if found:
                yield found
            if last:
                return


def _line(number: int, raw: bytes, whole: bool) -> Line:
    flaw = ""
    if len(raw) > MOST_LINE:
        flaw = f"a line longer than {MOST_LINE >> 10} KiB"
        raw = raw[:MOST_LINE]
    elif b"\0" in raw:
        flaw = "not text: NUL"
    return Line(number, raw.decode("utf-8", errors="replace").rstrip("\r"), whole, flaw)


def demand_text(line: Line) -> None:
    """BadLineError where a line is none of text."""
    if line.flaw:
        raise BadLineError(line.flaw, "lines of text")


def head_lines(start: bytes, most: int = 200) -> list[str]:
    """The first whole lines of a file that are text and not blank; none where most are no text."""
    start = start.removeprefix(BOM)
    whole = start[: start.rfind(b"\n") + 1] or start
    lines = [line for line in whole.split(b"\n")[: 2 * most] if line.strip()][:most]
    text = [line for line in lines if b"\0" not in line]
    if 2 * len(text) <= len(lines):
        return []
    return [line.decode("utf-8", errors="replace").rstrip("\r") for line in text]
