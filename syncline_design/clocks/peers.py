"""What ntpd's loop and the peers that it follows say of one clock: a bound, or two offsets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.clocks.ntpd import LOOPSTATS, PEERSTATS
from syncline_design.clocks.series import Array, ClockSeries
from syncline_design.model.figure_text import format_duration, rounded

LAST_POLLS: Final = 10.0  # polls that a peer's bound is taken to last
POLLED_TOGETHER_S: Final = 1.0  # a poll's line in peerstats and in loopstats are of one moment
_FEWEST: Final = 20  # polls of both


def bounded_by_peers(series: Sequence[ClockSeries]) -> list[ClockSeries]:
    """Loopstats with the bound of the peers that ntpd selected at the time.

    loopstats hold neither delays nor dispersions; peerstats of the same daemon do.  Of several
    selected peers the largest bound counts, which is no smaller than that of whichever steered.
    """
    peers = _selected(series)
    return [_with_bound(s, peers) if s.kind == LOOPSTATS and peers else s for s in series]


def _with_bound(loop: ClockSeries, peers: Sequence[ClockSeries]) -> ClockSeries:
    bounds = np.array([_last_bound(peer, loop.time_s) for peer in peers])
    known = np.any(np.isfinite(bounds), axis=0)
    hard = np.max(np.where(np.isfinite(bounds), bounds, 0.0), axis=0)
    hard = np.maximum(hard, np.abs(loop.offset_s))
    return replace(loop, hard_s=np.where(known, hard, np.nan))


def _last_bound(peer: ClockSeries, time_s: Array) -> Array:
    """A peer's bound at its last poll before each moment, where that is not long ago."""
    order = np.argsort(peer.time_s, kind="stable")
    polled, hard = peer.time_s[order], peer.hard_s[order]
    last = np.searchsorted(polled, time_s + POLLED_TOGETHER_S, side="right") - 1
    reach = LAST_POLLS * float(np.median(np.diff(polled))) if len(polled) > 1 else 0.0
    heard = (last >= 0) & (time_s - polled[np.maximum(last, 0)] <= max(reach, 1.0))
    bound: Array = np.where(heard, hard[np.maximum(last, 0)], np.nan)
    return bound


def _selected(series: Sequence[ClockSeries]) -> list[ClockSeries]:
    found = [s for s in series if s.kind.reference and s.kind.reference in s.references]
    return [s for s in found if s.kind.name.startswith(PEERSTATS)]


def unlike_their_peers(
    loops: Sequence[ClockSeries], series: Sequence[ClockSeries]
) -> Iterator[str]:
    """Selected peers whose offsets are further from the loop's, as a rule, than half the round trip
    and the dispersion allow: one of both is not this clock's."""
    for peer in _selected(series):
        told = [pair for loop in loops if len(pair := _together(loop, peer))]
        both = np.concatenate(told) if told else np.zeros((0, 2))
        if len(both) < _FEWEST or float(np.median(both[:, 0] - both[:, 1])) <= 0.0:
            continue
        apart, allowed = (format_duration(float(rounded(np.median(k), 2))) for k in both.T)
        yield (f"{peer.kind.name}: the selected peer is {apart} from what loopstats say at the "
               "same polls, where half the round trip and the dispersion allow "
               f"{allowed}: is the loop that of another clock, or its peer wrong?")  # fmt: skip


def _together(loop: ClockSeries, peer: ClockSeries) -> Array:
    """Of polls that both tell of: how far their offsets are apart, and what the path allows."""
    if not len(peer):
        return np.zeros((0, 2))
    order = np.argsort(peer.time_s, kind="stable")
    times, offsets, hard = (x[order] for x in (peer.time_s, peer.offset_s, peer.hard_s))
    near = np.clip(np.searchsorted(times, loop.time_s + POLLED_TOGETHER_S, side="right") - 1,
                   0, len(times) - 1)  # fmt: skip
    same = np.abs(times[near] - loop.time_s) <= POLLED_TOGETHER_S
    apart = np.abs(offsets[near] - loop.offset_s)
    both: Array = np.column_stack([apart, hard[near] - np.abs(offsets[near])])[same]
    return both[np.all(np.isfinite(both), axis=1)]
