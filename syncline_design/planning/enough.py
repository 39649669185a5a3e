"""The shortest drive that is enough, by what whole drives tell.

The search adds up what legs tell alone.  Turns between them tell more, joints and other targets
less, so that what it aims at (its margin) is not what the drive reaches: that is judged whole, and
the margin is moved by how far it was off, until the drive is enough and hardly more.  How far it is
off differs from drive to drive: of a single leg most of all.  So shorter drives that the search
passed by, since their legs alone fall somewhat short, are judged whole as well, where they may
prove enough and save time that matters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import Final

from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.cutting import SAVES, Cutting
from syncline_design.planning.drives import whole_information
from syncline_design.planning.effort import Effort
from syncline_design.planning.legs import Leg
from syncline_design.planning.placing import LegTold, lasting_s
from syncline_design.planning.search import LegSearch, reaching
from syncline_design.planning.setup import Setup

AIM: Final = 0.993  # of what is asked that a drive is to reach
CLOSE: Final = 0.985  # of what is asked: from there on a drive tells hardly more
TRIED: Final = 5  # margins
MOST_JUDGED: Final = 24  # drives that are judged whole
FEW_ROWS: Final = 200  # of the longest leg that is only tried
MOST_CUT: Final = 6  # legs cut to what is asked that are judged by all their rows
ALIKE: Final = 0.003  # by which two margins differ that are as good as one
BY_TURNS: Final = 0.6  # of what one leg falls short by alone that the turns beside it may make up
MOST_PASSED_BY: Final = 24  # drives passed by that are judged whole


@dataclass(frozen=True, slots=True)
class Shortest:
    """The shortest drive found that reaches all, and the margin with which it was searched.

    judged: whether it was enough when it was judged whole; without, the search alone says so, or
    nothing reaches all.
    """

    legs: list[LegTold]
    margin: float
    judged: bool


def shortest(setup: Setup, search: LegSearch, most_s: float) -> Shortest:
    """The shortest drive of at most so much time that is enough."""
    tried, whole = _Margins(search.margin), _Whole(setup, search.effort)
    found: list[list[LegTold]] = []
    for _ in range(TRIED):
        drives = reaching(search.at(tried.now), most_s)
        if not drives:
            break
        found += drives
        if not tried.moved(whole.worst(drives[0])) or search.is_over:
            break
    if not found:
        return Shortest(search.grown([], most_s), search.margin, judged=False)
    enough = whole.first_enough(sorted(found, key=lasting_s))
    if enough is not None:
        enough = _cut(search, whole, _passed_by(search, whole, enough))
    return Shortest(enough or found[0], tried.passed or search.margin, enough is not None)


def _cut(search: LegSearch, whole: _Whole, enough: list[LegTold]) -> list[LegTold]:
    """The drive, or a shorter one of one swing of speed that is cut to what is asked."""

    world, stages = whole.setup.world, tuple(sorted({told.leg.stage for told in search.legs}))

    def enough_of(legs: Sequence[Leg]) -> list[Leg]:
        if search.deadline.is_over or search.effort.is_half_over:
            return []
        fitting = [leg for leg in legs if search.fits([world.unjudged(leg)])]
        return [
            leg for leg, worst in zip(fitting, whole.roughly(fitting), strict=True) if worst <= AIM
        ]

    shorter = Cutting(world, stages, enough_of).shorter(lasting_s(enough))
    for cut in (list(world.looked_at([leg])) for leg in shorter[:MOST_CUT]):
        if whole.worst(cut) <= 1.0:
            return cut
    return enough


def _passed_by(search: LegSearch, whole: _Whole, enough: list[LegTold]) -> list[LegTold]:
    """The shortest drive that is enough, of this one and of those that the search has looked at,
    as many as may be judged; what falls short by its legs alone the least is judged first.

    A search of limited effort leaves them where it has spent half of it.
    """
    left, usual = MOST_PASSED_BY, whole.worst(enough) / search.standing_of(enough).furthest
    for alone, legs in search.looked_at(lambda one: one.furthest, 1.0 / (usual * (1.0 - BY_TURNS))):
        if not left or search.deadline.is_over or search.effort.is_half_over:
            break
        if alone * usual * (1.0 - BY_TURNS / len(legs)) > 1.0:
            continue
        if lasting_s(legs) < SAVES * lasting_s(enough) and search.fits(legs):
            left -= 1
            enough = legs if whole.worst(legs) <= 1.0 else enough
    return enough


@dataclass(slots=True)
class _Margins:
    """The margin to search with, and between which the drive is that is just enough."""

    now: float
    passed: float = 0.0
    failed: float = math.inf

    def moved(self, worst: float) -> bool:
        """Move by how the drive found now did; whether another is worth a search."""
        if worst <= 1.0:
            self.passed = max(self.passed, self.now)
        else:
            self.failed = min(self.failed, self.now)
        if CLOSE <= worst <= 1.0 or self.failed <= self.passed or not math.isfinite(worst):
            return False
        before, self.now = self.now, self.now * AIM / worst
        if not self.passed < self.now < self.failed:
            self.now = math.sqrt(self.passed * self.failed)
        return abs(math.log(self.now / before)) >= ALIKE


@dataclass(frozen=True, eq=False)
class _Whole:
    """What drives judged whole reach of what is asked, each judged once."""

    setup: Setup
    effort: Effort
    known: dict[tuple[int, ...], tuple[float, list[LegTold]]] = field(default_factory=dict)

    def worst(self, legs: list[LegTold]) -> float:
        """1 and below where it is enough."""
        key = tuple(map(id, legs))
        if key not in self.known:
            in_force().check()
            lasts_s = lasting_s(legs)
            world = self.setup.world.coarse(lasts_s)
            self.effort.look_at(world.computed_hz * lasts_s)
            worst = self.setup.judge.worst(whole_information(world, legs))
            self.known[key] = worst, legs  # whose places in memory no others may take
        return self.known[key][0]

    def roughly(self, legs: Sequence[Leg]) -> list[float]:
        """The same of drives of one leg each, from a few rows, each of which counts for several."""
        if not legs:
            return []
        in_force().check()
        world = self.setup.world.coarse(max(leg.duration_s for leg in legs), FEW_ROWS)
        self.effort.look_at(world.computed_hz * sum(leg.duration_s for leg in legs))
        return [self.setup.judge.worst(told) for told in world.alone(legs)]

    def first_enough(self, drives: Sequence[list[LegTold]]) -> list[LegTold] | None:
        """The first that is enough, of as many as may be judged."""
        for legs in drives:
            new = tuple(map(id, legs)) not in self.known
            if new and len(self.known) >= MOST_JUDGED:
                continue
            if self.worst(legs) <= 1.0:
                return legs
        return None
