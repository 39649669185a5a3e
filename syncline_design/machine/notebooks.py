"""What a notebook shows of a result: asked of the result, drawn by whoever said it can."""

from __future__ import annotations

from collections.abc import Callable

_DRAWING: list[Callable[[object], str | None]] = []


def draw_with(draw: Callable[[object], str | None]) -> None:
    """From now on results show themselves so; None: this one has no picture."""
    _DRAWING[:] = [draw]


class Shown:
    """Base of results that a notebook draws."""

    __slots__ = ()

    def _repr_html_(self) -> str | None:
        """The result as HTML, as IPython asks for it; None: it falls back to `repr`."""
        return _DRAWING[0](self) if _DRAWING else None
