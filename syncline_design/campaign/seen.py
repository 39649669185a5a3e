"""Changes of runs as they are told: by how much, since when, and what else it could be."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.pool import Term, inverted
from syncline_design.campaign.possible_changes import (
    RIVAL_NATS,
    PossibleChange,
    PossibleChanges,
)
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.trends import trends
from syncline_design.campaign.what_changed import Taken, possible_beside, possible_of, what_changed
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

CREDIBLE: Final = 0.95
UNDONE: Final = 2.5  # standard uncertainties within which one drift undoes another
ROUNDS: Final = 3


@dataclass(frozen=True, eq=False)
class Seen:
    """A change that was seen: the best, at which look first, how sure, what else it could be.

    dating, dating_now: covariances (p, p) of its values by not knowing the first run that has it,
    and of what it came to by the last run, by not knowing whether it is a step or a drift either.
    """

    change: Change
    low: int
    high: int
    first_look: int
    log_evidence: float
    others: tuple[tuple[Term, float], ...]
    dating: Array
    dating_now: Array


def seen_changes(changes: Changes, first: int, threshold: float) -> tuple[Seen, ...]:
    """What changed in runs of which the look after `first` of them rang: in the order of the runs,
    the strongest of a run first."""
    told = list(what_changed(changes, first, threshold))
    count = changes.pool.count
    while True:
        fitted = _together(changes, [one.one for one in told], count)
        weakest = min(range(len(told)), key=lambda k: _explained(fitted[k]))
        if _explained(fitted[weakest]) >= threshold:
            ones = [one.one for one in told]
            possible = possible_beside(changes, fitted, count).knowing(ones)
            seen = [_seen(possible, told, k, fitted, first) for k in range(len(told))]
            return tuple(sorted(_with_ends(seen), key=lambda one: one.change.k))
        if len(told) == 1:
            return (_went_back(changes, told[0], first),)
        told.pop(weakest)


def _with_ends(seen: Sequence[Seen]) -> list[Seen]:
    """Two drifts of an effect, of which the later undoes the earlier, as one that ended."""
    kept = list(seen)
    for begun, ended in itertools.permutations(seen, 2):
        if begun in kept and ended in kept and _ends(begun.change, ended.change):
            trend = replace(begun.change.trend, until=ended.change.k)
            grown = float(ended.change.k - begun.change.k)
            one = replace(begun, change=replace(begun.change, trend=trend),
                          dating_now=grown**2 * begun.dating)  # fmt: skip
            kept[kept.index(begun)] = one
            kept.remove(ended)
    return kept


def _ends(begun: Change, ended: Change) -> bool:
    same = begun.term.label == ended.term.label and begun.trend.kind == ended.trend.kind == "drift"
    if not same or begun.k >= ended.k:
        return False
    left = begun.values + ended.values
    spread = np.sqrt(np.diag(begun.covariance) + np.diag(ended.covariance))
    return bool(np.all(np.abs(left) <= UNDONE * spread))


def _went_back(changes: Changes, told: Taken, first: int) -> Seen:
    """A change for which by now nothing speaks, as it was when it rang."""
    one = told.one
    look = max(first, one.trend.k + 1)
    best = changes.change(look, trends(look).index(one.trend.begun), one.effect)
    each = np.logaddexp.reduce(changes.gains(look), axis=0)
    others = tuple((changes.terms[i], float(each[one.effect] - each[i])) for i in np.argsort(-each)
                   if i != one.effect and each[i] > each[one.effect] - RIVAL_NATS)  # fmt: skip
    table = changes.likelihoods(look)[:, one.effect]
    near = [(changes.change(look, row, one.effect), share) for row, share in _credible(table)]
    return _dated(near, look, told, best, first, others)


def _seen(
    possible: PossibleChanges, told: Sequence[Taken], k: int, fitted: Sequence[Change], first: int
) -> Seen:
    """One of several, the others free beside it."""
    ones, terms = [one.one for one in told], possible.changes.terms
    others = tuple((terms[i], worse) for i, worse in possible.rivals(ones, k))
    near = _near(possible, ones, k, fitted[k])
    return _dated(near, possible.look, told[k], fitted[k], first, others)


def _near(
    possible: PossibleChanges, ones: Sequence[PossibleChange], k: int, best: Change
) -> list[tuple[Change, float]]:
    """One of several with every trend that it may have, and how likely that is; the constants of
    the runs and what differs in them are told without it, as its size is."""
    rest, effect = [one for at, one in enumerate(ones) if at != k], ones[k].effect
    known, table = possible.trends, possible.gains(rest)[:, effect]
    table = np.where([one.until is None for one in known], table, -np.inf)
    temper = np.trace(best.covariance) / np.trace(possible.values(ones)[k].covariance)
    near = []
    for row, share in _credible(table):
        one = possible.values([*rest, PossibleChange(effect, known[row])])[-1]
        near.append((replace(one, covariance=temper * one.covariance), share))
    return near


def _credible(table: Array) -> list[tuple[int, float]]:
    """Rows by the logs of their odds, and their shares, as many as together are likely enough."""
    share = np.exp(table - np.logaddexp.reduce(table))
    order = np.argsort(-share)
    needed = order[: int(np.searchsorted(np.cumsum(share[order]), CREDIBLE)) + 1]
    return [(int(row), float(share[row])) for row in needed]


def _dated(
    near: Sequence[tuple[Change, float]],
    look: int,
    told: Taken,
    best: Change,
    first: int,
    others: tuple[tuple[Term, float], ...],
) -> Seen:
    """A change with the runs that may be its first."""
    same = [(one, own) for one, own in near if one.trend.kind == best.trend.kind]
    firsts = [one.k for one, _ in near] + [best.k]
    if best.trend.until is not None:  # trends that go on do not date one that ended
        firsts, near, same = [best.k], [], []
    return Seen(
        best, min(firsts), max(firsts), first, told.log_evidence, others,
        _apart(best, same, lambda one: 1.0),
        _apart(best, near, lambda one: float(one.trend.over(look)[-1])),
    )  # fmt: skip


def _apart(
    best: Change, near: Sequence[tuple[Change, float]], grown: Callable[[Change], float]
) -> Array:
    """Covariance (p, p) about the best of values, grown as they are, of changes by their shares."""
    if not near:
        return np.zeros((best.values.size, best.values.size))
    values = np.array([grown(one) * one.values for one, _ in near]) - grown(best) * best.values
    shares = np.array([share for _, share in near])
    return np.asarray(values.T @ (values * shares[:, None]) / shares.sum())


def _explained(change: Change) -> float:
    """d' C^-1 d / 2 [nat] of a change."""
    return 0.5 * float(change.values @ inverted(change.covariance) @ change.values)


def _together(changes: Changes, ones: Sequence[PossibleChange], look: int) -> list[Change]:
    """Several changes fitted at once to the first `look` runs, by the scatter that they leave."""
    known = [replace(changes.single(look, one.effect, one.trend.begun), trend=one.trend)
             for one in ones]  # fmt: skip
    for _ in range(ROUNDS):  # without what is known the runs tell their constants and scatter
        left = changes.without(*known)
        temper = left.temper(look)
        known = possible_of(changes, left, known, look).values(ones)
    row = {trend: k for k, trend in enumerate(trends(look))}
    return [replace(own, covariance=temper[row[one.trend.begun], one.effect] * own.covariance)
            for one, own in zip(ones, known, strict=True)]  # fmt: skip
