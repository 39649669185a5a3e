"""Runs in their order with what was found at every look at them: whether it rang, and by what."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.looks import KeptLook, keys_of, known_first
from syncline_design.campaign.pool import Pool, Term, inverted, pool_of
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.store import Entry, Stored, by_date
from syncline_design.campaign.trends import trends
from syncline_design.diagnosis.candidates import commonness
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

AS_GOOD_NATS: Final = 2.0
RIVAL_NATS: Final = 3.0
MOST_CHANGES: Final = 4
CREDIBLE: Final = 0.95


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

    def grown(self, values: Array) -> Seen:
        """The same, by so much larger."""
        return replace(self, change=replace(self.change, values=self.change.values + values))


@dataclass(frozen=True, eq=False)
class ComparedRuns:
    """Runs of one baseline, in the order in which they are compared; threshold: log of the evidence
    [nat] that rings."""

    stored: Stored
    runs: tuple[Entry, ...]
    threshold: float

    @cached_property
    def pool(self) -> Pool:
        entries = self.runs or self.stored.entries[-1:]
        return pool_of([e.found for e in entries], [e.start for e in entries])

    @property
    def evidence(self) -> Array:
        """log E_n after each look, from the second run on."""
        return self.changes.course[1:]

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Of the look after each run."""
        return self._keys(self.runs)

    def _keys(self, runs: Sequence[Entry]) -> tuple[str, ...]:
        listed = [self.pool.labels, [term.label for term in self.pool.terms]]
        return tuple(keys_of(listed, [entry.line for entry in runs]))

    @cached_property
    def kept(self) -> tuple[KeptLook, ...]:
        """What earlier looks at these runs found, as the store holds it."""
        return known_first(self.stored.looks, self.keys, len(self.pool.terms))

    @cached_property
    def doubted(self) -> int | None:
        """The run after which a kept look says what its runs do not; None where none does.

        At every call another of them is computed again, and the last where nothing follows it: the
        answer is mostly its own.
        """
        if not self.kept:
            return None
        last = len(self.kept) - 1
        tried = {len(self.stored.entries) % len(self.kept)}
        tried |= {last} if len(self.kept) == len(self.runs) else set()
        for at in sorted(tried):
            anew = _look(self.keys[at], *Changes(self.pool, self.kept).found_anew(at + 1))
            if not anew.is_like(self.kept[at]):
                return at
        return None

    @cached_property
    def changes(self) -> Changes:
        return Changes(self.pool, self.kept if self.doubted is None else ())

    @cached_property
    def fresh(self) -> tuple[KeptLook, ...]:
        """Looks that the store does not hold, or holds wrongly."""
        first = len(self.kept) if self.doubted is None else 0
        places = range(first, len(self.runs))
        return tuple(_look(self.keys[k], *self.changes.found_by(k + 1)) for k in places)

    @cached_property
    def first_look(self) -> int | None:
        """The first look that rang, by the place from 1 of its run; None where none did."""
        rang = (k + 2 for k, e in enumerate(self.evidence) if e >= self.threshold)
        return next(rang, self._rang)

    @cached_property
    def seen(self) -> tuple[Seen, ...]:
        """Changes that were alarmed at any look so far, the strongest first."""
        first = self.first_look
        if first is None:
            return ()
        found: list[Seen] = []
        changes, look = self.changes, len(self.runs)
        for _ in range(2 * MOST_CHANGES):
            at = look
            total, rows = changes.log_evidence(at)[0], None
            if found and total < self.threshold:
                rows = _rows_of(found, at)
                total = changes.of_one_day(at, rows)
            if found and (total < self.threshold or len(found) == MOST_CHANGES):
                break
            if not found and total < math.log(2.0):  # it went back, which is a change of its own
                at = first
                total = changes.log_evidence(at)[0]
            one = _best(changes, at, first, total, rows)
            changes = changes.taking(one.change)
            same = [k for k, other in enumerate(found) if other.change.is_of(one.change)]
            for k in same:  # what was left of one that is told already
                found[k] = found[k].grown(one.change.values)
            if not same:
                found.append(one)
        return _at_once(found, changes.alone(), look, self.threshold)

    @property
    def _rang(self) -> int | None:
        """The place from 1 of the run whose look rang when it was added, before runs of earlier
        dates came in; an alarm stays, whatever is added."""
        if self.doubted is not None:
            return None
        added = sorted(self.runs, key=lambda entry: entry.number)
        begun = [entry.run.first_s for entry in added]
        if begun == sorted(begun):  # nothing came in late: the course is what the looks found
            return None
        for n in range(2, len(added)):
            look = self.stored.looks.get(self._keys(tuple(by_date(tuple(added[:n]))))[-1])
            if look is not None and look.log_evidence >= self.threshold:
                return 1 + self.runs.index(added[n - 1])
        return None


