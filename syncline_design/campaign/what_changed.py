"""What runs say that changed: which effects, each with which trend (`possible_changes`).

The likeliest change is told first, and another where it is as clear as an alarm, or as an effect of
a day on which something changed already.  After each, every one of them is held against whatever
could be in its place: another effect, another trend, or two instead of one.  So what two make
together (a boresight and a range bias that moved on one day) is not told as a third, nor a drift
that ended as a slower one that goes on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.possible_changes import PossibleChange, PossibleChanges
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.trends import Trend, trends
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, commonness
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

INSTEAD_NATS: Final = 3.0  # by which two in the place of one, or of scatter, explain more
MOST_CHANGES: Final = 8
ROUNDS: Final = 2
MOST_TRIED: Final = 60  # likeliest firsts of two that are tried in the place of one
MOST_MOVES: Final = 12
MOST_LATER: Final = 4  # runs by which a drift that ended may have begun later than one that goes on
MOST_ENDS: Final = 12


@dataclass(frozen=True, slots=True)
class Taken:
    """A change, and log of the evidence by which it was taken."""

    one: PossibleChange
    log_evidence: float


def what_changed(changes: Changes, first: int, threshold: float) -> tuple[Taken, ...]:
    """Changes of runs of which the look after `first` of them rang; one that went back is told as
    it was then where nothing is now."""
    look = changes.pool.count
    found: list[PossibleChange] = []
    fitted: list[Change] = []
    evidence: list[float] = []
    had: set[frozenset[PossibleChange]] = set()
    while len(found) < MOST_CHANGES and frozenset(found) not in had:
        had.add(frozenset(found))
        state, at, only = _beside(changes, fitted), look, None
        total = state.log_evidence(at)[0]
        if not found and total < threshold and (passed := _passed(changes, (), threshold)):
            return passed
        if not found and total < threshold:  # an alarm stays, by what it rang with
            total = state.log_evidence(first)[0]
            at = look if changes.gains(look).max() >= threshold else first
        elif found and total < threshold:
            only = {one.trend for one in found}
            total = state.of_one_day(at, [trends(at).index(one.begun) for one in only])
            if total < threshold:
                break
        one = _next(changes, fitted, found, at, only)
        found, evidence = [*found, one], [*evidence, total]
        if at == look:  # one in the place of two may call for the second of them again: `had`
            found = _held_against_others(changes, _fits(changes, fitted, found, look), found)
            evidence = [*evidence, *[total] * len(found)][: len(found)]
        fitted = _fits(changes, fitted, found, look)
    taken = tuple(Taken(*pair) for pair in zip(found, evidence, strict=True))
    return (*taken, *_passed(changes, fitted, threshold))[:MOST_CHANGES]


def _passed(
    changes: Changes, fitted: Sequence[Change], threshold: float
) -> tuple[Taken, Taken] | tuple[()]:
    """What some runs on end have besides what was found, or one run, and what undid it; nothing
    where that may be scatter as well."""
    look = changes.pool.count
    one = changes.without(*fitted).passed(look)
    if one is None or one.log_factor < threshold or one.trend.until is None:
        return ()
    place = [term.label for term in changes.terms].index(one.term.label)
    begun, undone = (PossibleChange(place, Trend("step", k)) for k in (one.k, one.trend.until))
    return Taken(begun, one.log_factor), Taken(undone, one.log_factor)


def _beside(changes: Changes, fitted: Sequence[Change]) -> Changes:
    """Runs less what was found, what is left of it free."""
    for one in fitted:
        changes = changes.taking(one)
    return changes


def _next(
    changes: Changes,
    fitted: Sequence[Change],
    found: Sequence[PossibleChange],
    at: int,
    only: set[Trend] | None,
) -> PossibleChange:
    """The likeliest change beside those that are known, of some trends alone where these are."""
    if not found:
        return commonest(changes, trends(at), changes.gains(at))
    possible = possible_beside(changes, fitted, at)
    gains = possible.gains(found)
    if only is not None:
        gains[[one not in only for one in possible.trends]] = -math.inf
    return commonest(changes, possible.trends, gains)


def _fits(
    changes: Changes,
    before: Sequence[Change],
    found: Sequence[PossibleChange],
    look: int,
) -> list[Change]:
    """What was found, fitted together; before: as it was known, the constants told without it."""
    known = {(one.term.label, one.trend): one for one in before}
    labels = [(changes.terms[one.effect].label, one.trend) for one in found]
    first = [known.get(label) or changes.single(look, one.effect, one.trend.begun)
             for label, one in zip(labels, found, strict=True)]  # fmt: skip
    for _ in range(ROUNDS):
        off, needed = tuple(first), tuple(one.trend for one in found)
        first = PossibleChanges(changes, look, (), off, needed).values(found)
    return first


def _held_against_others(
    changes: Changes, fitted: Sequence[Change], found: Sequence[PossibleChange]
) -> list[PossibleChange]:
    """What was found, refined.

    Where a trend stands for two (a drift that ended), what it leaves looks like an effect that
    differs from run to run; free in every run, that would hide the two.  So they are tried without
    it, and taken where nothing that differs is left and the runs are likelier so.
    """
    look = changes.pool.count
    usual = possible_beside(changes, fitted, look)
    beside = refined(usual, found)
    if not usual.freed:
        return beside
    plain = refined(replace(usual, freed=()), found)
    fits = [_fits(changes, fitted, ones, look) for ones in (plain, beside)]
    if len(plain) > len(found) + 1 or changes.without(*fits[0]).compared(look).freed:
        return beside
    sums = [_log_odds(usual, ones, fit) for ones, fit in zip((plain, beside), fits, strict=True)]
    scatter = changes.without(*fits[1]).log_odds_of_any(look)
    return plain if sums[0] > sums[1] + scatter + INSTEAD_NATS else beside


def _log_odds(
    possible: PossibleChanges, ones: Sequence[PossibleChange], fitted: Sequence[Change]
) -> float:
    """log of the odds of a set of changes against none where nothing differs from run to run, over
    all their sizes; of a day and its trend the weight counts once."""
    changes, noise = possible.changes, possible.noise
    days = sum(possible.weight_of(trend) for trend in {one.trend for one in ones})
    sizes = sum(changes.log_of_sizes(one, noise, possible.look) for one in fitted)
    weights = sum(float(changes.log_weights[one.effect]) for one in ones)
    return changes.explained(possible.look, fitted) / noise + sizes + weights + days


def possible_beside(changes: Changes, fitted: Sequence[Change], look: int) -> PossibleChanges:
    """What could have changed; effects are free in every run that differ from one to the next where
    what was found is taken off: clearly, or rather than that anything else changed."""
    return possible_of(changes, changes.without(*fitted), fitted, look)


def possible_of(
    changes: Changes, left: Changes, fitted: Sequence[Change], look: int
) -> PossibleChanges:
    """The same; left: the runs without what was found."""
    needed = tuple(one.trend for one in fitted)
    rather = left.differs_rather(look)
    freed = (*left.compared(look).freed, *(() if rather is None else (rather,)))
    return PossibleChanges(changes, look, freed, tuple(fitted), needed)


def commonest(changes: Changes, known: Sequence[Trend], gains: Array) -> PossibleChange:
    """The likeliest change; of those that are as good, the commonest."""
    each = gains.max(axis=0)
    close = np.flatnonzero(each >= each.max() - AS_GOOD_NATS)
    c = min(map(int, close), key=lambda k: (commonness(changes.terms[k].label), -each[k]))
    return PossibleChange(c, known[int(np.argmax(gains[:, c]))])


def refined(possible: PossibleChanges, found: Sequence[PossibleChange]) -> list[PossibleChange]:
    """The same, each held against what could be in its place."""
    kept = list(found)
    for _ in range(MOST_MOVES):
        possible = possible.knowing(kept)
        moves = [move for k in range(len(kept)) for move in _instead(possible, kept, k)]
        moves += [*_one_for_two(possible, kept), *_ended(possible, kept)]
        better = [move for move in moves if len(move[1]) <= MOST_CHANGES]
        if not better:
            break
        kept = max(better, key=lambda move: move[0])[1]
    return _named(possible.knowing(kept), kept)


def _named(possible: PossibleChanges, found: Sequence[PossibleChange]) -> list[PossibleChange]:
    """The same, each by the commonest effect that does as well in its place with its trend."""
    kept, terms = list(found), possible.changes.terms
    for k, one in enumerate(kept):
        row = possible.trends.index(one.trend)
        gains = possible.gains([*kept[:k], *kept[k + 1 :]])[row]
        close = np.flatnonzero(gains >= gains[one.effect] - AS_GOOD_NATS)
        best = min(map(int, close), key=lambda c: (commonness(terms[c].label), -gains[c]))
        kept[k] = replace(one, effect=best)
    return kept


def _instead(
    possible: PossibleChanges, found: Sequence[PossibleChange], k: int
) -> Iterator[tuple[float, list[PossibleChange]]]:
    """Sets with another change, or two, in the place of one, that explain more, and by how much."""
    rest = [one for at, one in enumerate(found) if at != k]
    gains = possible.gains(rest)
    own = float(gains[possible.trends.index(found[k].trend), found[k].effect])
    if float(gains.max()) > own + AS_GOOD_NATS:
        one = commonest(possible.changes, possible.trends, gains)
        yield float(gains.max()) - own, [*rest, one]
    for row, c in itertools.islice(_likeliest(gains), MOST_TRIED):
        first = PossibleChange(c, possible.trends[row])
        second = possible.gains([*rest, first])
        both = float(gains[row, c] + second.max()) - INSTEAD_NATS
        if both > own + AS_GOOD_NATS:
            yield both - own, [*rest, first, commonest(possible.changes, possible.trends, second)]


def _one_for_two(
    possible: PossibleChanges, found: Sequence[PossibleChange]
) -> Iterator[tuple[float, list[PossibleChange]]]:
    """Sets with one change in the place of two that explain no more than it."""
    for a, b in itertools.combinations(range(len(found)), 2):
        rest = [one for at, one in enumerate(found) if at not in (a, b)]
        gains = possible.gains(rest)
        row = possible.trends.index
        both = gains[row(found[a].trend), found[a].effect]
        beside = possible.gains([*rest, found[a]])
        both += beside[row(found[b].trend), found[b].effect]
        if float(gains.max()) >= float(both):
            one = commonest(possible.changes, possible.trends, gains)
            yield float(gains.max() - both), [*rest, one]


def _ended(
    possible: PossibleChanges, found: Sequence[PossibleChange]
) -> Iterator[tuple[float, list[PossibleChange]]]:
    """Sets in which a drift ended."""
    for k, one in enumerate(found):
        if one.trend.kind != "drift":
            continue
        first = one.trend.k
        ends = [
            Trend("drift", begun, until)
            for begun in range(max(first - 1, 1), min(first + MOST_LATER, possible.look - 2))
            for until in _spread(begun + 2, possible.look)
        ]
        needed = (*(other.trend for other in found), *ends)
        narrow = replace(possible, needed=needed, only=True)
        gains = narrow.gains([other for at, other in enumerate(found) if at != k])[:, one.effect]
        own, best = gains[narrow.trends.index(one.trend)], int(np.argmax(gains))
        trend = narrow.trends[best]
        if trend.until is not None and gains[best] > own + AS_GOOD_NATS:
            yield float(gains[best] - own), [*found[:k], replace(one, trend=trend), *found[k + 1 :]]


def _spread(first: int, end: int) -> Iterator[int]:
    """Places from the first to before the end, so many at most."""
    yield from dict.fromkeys(map(int, np.linspace(first, end - 1, MOST_ENDS).round()))


def _likeliest(gains: Array) -> Iterator[tuple[int, int]]:
    for place in np.argsort(-gains, axis=None):
        row, c = np.unravel_index(int(place), gains.shape)
        yield int(row), int(c)
