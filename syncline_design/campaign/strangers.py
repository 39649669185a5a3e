"""Runs of a store that are unlike all the others: another vehicle's log, or one odd day.

A run r is held against all the others.  With I_r, g_r its information and score, S the sum of all
information, of the others with what is known of the constants, and g that of all scores,
    W = I_r - I_r S^-1 I_r,   u = g_r - I_r S^-1 g
are information and score of what is another in this run alone; of effects C
    d = W_CC^-1 u_C,   u_C' W_CC^-1 u_C ~ chi-square where nothing is,
over the scatter inside runs and that between the others.  What clearly differs from run to run is
freed, and Fisher's F of as many free values as the others have takes the place of chi-square then;
of a few runs nobody knows that, and each effect is taken to differ by three bounds of a run.  Any
effect may differ less clearly, by the odds p_a and the likelihood L_a of the others (`changes`): of
the chances P_a of the departure where it does and P_0 where none does the mean counts,
    P = (P_0 + sum p_a L_a P_a) / (1 + sum p_a L_a).
Two that are strange alike hide each other, so that the oddest are held against the others without
one another, too.  A run is a stranger where the chance of that, times runs and effects
(Bonferroni), is below its look's share of `RATE`: 2 / (n (n - 1)) after n runs, so that the chance
of a false word is at most `RATE` over all looks (docs/joint.md has what was counted).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.constants import Apart, blocks_of, held_of
from syncline_design.campaign.freed_runs import pseudo_inverse
from syncline_design.campaign.pool import Index, Term, inverted
from syncline_design.campaign.run_records import Runs
from syncline_design.campaign.scatter import APART, freed_of
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, commonness
from syncline_design.diagnosis.judged import Judged, log_f
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

RATE: Final = 0.01  # chance that any of several alike runs is said to be unlike, over all looks
FEWEST: Final = 3  # runs: of two that differ neither is the odd one
MOST_TOLD: Final = 4  # effects of one run
MOST_TRIED: Final = 4  # runs that seem odd before the scatter of the others is known
PAIRED: Final = 3  # of them, of which two are looked at together
FEWEST_OF_PAIRS: Final = 6  # runs
SCATTER_KNOWN: Final = 8  # runs; before, an effect is taken to differ from run to run
USUAL_BOUNDS: Final = 3.0  # of a run, by which it then is
RIVAL_NATS: Final = 3.0


def share_of(look: int) -> float:
    """Share of the false words that a look may have: 2 / (n (n - 1)), which sums to 1 from 3 on."""
    return 2.0 / (look * (look - 1.0))


@dataclass(frozen=True, eq=False)
class Departure:
    """One effect by which a run differs from the others: by how much, log of the chance, and what
    would explain that as well in its place, by how many nats less."""

    term: Term
    judged: Judged
    log_p: float
    others: tuple[tuple[Term, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Stranger:
    """A run, by its place, with all in which it is unlike the others, the clearest first."""

    run: int
    departures: tuple[Departure, ...]


def strangers(changes: Changes) -> tuple[Stranger, ...]:
    """All runs that are unlike the others, by their places; none where half of them would be."""
    rows = np.arange(changes.pool.count)
    limit = limit_of(changes)
    found: list[Stranger] = []
    while len(rows) >= FEWEST:
        one = _strangest(part_of(changes, rows), limit)
        if one is None:
            break
        found.append(replace(one, run=int(rows[one.run])))
        rows = np.delete(rows, one.run)
        if 2 * len(found) >= changes.pool.count:
            return ()
    odd = [one.run for one in found]
    return tuple(_anew(changes, one, odd, limit) for one in sorted(found, key=lambda o: o.run))


def _anew(changes: Changes, one: Stranger, odd: Sequence[int], limit: float) -> Stranger:
    """A strange run with all its departures, none of which another strange one hides."""
    rows = np.array([k for k in range(changes.pool.count) if k == one.run or k not in odd])
    at = int(np.flatnonzero(rows == one.run)[0])
    found = departures_of(part_of(changes, rows), at, limit)
    return replace(one, departures=found or one.departures)


def limit_of(changes: Changes) -> float:
    """log of the chance below which one of these runs is unlike the others."""
    return math.log(RATE * share_of(max(changes.pool.count, 2)))


def departures_of(changes: Changes, run: int, limit: float) -> tuple[Departure, ...]:
    """All in which a run, by its place, is unlike all the others of these."""
    return tuple(_held(changes, run, ()).departures(limit))


def part_of(changes: Changes, rows: Index) -> Changes:
    """The same question of some of the runs."""
    found = Changes(changes.pool.part(rows))
    told = {term.label for term in found.terms}  # what no other run tells of is no question more
    stays = np.flatnonzero([term.label in told for term in changes.terms])
    found.__dict__["within"] = changes.within[np.ix_(rows, stays)]
    return found


def _strangest(changes: Changes, limit: float) -> Stranger | None:
    """The run that is least like the others; None where noise would do."""
    count, seems = changes.pool.count, _seem(changes)
    odd = [int(run) for run in np.argsort(seems)[:MOST_TRIED] if seems[run] < limit]
    tries: list[tuple[int, tuple[int, ...]]] = [(run, ()) for run in odd]
    if count >= FEWEST_OF_PAIRS:  # two that are strange alike hide each other
        tries += [(run, (other,)) for run in odd[:PAIRED] for other in odd[:PAIRED] if other != run]
    for run, apart in tries:
        found = tuple(_held(changes, run, apart).departures(limit))
        if found:
            return Stranger(run, found)
    return None


def _seem(changes: Changes) -> Array:
    """log of the least chance of any effect by run, (L,), as if nothing scattered."""
    known = changes.pool
    count = known.count
    inverse = pseudo_inverse(changes.total(count, known.normal, known.score))
    apart = known.normal - known.normal @ inverse @ known.normal
    left = known.score - known.normal @ (inverse @ known.score.sum(axis=0))
    found = np.zeros(count)
    for group in changes.groups:
        own, score = apart[:, *group.blocks], left[:, group.index]
        squares = np.einsum("lga,lgab,lgb->lg", score, inverted(own), score)
        free = np.sum(np.einsum("lgaa->lga", own) > 0.0, axis=-1)
        for run in range(count):
            for size in np.unique(free[run][free[run] > 0]):
                most = float(np.max(squares[run][free[run] == size]))
                found[run] = min(found[run], log_p_of(most, int(size)))
    return np.asarray(found + math.log(count * max(len(changes.terms), 1)))


def _held(changes: Changes, run: int, apart: tuple[int, ...]) -> Odd:
    """A run against the others but for those apart, what scatters among those freed in it, too."""
    rest = np.delete(np.arange(changes.pool.count), [run, *apart])
    others = part_of(changes, rest)
    runs = others.compared(len(rest))
    normal, score = changes.pool.normal[run][None], changes.pool.score[run][None]
    for one in runs.freed:
        normal, score = freed_of(normal, score, one.term.index, one.covariance)
    between = {t.label: 1.0 for t in changes.terms}
    for group, scatter in zip(others.groups, runs.scatters, strict=True):
        for k, factor in zip(group.terms, scatter.factor[-1], strict=True):
            between[others.terms[int(k)].label] = float(factor)
    inside = np.maximum(changes.inside(changes.pool.count), changes.within[run])
    known = Known(others, runs, normal[0], score[0])
    factor = np.array([between[t.label] for t in changes.terms])
    doubt = 1.0 if changes.pool.count >= SCATTER_KNOWN else 1.0 + USUAL_BOUNDS**2
    tries = changes.pool.count ** (1 + len(apart))
    return Odd(changes, known, inside, inside * factor, tries, doubt)


@dataclass(frozen=True, eq=False)
class Own:
    """Information W (N, P, P) and score u (N, P) of what is another in one run alone, by so many
    ways in which runs may differ, and log of how likely each is (N,)."""

    normal: Array
    score: Array
    log_share: Array


@dataclass(frozen=True, eq=False)
class Known:
    """A run (normal, score) beside others; what clearly differs from run to run freed in all."""

    others: Changes
    runs: Runs
    normal: Array
    score: Array

    @cached_property
    def alike(self) -> Own:
        """Where nothing else differs from run to run."""
        return self._own(self.normal[None], self.score[None], np.zeros(1))

    @cached_property
    def apart(self) -> tuple[float, Own]:
        """The share of nothing else that differs, and the same where one effect does, by each of
        APART; shares sum to 1."""
        odds = self.others.log_odds(len(self.runs.normal))
        total = float(np.logaddexp.reduce([0.0, *odds.ravel()]))
        usual, found = self.runs.normal.mean(axis=0), []
        more = 1.0 + 1.0 / len(self.runs.normal)  # the mean of the others is as uncertain by it
        sizes = np.square(APART)[:, None, None]
        normals, scores = (np.repeat(one[None], len(APART), axis=0)
                           for one in (self.normal, self.score))  # fmt: skip
        for part in self.others.parts:
            index = part.index
            spread = sizes * (more * inverted(usual[index[:, None], index]))
            found.append(freed_of(normals, scores, index, spread))
        normal, score = (np.concatenate(each) for each in zip(*found, strict=True))
        return -total, self._own(normal, score, odds.ravel() - total)

    def _own(self, normal: Array, score: Array, log_share: Array) -> Own:
        inverse = pseudo_inverse(self.runs.total + normal)
        fit = inverse @ (self.runs.score.sum(axis=0) + score)[:, :, None]
        apart = normal - normal @ inverse @ normal
        return Own(apart, score - (normal @ fit)[:, :, 0], log_share)


@dataclass(frozen=True, eq=False)
class Odd:
    """A run held against others.  inside, temper: variance of each effect over that fitted, inside
    runs and of them, (C,).  tries: runs, or pairs of them, that were tried.  doubt: variance over
    temper again, where runs are too few to tell how an effect scatters."""

    changes: Changes
    known: Known
    inside: Array
    temper: Array
    tries: int
    doubt: float

    @cached_property
    def charge(self) -> float:
        """log of how often chance was given a try."""
        return math.log(self.tries * max(len(self.changes.terms), 1))

    def log_p(self, k: int, beside: Sequence[int], limit: float = 0.0) -> float:
        """log of the chance of one effect's departure beside those of others, as it is where
        nothing else differs if that is no less than the limit."""
        doubt = 1.0 if beside else self.doubt  # a run that is odd is no more like the others
        temper, inside = doubt * float(self.temper[k]), float(self.inside[k])
        first = self._chances(self.known.alike, k, beside, temper)[0] + self.charge
        if first >= limit:
            return float(first)
        share, apart = self.known.apart
        each = self._chances(apart, k, beside, inside) + apart.log_share
        return float(np.logaddexp.reduce([first + share, *(each + self.charge)]))

    def _chances(self, own: Own, k: int, beside: Sequence[int], temper: float) -> Array:
        """log of the chances of what an effect departs by, (N,)."""
        more, free = self._more(own, k, beside)
        pairs = zip(map(float, more / temper), map(int, free), strict=True)
        return np.array([self._chance(*pair) if pair[1] else 0.0 for pair in pairs])

    def _chance(self, square: float, free: int) -> float:
        if self.known.runs.freed:
            return log_f(square / free, free, len(self.known.runs.normal) - 1)
        return log_p_of(square, free)

    def _more(self, own: Own, k: int, beside: Sequence[int]) -> tuple[Array, Index]:
        """u' W^-1 u of an effect (N,), others of the run free beside it, and how many values that
        is: of its directions that are another thing than they, as of constants."""
        index, rest = self.changes.terms[k].index, self._index(beside)
        apart, across = self._apart(own, k, beside)
        left = own.score[:, index] - (across @ own.score[:, rest, None])[:, :, 0]
        along, another = (left[:, None, :] @ apart.turn)[:, 0], apart.another
        square: Array = ((along**2)[:, None, :] @ another[:, :, None])[:, 0, 0]
        return square, np.sum(another > 0.0, axis=1)

    def _apart(self, own: Own, k: int, beside: Sequence[int]) -> tuple[Apart, Array]:
        """What an effect has apart from others, and how they take its score (N, p, q)."""
        index, rest = self.changes.terms[k].index, self._index(beside)
        whole = own.normal[:, index[:, None], index]
        across = own.normal[:, index[:, None], rest]
        taken = across @ inverted(own.normal[:, rest[:, None], rest])
        return blocks_of(whole).apart(whole - taken @ np.swapaxes(across, 1, 2)), taken

    def _together(self, taken: Sequence[int]) -> tuple[Array, Array]:
        """Values of several effects, and their covariance by the noise fitted: a direction that is
        no other thing than what was taken before stays small, or the two would undo each other."""
        index, own, at = self._index(taken), self.known.alike, 0
        normal = own.normal[0][np.ix_(index, index)]
        for place, k in enumerate(taken):
            (apart, _), term = self._apart(own, k, taken[:place]), self.changes.terms[k]
            whole = own.normal[0][np.ix_(term.index, term.index)]
            among = slice(at, at + term.size)
            normal[among, among] += held_of(whole, apart.turn[0], apart.another[0])
            at += term.size
        covariance = inverted(normal)
        return covariance @ own.score[0, index], covariance

    def _index(self, taken: Sequence[int]) -> Index:
        none = np.zeros(0, dtype=np.int64)
        return np.concatenate([none, *(self.changes.terms[k].index for k in taken)])

    def departures(self, limit: float) -> Iterator[Departure]:
        """The effects that differ, forward, of those that explain as much the commonest."""
        taken: list[int] = []
        while len(taken) < MOST_TOLD:
            one = self._next(taken, limit)
            if one is None:
                break
            taken.append(one)
        stay = [k for k in taken if self.log_p(k, [b for b in taken if b != k], limit) < limit]
        values, covariance = self._together(stay)
        at = 0
        for k in stay:
            term = self.changes.terms[k]
            own = slice(at, at + term.size)
            at += term.size
            judged = Judged(values[own], float(self.temper[k]) * covariance[own, own])
            beside = [b for b in stay if b != k]
            others = tuple(self._others(k, beside))
            yield Departure(term, judged, self.log_p(k, beside, limit), others)

    def _others(self, k: int, beside: Sequence[int]) -> Iterator[tuple[Term, float]]:
        """Effects that explain what one does, beside those of others, as well."""
        terms = self.changes.terms
        places = [c for c in range(len(terms)) if c not in beside]
        gains = self._gains(places, beside)
        for c in sorted(places, key=lambda c: -gains[c]):
            if c != k and gains[c] >= gains[k] - RIVAL_NATS:
                yield terms[c], gains[k] - gains[c]

    def _gains(self, places: Sequence[int], beside: Sequence[int]) -> dict[int, float]:
        """What effects explain beside others, less a nat a value, by one noise: a run has one."""
        more = {k: float(self._more(self.known.alike, k, beside)[0][0]) for k in places}
        noise = float(self.inside[max(places, key=more.__getitem__)])
        return {k: 0.5 * more[k] / noise - self.changes.terms[k].size for k in places}

    def _next(self, taken: Sequence[int], limit: float) -> int | None:
        chances = {k: self.log_p(k, taken, limit) for k in range(len(self.changes.terms))
                   if k not in taken}  # fmt: skip
        odd = [k for k, chance in chances.items() if chance < limit]
        if not odd:
            return None
        gains = self._gains(odd, taken)
        most = max(gains.values())
        close = [k for k in odd if gains[k] >= most - AS_GOOD_NATS]
        return min(close, key=lambda k: (commonness(self.changes.terms[k].label), chances[k]))