def _at_once(
    found: Sequence[Seen], without: Changes, look: int, threshold: float
) -> tuple[Seen, ...]:
    """Several changes fitted together, less those that only stood for what others had left.

    without: runs less all of them, so that none makes the scatter that another is held against.
    """
    kept = list(found)
    while len(kept) > 1:
        left = _fitted_together(without, [one.change for one in kept], look)
        changes = [replace(own, values=one.change.values + own.values)
                   for one, own in zip(kept, left, strict=True)]  # fmt: skip
        weakest = min(range(len(changes)), key=lambda k: _explained(changes[k]))
        if _explained(changes[weakest]) >= threshold:
            pairs = zip(kept, changes, strict=True)
            return tuple(replace(one, change=change) for one, change in pairs)
        gone = kept.pop(weakest).change
        without = without.without(replace(gone, values=-gone.values))
    return tuple(kept)


def _explained(change: Change) -> float:
    """d' C^-1 d / 2 [nat] of a change."""
    return 0.5 * float(change.values @ inverted(change.covariance) @ change.values)


def _fitted_together(changes: Changes, ones: Sequence[Change], look: int) -> list[Change]:
    """Several changes fitted at once to the first `look` runs.

    With h_i the course of a change over the runs and J_i = sum h_i I[c_i, :],
        N_ij = sum h_i h_j I[c_i, c_j] - J_i S^-1 J_j',   s_i = sum h_i g[c_i] - J_i S^-1 g.
    """
    runs, temper = changes.compared(look), changes.temper(look)
    over = [one.trend.over(look) for one in ones]
    index = [one.term.index for one in ones]
    across = np.concatenate([np.tensordot(h, runs.normal[:, own], axes=1)
                             for h, own in zip(over, index, strict=True)])  # fmt: skip
    scores = np.concatenate([h @ runs.score[:, own] for h, own in zip(over, index, strict=True)])
    both = [[np.tensordot(over[i] * over[j], runs.normal[:, index[i][:, None], index[j]], axes=1)
             for j in range(len(ones))] for i in range(len(ones))]  # fmt: skip
    inverse = inverted(np.block(both) - across @ runs.inverse @ across.T)
    values = inverse @ (scores - across @ (runs.inverse @ runs.score.sum(axis=0)))
    place = {term.label: k for k, term in enumerate(changes.terms)}
    row = {trend: k for k, trend in enumerate(trends(look))}
    found, end = [], 0
    for one in ones:
        at = slice(end, end + one.term.size)
        end += one.term.size
        factor = float(temper[row[one.trend], place[one.term.label]])
        found.append(replace(one, values=values[at], covariance=factor * inverse[at, at]))
    return found


def _rows_of(found: Sequence[Seen], look: int) -> list[int]:
    """Places of the courses that changes have."""
    known = trends(look)
    return sorted({known.index(one.change.trend) for one in found})


def _best(
    changes: Changes, look: int, first: int, total: float, rows: Sequence[int] | None
) -> Seen:
    """The likeliest change; among effects that are as good, the commonest in practice.  rows: the
    courses that it may have, None: any."""
    may = np.full((2 * (look - 1), 1), 0.0 if rows is None else -np.inf)
    may[list(rows or ())] = 0.0
    table = changes.likelihoods(look) + may
    each = np.logaddexp.reduce(changes.gains(look) + may, axis=0)
    close = np.flatnonzero(each >= each.max() - AS_GOOD_NATS)
    c = min(close, key=lambda i: (commonness(changes.terms[i].label), -each[i]))
    known = trends(look)
    share = np.exp(table[:, c] - np.logaddexp.reduce(table[:, c]))
    kinds = np.array([one.kind for one in known])
    kind = max(dict.fromkeys(kinds), key=lambda one: float(share[kinds == one].sum()))
    row = int(np.argmax(np.where(kinds == kind, share, -1.0)))
    order = np.argsort(-share)
    needed = int(np.searchsorted(np.cumsum(share[order]), CREDIBLE)) + 1
    credible = [known[k].k for k in order[:needed]]
    others = sorted(
        ((changes.terms[i], float(each[c] - each[i])) for i in range(len(each))
         if i != c and each[i] > each[c] - RIVAL_NATS),
        key=lambda other: other[1],
    )  # fmt: skip
    best = changes.change(look, row, int(c))
    near = [(changes.change(look, int(k), int(c)), float(share[k])) for k in order[:needed]]
    same = [(one, own) for one, own in near if one.trend.kind == kind]
    apart = (_apart(best, same, lambda one: 1.0),
             _apart(best, near, lambda one: float(one.trend.over(look)[-1])))  # fmt: skip
    return Seen(best, min(credible), max(credible), first, total, tuple(others), *apart)


def _apart(
    best: Change, near: Sequence[tuple[Change, float]], grown: Callable[[Change], float]
) -> Array:
    """Covariance (p, p) about the best of values, grown as they are, of changes by their shares."""
    values = np.array([grown(one) * one.values for one, _ in near]) - grown(best) * best.values
    shares = np.array([share for _, share in near])
    return np.asarray(values.T @ (values * shares[:, None]) / shares.sum())


def _look(key: str, evidence: float, within: Array, between: Array) -> KeptLook:
    return KeptLook(key, evidence, tuple(map(float, within)), tuple(map(float, between)))
