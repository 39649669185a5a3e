"""Moments and spans of time as the outputs write them."""

from __future__ import annotations

from datetime import UTC, datetime

from syncline_design.clocks.series import TimeBase
from syncline_design.model.figure_text import format_quantity, to_places
from syncline_design.model.quantity import Dimension


def moment(time_s: float, stamps: TimeBase) -> str:
    """ISO 8601 in UTC, or seconds since boot where no date is known."""
    if stamps == "boot":
        return f"{to_places(time_s, 3)} s since start"
    try:
        return (
            datetime.fromtimestamp(time_s, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
        )
    except (ValueError, OverflowError, OSError):
        return f"{to_places(time_s, 3)} s"


def shown(time_s: float) -> str:
    """`12 us`."""
    return format_quantity(time_s, Dimension.TIME)
