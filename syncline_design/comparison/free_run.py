"""Whether logs of a clock show what it does without a reference, where its figure is for that."""

from __future__ import annotations

from datetime import datetime
from typing import Final

from syncline_design.clocks.result import EventResult, Timing
from syncline_design.model.figure_text import format_duration

_WITHOUT_A_REFERENCE: Final = ("unlock", "holdover", "gap")
_ALMOST: Final = 0.99  # of the time: the moments of a log are whole seconds, some rows apart


def no_free_run(holdover_s: float, found: Timing) -> str:
    """Why these logs do not bear out what a clock drifts in holdover; "" where they do.

    In lock a clock is steered: its drift is in none of its offsets, whatever it is.  A claim is
    over sessions, so that each of them has to hold a free run as long as the one that is assumed;
    what the clock was off by at its end is in `event_bound_s`.
    """
    counted = {k for k, session in enumerate(found.sessions) if session.counted}
    free = {one.session for one in found.events if _lasts_s(one) >= _ALMOST * holdover_s}
    if counted and counted <= free:
        return ""
    asked, seen = format_duration(holdover_s), len(counted & free)
    of = f"{seen} of {len(counted)} sessions" if seen else "no session"
    return (f", but that figure is of {asked} without a reference, which {of} shows: in lock a "
            "clock is steered, and its drift does not show; a log of each start that goes on "
            f"through {asked} without lock, until the reference is back, would bear it out"
            )  # fmt: skip


def _lasts_s(event: EventResult) -> float:
    """How long a clock was without its reference [s]; 0 of other events."""
    if event.kind not in _WITHOUT_A_REFERENCE:
        return 0.0
    return _seconds(event.to) - _seconds(event.from_)


def _seconds(moment: str) -> float:
    """Of ISO 8601, or of seconds since start, as `moment` writes them."""
    number, _, unit = moment.partition(" ")
    return float(number) if unit else datetime.fromisoformat(moment).timestamp()
