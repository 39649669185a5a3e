"""One log that is given twice is one log: a path named again, or a copy of its content."""

from __future__ import annotations

import filecmp
import itertools
from collections.abc import Sequence
from pathlib import Path

from syncline_design.logs.refusals import refuse


def demand_once(paths: Sequence[Path]) -> None:
    """Raises BadInput where a file is given a second time, under its name or another."""
    for one, other in itertools.combinations(paths, 2):
        if _is_same(one, other):
            named = "" if one == other else f", the same content as {one.name}"
            raise refuse(
                other,
                "the same log is given twice",
                expected="each log once",
                found=f"{other.name}{named}",
                hint="leave one of them out",
            )


def _is_same(one: Path, other: Path) -> bool:
    if one.absolute() == other.absolute():
        return True
    if not (one.is_file() and other.is_file()):
        return False
    size = one.stat().st_size
    return size > 0 and size == other.stat().st_size and filecmp.cmp(one, other, shallow=False)
