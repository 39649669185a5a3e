"""Which legs, in which order: greedy, then by exchange, on the information of every leg alone.

Information adds up over legs (their slow noise is taken as each leg's own), and what drifts grows
with the time at which a leg begins: I(t) = G00 + t (G0d + Gd0) + t^2 Gdd.  What the search finds is
judged afterwards on the whole drive (`drives`).
Source: Fedorov, Theory of Optimal Experiments (1972), for exchange.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property, partial
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.deadline import Deadline
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.effort import Effort
from syncline_design.planning.information import Flags, block, covariance_of, shifted, sigmas
from syncline_design.planning.others import TWICE, VAGUE, Others
from syncline_design.planning.pairs import pair_ratio
from syncline_design.planning.placing import (
    BEGIN,
    LegTold,
    Place,
    Placed,
    arranged,
    lasting_s,
    legs_s,
    way_of,
)
from syncline_design.planning.wanted import Goal

MOST_LEGS: Final = 240
MARGIN: Final = 0.95  # of what is asked that a search aims at first, for the joints between legs
LEAST_GAIN: Final = 1e-4
SWEEPS: Final = 3
MOST_EXCHANGED: Final = 12
CONFUSED: Final = 0.05  # weight of what other effects take of what is wanted


def together(sequence: Sequence[LegTold]) -> Array:
    """Information of all legs."""
    total: Array = np.sum([p.told.at(p.heading, p.start_s) for p in arranged(sequence)], axis=0)
    return total if sequence else np.zeros(())


@dataclass(frozen=True, slots=True)
class PlanJudge:
    """How far a plan is from what is asked: a ratio for every wish, reached at 1 and below.

    prior: of the unknowns, so that what is not seen at all yet still counts less or more.
    """

    goal: Goal
    prior: Array
    others: Others

    def ratios(self, information: Array, exact: bool = False) -> Array:
        """Sigma over tolerance; root of the noncentrality asked over that reached."""
        index = list(self.goal.wanted)
        prior = None if exact else VAGUE * self.prior[index]
        return self._ratios(information, sigmas(information, index, prior))

    def _ratios(self, information: Array, sigma: Array) -> Array:
        """The same by the sigmas of what is wanted."""
        asked = np.isfinite(self.goal.tolerance)
        own = sigma[asked] / self.goal.tolerance[asked]
        return np.array([*own, *(pair_ratio(information, p) for p in self.goal.pairs)])

    def _wanted(self, information: Array) -> tuple[Array, Flags]:
        """Covariance of what is wanted, all others known, and which of it is lost."""
        index = list(self.goal.wanted)
        return covariance_of(block(information, index, index), VAGUE * self.prior[index])

    def _shares(self, information: Array, covariance: Array) -> Array:
        """By how much each other effect widens what is wanted, over what it may, (f, w);
        covariance: of what is wanted, all others known."""
        index = list(self.goal.wanted)
        vague = VAGUE * self.prior
        widened = self.others.widened(information, index, vague)
        share = widened / np.sqrt(np.diag(covariance)) / self.others.limit
        asked = np.isfinite(self.goal.tolerance)
        within = np.where(np.isinf(self.others.limit), 0.0, widened)
        held = within / np.where(asked, TWICE * self.goal.tolerance, 1.0)
        return np.asarray(np.where(asked, held, share))

    def enough(self, information: Array) -> bool:
        """Whether all that is asked is reached, and told from every other effect: the one rule for
        whole drives, line plans and logs, however long they may last."""
        return self.worst(information) <= 1.0

    def worst(self, information: Array) -> float:
        """The largest ratio to what is asked: 1 where it is just enough."""
        every = [*self.ratios(information, exact=True), *self.confusions(information)]
        return float(max(every, default=0.0))

    def confusions(self, information: Array) -> Array:
        """The largest share of any one other effect, by what is wanted."""
        return self._confusions(information, self._wanted(information)[0])

    def _confusions(self, information: Array, covariance: Array) -> Array:
        if not len(self.others.index):
            return np.zeros(0)
        return np.asarray(np.max(self._shares(information, covariance), axis=0))

    def taken(self, information: Array, k: int) -> tuple[int, float, float]:
        """The other effect that takes most of what is wanted at place k: its own first place, the
        sigma with it free, and what that may be."""
        index = list(self.goal.wanted)
        shares = self._shares(information, self._wanted(information)[0])[:, k]
        row = int(np.argmax(shares))
        widened = self.others.widened(information, index, VAGUE * self.prior)[row, k]
        return int(self.others.index[row, 0]), float(widened), float(widened / shares[row])

    def confusing(self, information: Array) -> list[int]:
        """First places of the effects that widen something more than they may.

        What the drive leaves that uncertain by itself is no doing of theirs: of that only who at
        least doubles it.
        """
        if not len(self.others.index):
            return []
        index, vague = list(self.goal.wanted), VAGUE * self.prior
        covariance, _ = self._wanted(information)
        widened = self.others.widened(information, index, vague)
        own = widened > TWICE * np.sqrt(np.diag(covariance))
        beyond = np.any((self._shares(information, covariance) > 1.0) & own, axis=1)
        return [int(k) for k in self.others.index[beyond, 0]]

    def standing(self, information: Array) -> Standing:
        """How far a plan is from all that is asked; what any one other effect, left free, takes of
        it counts like what is asked."""
        index, count = list(self.goal.wanted), len(self.prior)
        own = self._wanted(information)
        alone = shifted(*own, information[index, -1])
        ratios = self._ratios(information, alone)
        every = np.concatenate([ratios, self._confusions(information, own[0])])
        free = covariance_of(information[:count, :count], self.prior)
        whole = shifted(*free, information[:count, -1])[index]
        return Standing(every, float(np.mean(np.log(np.maximum(whole / alone, 1.0)))))


@dataclass(frozen=True, slots=True)
class Standing:
    """How far a plan is from what is asked: a ratio for every wish, 1 and below where it is met.

    taken: by how much all other effects together widen what is wanted, its mean logarithm.
    """

    every: Array
    taken: float

    @property
    def furthest(self) -> float:
        return float(np.max(self.every, initial=0.0))

    def loss(self, margin: float) -> float:
        """Sum of the logarithms of what is not reached, the worst twice; 0 where all is reached."""
        logs = np.log(np.maximum(self.every / margin, 1.0))
        return float(np.sum(logs) + np.max(logs)) if logs.size else 0.0

    def value(self, margin: float) -> tuple[float, float]:
        """What is not reached, and the same with what all other effects together take of it."""
        loss = self.loss(margin)
        return loss, loss + CONFUSED * self.taken


@dataclass(slots=True)
class LegSearch:
    """A search over legs for a judge; where time or effort are over it stops with what it has.

    margin: of what is asked that it aims at.  known: how sequences of legs stand, by `key`: they
    stand alike whatever the margin, and are judged once.
    """

    legs: tuple[LegTold, ...]
    judge: PlanJudge
    deadline: Deadline
    area_m: Place | None = None
    effort: Effort = field(default_factory=Effort)
    margin: float = MARGIN
    known: dict[tuple[int, ...], Standing] = field(default_factory=dict)

    def at(self, margin: float) -> LegSearch:
        """The same search with another margin."""
        return replace(self, margin=margin)

    @property
    def is_over(self) -> bool:
        """Whether it has to do with what it has."""
        return self.deadline.is_over or self.effort.is_over

    def key(self, sequence: Sequence[LegTold]) -> tuple[int, ...]:
        """Which legs, in which order."""
        return tuple(map(id, sequence))

    def fits(self, sequence: Sequence[LegTold]) -> bool:
        """Whether the legs and the turns between them stay within the area."""
        return self.area_m is None or way_of(sequence).within(self.area_m)

    def standing(self, key: tuple[int, ...], information: Callable[[], Array]) -> Standing:
        """How some legs stand; information: what they tell together."""
        found = self.known.get(key)
        if found is None:
            found = self.known[key] = self.judge.standing(information())
            self.effort.spent += 1
        return found

    def standing_of(self, sequence: Sequence[LegTold]) -> Standing:
        return self.standing(self.key(sequence), lambda: together(sequence))

    def value(self, sequence: Sequence[LegTold]) -> tuple[float, float]:
        return self.standing_of(sequence).value(self.margin)

    def looked_at(
        self, worth: Callable[[Standing], float], most: float
    ) -> Iterator[tuple[float, list[LegTold]]]:
        """What the search has looked at so far and is worth at most so much, the least first."""
        by_id = {id(told): told for told in self.legs}
        sized = ((worth(one), key) for key, one in self.known.items() if key)
        for size, key in sorted((one for one in sized if one[0] <= most), key=lambda one: one[0]):
            yield size, [by_id[k] for k in key]

    def reaches(self, sequence: Sequence[LegTold]) -> bool:
        return bool(sequence) and self.value(sequence)[0] <= 0.0

    def grown(self, begun: Sequence[LegTold], most_s: float) -> list[LegTold]:
        """Legs added one by one, each the best for its time, until all is reached."""
        plan = list(begun)
        loss, value = self.value(plan) if plan else (math.inf, 0.0)
        while loss > 0.0 and len(plan) < MOST_LEGS and not self.is_over:
            found = self._next(plan, value, most_s)
            if found is None:
                break
            gained = value - found[2]
            plan, loss, value = [*plan, found[0]], found[1], found[2]
            if len(plan) > 1 and gained < LEAST_GAIN:
                break
        return plan

    def _next(
        self, plan: list[LegTold], value: float, most_s: float
    ) -> tuple[LegTold, float, float] | None:
        best: tuple[float, LegTold, float, float] | None = None
        way, known, key = way_of(plan), _Once(plan), self.key(plan)
        for told in self.legs:
            placed, after = way.then(told)
            if after.end_s > most_s or not after.within(self.area_m):
                continue
            more = partial(known.then, placed)
            loss, worse = self.standing((*key, id(told)), more).value(self.margin)
            worth = (value - worse) / (after.end_s - way.end_s)
            if best is None or worth > best[0]:
                best = (worth, told, loss, worse)
        return None if best is None else best[1:]

    def shortened(self, plan: list[LegTold]) -> list[LegTold]:
        """Legs left out or exchanged for shorter ones while everything stays reached."""
        for _ in range(SWEEPS):
            below_s = lasting_s(plan) - 1e-6
            trials = [(lasting_s(t), t) for t in self._without(plan)]
            trials += self._exchanged(plan, below_s)
            shorter = [one for one in trials if one[1] and one[0] < below_s]
            shorter.sort(key=lambda one: one[0])
            found = next((t for _, t in shorter if self.fits(t) and self.reaches(t)), None)
            if found is None:
                break
            plan = found
        return plan

    def _without(self, plan: list[LegTold]) -> list[list[LegTold]]:
        return [plan[:k] + plan[k + 1 :] for k in range(len(plan))]

    def _exchanged(
        self, plan: list[LegTold], most_s: float
    ) -> Iterator[tuple[float, list[LegTold]]]:
        """Plans of at most so much time with another leg in the place of one, and their times."""
        if self.is_over:
            return
        begun = BEGIN
        for k, own in enumerate(plan[:MOST_EXCHANGED]):
            for told in self.legs:
                if told is not own:
                    rest = [told, *plan[k + 1 :]]
                    lasts_s = way_of(rest, begun, most_s).end_s
                    if lasts_s <= most_s:
                        yield lasts_s, [*plan[:k], *rest]
            begun = begun.led_on(own)[1]

    def bettered(self, plan: list[LegTold], most_s: float) -> list[LegTold]:
        """Exchange of single legs while it brings a plan of at most this time nearer."""
        value = self.value(plan)[1]
        for _ in range(SWEEPS):
            trials = [t for _, t in self._exchanged(plan, most_s) if self.fits(t)]
            values = [self.value(t)[1] for t in trials]
            if not values or min(values) >= value - LEAST_GAIN:
                break
            value, plan = min(values), trials[int(np.argmin(values))]
        return plan


class _Once:
    """What some legs tell together, added up once it is asked for."""

    def __init__(self, plan: Sequence[LegTold]) -> None:
        self._plan = plan

    @cached_property
    def _known(self) -> Array:
        return together(self._plan)

    def then(self, placed: Placed) -> Array:
        """With one more leg."""
        return np.asarray(self._known + placed.told.at(placed.heading, placed.start_s))


def best_within(search: LegSearch, most_s: float) -> list[LegTold]:
    """The plan for at most so much time: what is best for its time leg by leg, bettered, or what
    the search for longer drives met in passing, where that is nearer to what is asked."""
    plan = search.grown([], most_s)
    if not plan:  # not one leg fits: the shortest shows what it would take
        fitting = [told for told in search.legs if search.fits([told])] or search.legs
        return [min(fitting, key=lambda told: lasting_s([told]))]
    if search.reaches(plan):
        return plan
    plan = search.bettered(plan, most_s)
    worth = search.value(plan)[1]
    seen = search.looked_at(lambda one: one.value(search.margin)[1], worth)
    short = (legs for _, legs in seen if legs_s(legs) <= most_s)  # without turns: quick to tell
    within = (legs for legs in short if lasting_s(legs) <= most_s and search.fits(legs))
    return next(within, plan)


def reaching(search: LegSearch, most_s: float) -> list[list[LegTold]]:
    """Drives that reach all, the shortest first; none where none was found.

    Begun with the leg that tells most for its time, and with any other: what is best for its time
    first is not always best together.
    """
    best = search.grown([], most_s)
    if not search.reaches(best):
        return []
    found = [search.shortened(best)]
    if len(found[0]) <= MOST_EXCHANGED:  # beyond, what is first hardly matters, and takes long
        found += _begun_anyhow(search, lasting_s(found[0]))
        found += _two_legs(search, min(map(lasting_s, found)))
    found.sort(key=lasting_s)
    better = search.bettered(found[0], lasting_s(found[0]) + 1e-6)
    return [better, *found] if search.reaches(better) else found


def _begun_anyhow(search: LegSearch, most_s: float) -> list[list[LegTold]]:
    """What begins with any leg, each shorter than those before it."""
    found: list[list[LegTold]] = []
    for told in search.legs:
        if search.is_over:
            break
        if lasting_s([told]) >= most_s or not search.fits([told]):
            continue
        begun = search.grown([told], most_s)
        if search.reaches(begun):
            found.append(search.shortened(begun))
            most_s = min(most_s, lasting_s(found[-1]))
    return found


def _two_legs(search: LegSearch, below_s: float) -> list[list[LegTold]]:
    """The shortest of all drives of two legs that reach all in less time; none where none does."""
    pairs = [[one, other] for one in search.legs for other in search.legs]
    timed = sorted(((lasting_s(pair), pair) for pair in pairs), key=lambda one: one[0])
    shorter = (pair for lasts_s, pair in timed if lasts_s < below_s)
    return [p for p in shorter if search.fits(p) and search.reaches(p)][:1]
