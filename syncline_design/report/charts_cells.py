"""Cells of a map too fine for words: one path for all that look alike, hatched where none meets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import numbers
from syncline_design.report.palette import BAD, INK, MUTED, SERIES, WARN
from syncline_design.report.study_words import COMBINED
from syncline_design.studies.summary import CellWord

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
    from matplotlib.path import Path

UNDER: Final = 0.12  # opacity under a hatch
MOST_BESIDE: Final = 22  # characters of a label with another beside it, that a phone holds
_HATCHED: Final[Mapping[CellWord, tuple[str, str, str]]] = {  # colour, hatch, words
    "none": (BAD, "////", "no case meets"),
    "undecided": (WARN, "----", "no verdict"),
    "refused": (MUTED, "||", COMBINED),
    "waived": (INK, "...", "waived"),
}


@dataclass(frozen=True, slots=True)
class CellLook:
    """What cells that look alike have in common; strength: opacity of their cost's colour."""

    word: CellWord
    strength: float | None


Cells = Mapping[CellLook, list[tuple[int, int]]]  # of each look: columns and rows


def draw_cells(axes: Axes, cells: Cells) -> None:
    """Draw them, each look in one path: as many elements as looks, whatever the number of cells."""
    for look, places in cells.items():
        for patch in _patches(look, _outline(places)):
            axes.add_patch(patch)


def explain_cells(figure: Figure, cells: Cells) -> None:
    """A legend of the hatches that there are, with the number of cells of each."""
    from matplotlib.path import Path

    box = Path.unit_rectangle()
    handles, words = [], []
    for word, (_, _, said) in _HATCHED.items():
        count = sum(len(places) for look, places in cells.items() if look.word == word)
        if count:
            handles.append(_patches(CellLook(word, None), box)[-1])
            words.append(f"{said} ({numbers.count(count)})")
    if handles:
        columns = 2 if max(map(len, words)) <= MOST_BESIDE else 1
        figure.legend(handles, words, loc="outside lower left", ncols=columns)


def _patches(look: CellLook, outline: Path) -> list[Patch]:
    """The fill of a price, and a hatch where the cells say more than that."""
    from matplotlib.patches import PathPatch

    found: list[Patch] = []
    if look.strength is not None:
        found.append(PathPatch(outline, facecolor=SERIES[0], alpha=look.strength, linewidth=0))
    if look.word in _HATCHED:
        colour, hatch, _ = _HATCHED[look.word]
        if look.word != "waived":
            found.append(PathPatch(outline, facecolor=colour, alpha=UNDER, linewidth=0))
        # of its own: an SVG's hatch over a ground loses how faint that ground is
        found.append(PathPatch(outline, facecolor="none", edgecolor=colour, hatch=hatch,
                               linewidth=0))  # fmt: skip
    return found


def _outline(places: Iterable[tuple[int, int]]) -> Path:
    """One path around cells: neighbours in a row are one rectangle."""
    from matplotlib.path import Path

    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    corners: list[tuple[float, float]] = []
    for left, right, row in _runs(places):
        low, high = row - 0.5, row + 0.5
        corners += [(left, low), (right, low), (right, high), (left, high), (left, low)]
    return Path(corners, codes * (len(corners) // len(codes)))


def _runs(places: Iterable[tuple[int, int]]) -> list[tuple[float, float, int]]:
    """Ends and row of every unbroken run of cells."""
    ordered = sorted((y, x) for x, y in places)
    found = []
    for (row, _), run in groupby(
        enumerate(ordered), lambda item: (item[1][0], item[1][1] - item[0])
    ):
        columns = [x for _, (_, x) in run]
        found.append((columns[0] - 0.5, columns[-1] + 0.5, row))
    return found
