"""Figures that tests ask for again and again, drawn once a process: drawing is most of a page.

For tests of what pages say; where the drawing itself is asked about, clear what is kept before.
"""

from __future__ import annotations

import importlib
import pickle
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from syncline_design import report
from syncline_design.report import svg

Kept = dict[bytes, svg.InlineChart]
KEPT: Kept = {}


def kept() -> Iterator[Kept]:
    """What was drawn, by all that it is drawn from, while `draw` looks there first."""
    drawn = svg.draw

    def draw(*asked: Any) -> svg.InlineChart:
        key = _key(asked)
        if key is None:
            return drawn(*asked)
        if key not in KEPT:
            KEPT[key] = drawn(*asked)
        return KEPT[key]

    with pytest.MonkeyPatch.context() as patched:
        for found in pkgutil.walk_packages(report.__path__, f"{report.__name__}."):
            module = importlib.import_module(found.name)
            if getattr(module, "draw", None) is drawn:
                patched.setattr(module, "draw", draw)
        yield KEPT


def _key(asked: tuple[Any, ...]) -> bytes | None:
    """Name, texts, size and maker as bytes; None where the maker holds what cannot be told so."""
    *said, build = asked
    try:
        return pickle.dumps((said, _made_of(build)))
    except (pickle.PicklingError, AttributeError, TypeError):
        return None


def _made_of(build: Callable[..., Any]) -> tuple[Any, ...]:
    """Where a function is written, and what it was given by those around it."""
    cells = [cell.cell_contents for cell in build.__closure__ or ()]
    given = (*cells, build.__defaults__, build.__kwdefaults__)
    inner = [_made_of(one) if hasattr(one, "__code__") else one for one in given]
    return build.__code__.co_filename, build.__code__.co_firstlineno, inner
