"""Which timeline stamps can be on, by their size alone."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

import numpy as np

from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Timeline
from syncline_design.model.figure_text import to_places

SECOND: Final = 1_000_000_000
EARLIEST_NS: Final = 946_684_800 * SECOND  # 2000-01-01: no log that people still have is older
LATEST_NS: Final = 4_102_444_800 * SECOND  # 2100-01-01
LONGEST_BOOT_NS: Final = 10 * 366 * 86_400 * SECOND
LEAST_SPAN_NS: Final = SECOND // 100  # what counts up by less from first to last are counts


def timeline_of(stamps: Nanoseconds, claimed: Timeline) -> tuple[Timeline, tuple[str, ...]]:
    """The claimed calendar's timeline where the values are of this century; else what they show.

    Judged by the median of the stamps that are set, so that a few wild ones change nothing.
    """
    known = stamps[(stamps != UNSET) & (stamps != 0)]
    if not known.shape[0]:
        return "unknown", ("no stamp is set",) if stamps.shape[0] else ()
    middle = int(np.median(known))
    if EARLIEST_NS <= middle <= LATEST_NS:
        return claimed, ()
    low, high = int(known.min()), int(known.max())
    if 0 <= middle < LONGEST_BOOT_NS:
        if known.shape[0] > 2 and high - low < LEAST_SPAN_NS:
            return "unknown", (f"stamps of {low} to {high} ns are counts, not times",)
        return "boot", (
            f"stamps begin at {to_places(low / SECOND, 6)} s: since boot or a start, no calendar",
        )
    return "unknown", (f"stamps of {low} to {high} ns are no times of this century",)


def calendar(nanoseconds: int) -> str:
    """A moment as ISO 8601 with all its nanoseconds."""
    seconds, rest = divmod(nanoseconds, SECOND)
    try:
        day = datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, ValueError, OSError):
        return f"{nanoseconds} ns"
    return f"{day:%Y-%m-%dT%H:%M:%S}.{rest:09d}"
