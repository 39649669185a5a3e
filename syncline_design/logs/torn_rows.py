"""Whether the last row of a file, which no line end closes, was cut off within its last cell.

What is left of a figure is one as well, of fewer digits: the rows above tell how many are due.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

from syncline_design.logs.cells import ISO, NOTHING
from syncline_design.logs.delimited import Dialect, split_line

_TAIL_BYTES: Final = 1 << 16
_LEAST: Final = 100  # rows above, of which a whole figure hardly has the fewest digits by chance
_ALIKE: Final = 24  # all of one length: of figures without their last zeros some are shorter
_WHOLE: Final = 8  # rows, where the whole part of a figure falls by far more than it ever moved
_FAR: Final = 8.0  # times as far
_FIGURE: Final = re.compile(r"[+-]?(\d+)(?:[.,](\d*))?")
_POWER: Final = re.compile(r"[+-]?\d+(?:[.,]\d*)?[eE][+-]?\d+")
_DATE: Final = re.compile(ISO)


def is_cut(path: Path, how: Dialect, at: int, last: str) -> bool:
    """Whether a last line lacks cells or the end of its last one; at: where it begins."""
    cells = split_line(last, how.separator)
    if len(cells) < len(how.names) or cells[-1].strip() in NOTHING or _stops(cells[-1]):
        return True
    return _lacks_digits(cells[-1].strip(), _last_cells(path, how, at))


def _last_cells(path: Path, how: Dialect, end: int) -> list[str]:
    """Of the rows before `end`, those of the last part of a file."""
    begin = max(how.body, end - _TAIL_BYTES)
    with path.open("rb") as file:
        file.seek(begin)
        lines = file.read(end - begin).decode("utf-8", errors="replace").splitlines()
    whole = lines if begin == how.body else lines[1:]
    rows = [split_line(line, how.separator) for line in whole if line.strip()[:1] not in ("", "#")]
    cells = [row[-1].strip() for row in rows if len(row) == len(how.names)]
    return [cell for cell in cells if cell not in NOTHING]


def _lacks_digits(cell: str, above: Sequence[str]) -> bool:
    """Whether a cell is shorter than every one above it, of as many as none of its kind is."""
    alike = len(above) >= _ALIKE
    for kind in (_DATE, _POWER):
        if all(kind.fullmatch(other) for other in above):  # of one length, where all are written so
            one_length = alike and len({len(other) for other in above}) == 1
            return one_length and len(cell) < len(above[0])
    found, others = _FIGURE.fullmatch(cell), [_FIGURE.fullmatch(other) for other in above]
    if found is None or not all(others):
        return False
    wholes = [int(one[1]) for one in others if one]
    if found[2] is None and _fell_short(int(found[1]), wholes):
        return True
    lengths = {len(one[2] or "") for one in others if one}
    told = len(above) >= _LEAST or (alike and len(lengths) == 1)
    return told and len(found[2] or "") < min(lengths, default=0)


def _fell_short(figure: int, above: Sequence[int]) -> bool:
    """Whether a whole number is far from the one above, and with the digits that it has fewer is
    as near to it as these are to one another."""
    far = len(above) >= _WHOLE and above[-1] - figure > _FAR * (max(above) - min(above))
    if len(above) < _LEAST and not far:
        return False
    missing = min(len(str(one)) for one in above) - len(str(figure))
    step = max(abs(b - a) for a, b in pairwise(above))
    if missing < 1 or abs(figure - above[-1]) <= step:
        return False
    first, last = (int(f"{figure}{digit * missing}") for digit in "09")
    return first <= above[-1] + step and last >= above[-1] - step


def _stops(cell: str) -> bool:
    """Whether a cell stops within a number: `-`, `1e`, `1.5e-`."""
    text = cell.strip().replace(",", ".")
    try:
        float(text)
    except ValueError:
        if text[-1:] in "+-eE.":
            try:
                float(text + "0")
            except ValueError:
                return False
            return True
    return False
