"""Which runs that are unlike the others stand alone, and which have what a change brought.

A run that is unlike most others is one odd run, or one of several that something changed: the first
of the new state, or the last of the old one.  Of the effects C in which it differs, what a change
in the runs from k to before m explains is, with T and t the information and score of those runs, S
and g of all (`changes`),
    W = T_CC - T_C S^-1 T_C',   u = t_C - T_C S^-1 g,   u' W^-1 u / 2   [nat].
The run alone is one such span; all that begin or end with it, or have it and the first or last of
the runs, are held against that, and so is the likeliest change of any one effect.  What explains
most is taken off (an odd run left out), and what is unlike the others still is looked at anew, so
that neither a change makes runs odd nor an odd run changes.  Names do not count: of one change the
first run may show a latency, the next a drift.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.freed_runs import pseudo_inverse
from syncline_design.campaign.pool import Index, inverted
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.strangers import Departure, Stranger, departures_of, limit_of, part_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

CLEARLY_NATS: Final = 2.0  # by which a run alone explains more than any change that it is one of
MORE_ROUNDS: Final = 4  # changes that are taken off beside the strange runs


@dataclass(frozen=True, slots=True)
class StandingAlone:
    """alone: places of runs that stand alone between others.  strange: those and what the ends of
    the runs have, which no change of several runs explains."""

    alone: tuple[int, ...]
    strange: tuple[Stranger, ...]


@dataclass(frozen=True, eq=False)
class Span:
    """A change from one run to before another: what it explains [nat], and its values."""

    first: int
    end: int
    gain: float
    index: Index
    values: Array


def standing(changes: Changes, strange: Sequence[Stranger]) -> StandingAlone:
    """Strange runs parted into those that stand alone and those that a change explains."""
    left, last, limit = changes, changes.pool.count - 1, limit_of(changes)
    rows = np.arange(changes.pool.count)
    still, kept = list(strange), list[Stranger]()
    for _ in range(len(strange) + MORE_ROUNDS):
        if not still:
            break
        spans = [_explaining(left, int(np.flatnonzero(rows == one.run)[0]), one) for one in still]
        span = max(spans, key=lambda one: one.gain)
        change = _changed(left)
        as_change = change is not None and _explained(left, change) > span.gain
        ends = (change.k, len(rows)) if change is not None and as_change else (span.first, span.end)
        drifts = change is not None and as_change and change.trend.kind == "drift"
        lone = None if drifts else _lone(ends, len(rows))
        one = None if lone is None else next((s for s in still if s.run == rows[lone]), None)
        if one is not None and lone is not None:
            kept.append(one)
            stays = np.delete(np.arange(len(rows)), lone)
            rows, left = rows[stays], part_of(left, stays)
            still.remove(one)
        elif change is not None and as_change:
            left = left.without(change)
        else:
            left = _less(left, span)
        still = list(_still(left, rows, still, limit))
    kept = sorted([*kept, *still], key=lambda one: one.run)
    return StandingAlone(tuple(one.run for one in kept if 0 < one.run < last), tuple(kept))


def _lone(ends: tuple[int, int], count: int) -> int | None:
    """The one run that has a change, or the first where all but it have; None where several do."""
    first, end = ends
    if end - first == 1:
        return first
    return 0 if (first, end) == (1, count) else None


def _changed(changes: Changes) -> Change | None:
    """The likeliest change of one effect from one run on, whatever runs are strange in, by the
    noise fitted; None where no change is likelier."""
    return changes.likeliest(changes.pool.count)


def _explained(changes: Changes, change: Change) -> float:
    """What a change explains [nat], by the noise fitted, as spans do."""
    pool, index = changes.pool, change.term.index
    over = change.trend.over(pool.count)
    across = np.tensordot(over, pool.normal[:, index], axes=1)
    kept = across @ pseudo_inverse(changes.total(pool.count, pool.normal, pool.score))
    own = np.tensordot(np.square(over), pool.normal[:, index[:, None], index], axes=1)
    score = over @ pool.score[:, index] - kept @ pool.score.sum(axis=0)
    return 0.5 * float(score @ inverted(own - kept @ across.T) @ score)


def _explaining(changes: Changes, at: int, one: Stranger) -> Span:
    """The span that explains a run best: itself only where no longer one does as well."""
    index = np.concatenate([d.term.index for d in one.departures])
    spans = _spans(at, changes.pool.count)
    normal, score = _freed(changes, index, spans)
    inverse = inverted(normal)
    values = np.einsum("sab,sb->sa", inverse, score)
    gains = 0.5 * np.einsum("sa,sa->s", values, score)
    own = next(k for k, span in enumerate(spans) if span == (at, at + 1))
    longer = np.where(np.arange(len(spans)) == own, -math.inf, gains)
    best = int(np.argmax(longer))
    if gains[own] > longer[best] + CLEARLY_NATS or len(spans) == 1:
        best = own
    return Span(*spans[best], float(gains[best]), index, values[best])


def _spans(at: int, count: int) -> list[tuple[int, int]]:
    """Spans (first, end) of runs with a change, that has the run `at` at one of its ends or lasts
    from the first run on or to the last."""
    found = {(at, end) for end in range(at + 1, count + 1)}
    found |= {(first, at + 1) for first in range(at + 1)}
    found |= {(first, count) for first in range(at + 1)}
    found |= {(0, end) for end in range(at + 1, count + 1)}
    return sorted(found - {(0, count)})  # which is no change


def _freed(changes: Changes, index: Index, spans: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
    """W (S, c, c) and u (S, c) of every span."""
    pool = changes.pool
    inverse = pseudo_inverse(changes.total(pool.count, pool.normal, pool.score))
    first, end = np.array(spans).T
    normals, scores = _summed(pool.normal[:, index]), _summed(pool.score)
    across = normals[end] - normals[first]
    moved = (scores[end] - scores[first])[:, index]
    kept = across @ inverse
    normal = across[:, :, index] - kept @ np.swapaxes(across, 1, 2)
    return normal, moved - kept @ scores[-1]


def _summed(values: Array) -> Array:
    """Sums of the first n runs, n from 0."""
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])


def _less(changes: Changes, span: Span) -> Changes:
    """The same runs with a change taken off those that have it."""
    score, own = changes.pool.score.copy(), slice(span.first, span.end)
    score[own] -= changes.pool.normal[own][:, :, span.index] @ span.values
    found = Changes(replace(changes.pool, score=score))
    found.__dict__["within"] = changes.within  # the scatter inside runs is what it was
    return found


def _still(
    changes: Changes, rows: Index, strange: Sequence[Stranger], limit: float
) -> Iterator[Stranger]:
    """What is unlike the others yet, each held against those that are not strange."""
    odd = [one.run for one in strange]
    for one in strange:
        stays = np.array([k for k, run in enumerate(rows) if run == one.run or run not in odd])
        if len(stays) < 2:
            continue
        at = int(np.flatnonzero(rows[stays] == one.run)[0])
        found: tuple[Departure, ...] = departures_of(part_of(changes, stays), at, limit)
        if found:
            yield replace(one, departures=found)
