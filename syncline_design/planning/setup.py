"""What a plan starts from: a request, and the world in which it is looked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.system import pinned_system
from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.model.system import System
from syncline_design.planning.beyond import BeyondFirst, beyond_first
from syncline_design.planning.drives import WholeDrive, World
from syncline_design.planning.effort import Effort
from syncline_design.planning.fixed_targets import FixedTargets
from syncline_design.planning.from_diagnosis import asked_of
from syncline_design.planning.information import (
    Unknown,
    columns,
    noise_rms_m,
    rms_per_unit,
)
from syncline_design.planning.legs import MOST_LEG_S, Leg
from syncline_design.planning.others import Others, others_of
from syncline_design.planning.pairs import noncentrality_of, pair_ratio
from syncline_design.planning.path import joined
from syncline_design.planning.placing import LegTold
from syncline_design.planning.search import PlanJudge
from syncline_design.planning.singular import HeldPlaces, told_beside, told_by_size
from syncline_design.planning.vehicle import vehicles
from syncline_design.planning.wanted import (
    Goal,
    NamedEffect,
    PairGoal,
    PlanError,
    PlanWanted,
    goal_of,
    keys_of,
    label_of,
    usual,
)
from syncline_design.spec.case import Case

NOTHING_ASKED: Final = PlanWanted()
DEFAULT_HZ: Final = 10.0
SECONDS: Final = 60.0
BEST_LEGS: Final = 5.0  # times as much as all legs on average, in the same time
SAME_ERROR: Final = 1e-18  # of the information on an effect: what rounding leaves of none
MOST_OF_ALL: Final = 1e4  # times all legs: what that does not tell apart, no drive does


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """What a plan is asked for; none of all: a commissioning drive.

    targets: those that are surveyed already.  line_plans: whether the field's are judged beside it.
    effort: what the search may look at; None: whatever it takes.
    """

    asked: PlanWanted = NOTHING_ASKED
    diagnosis: Diagnosis | None = None
    minutes: float = 10.0
    flown: tuple[Path, ...] = ()
    seed: int = 0
    targets: FixedTargets | None = None
    line_plans: bool = True
    effort: Effort | None = None


@dataclass(frozen=True, eq=False)
class Setup:
    """What a plan starts from: the world, what is asked of it, and every leg looked at.

    untold: other effects that no drive tells from some of what is asked.  foreign: effects that the
    diagnosis names and that this system cannot have, left out of what is asked.  held: what is
    asked and held as known, since no drive tells it from the rest.
    """

    case: Case
    request: PlanRequest
    world: World
    goal: Goal
    judge: PlanJudge
    told: tuple[LegTold, ...]
    inseparable: tuple[str, ...]
    alike: tuple[str, ...]
    untold: Others
    foreign: tuple[NamedEffect, ...]
    held: tuple[HeldPlaces, ...]

    @classmethod
    def begun(cls, case: Case, request: PlanRequest) -> Setup:
        """Looks at every leg; PlanError where nothing can be planned for."""
        if not (0.0 < request.minutes < math.inf):
            raise PlanError(f"--minutes {request.minutes}: expected more than 0 minutes, finite")
        system = pinned_system(case)
        world = _world(case, system, request)
        _demand_legs(world)
        world, asked, foreign = _asked(world, request)
        in_force().doing("looking at the legs")
        view = _sampled(world)
        goal = goal_of(system, world.every, asked, *_sizes(world, view))
        goal, beyond = _beyond_first(view, world.every, goal)
        world = replace(world, beyond=beyond, same_unknowns=world.every)
        prior = np.array([one.prior for one in world.every])
        told = world.looked_at(_legs_of(world, goal))
        library = np.sum([t.at(h, SECONDS * h) for t in told for h in range(4)], axis=0)
        share = BEST_LEGS * SECONDS * request.minutes / (4.0 * sum(t.leg.duration_s for t in told))
        alike = tuple(_words(p) for p in goal.pairs if _is_one(library, p))
        goal, apart = _separable(goal, library, share)
        goal, held = told_beside(world.every, told_by_size(goal, library), library)
        others, untold = others_of(world.every, goal, library, prior, [one.held for one in held])
        judge = PlanJudge(goal, prior, others)
        return cls(case, request, world, goal, judge, told, apart, alike, untold, foreign, held)

    @property
    def in_calm_water(self) -> Setup:
        """The same question to the same vehicles without waves."""
        world = self.world.calm
        return replace(self, world=world, told=world.looked_at([t.leg for t in self.told]))

    @property
    def system(self) -> System:
        """The system, pinned."""
        return self.world.system

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of all unknowns."""
        return keys_of(self.system, self.world.every)

    @property
    def rows(self) -> float:
        """Rows that were looked at: of all legs, at four headings."""
        return 4.0 * self.world.computed_hz * sum(told.leg.duration_s for told in self.told)

    def reached(self, found: WholeDrive) -> bool:
        """Whether a drive tells all that is asked, whatever it takes."""
        return self.judge.enough(found.after[-1])


def _demand_legs(world: World) -> None:
    """PlanError where no vehicle can drive one leg in the time that a leg may take."""
    if world.legs:
        return
    told = ", ".join(
        f"{one.stage} from {to_digits(one.join_mps, 3)} to {to_digits(one.fast_mps, 3)} m/s at "
        f"{to_digits(one.acceleration_mps2, 3)} m/s^2"
        for one in world.vehicles
    )
    raise PlanError(
        f"no leg takes less than {to_digits(MOST_LEG_S)} s ({told}): state what the vehicle of the "
        "test drive can do, v_max and acceleration of its platform"
    )


def _world(case: Case, system: System, request: PlanRequest) -> World:
    types = tuple("" if s.ranging is None else s.ranging.type for s in system.stages)
    noise = None if request.diagnosis is None else request.diagnosis.noise
    targets = None if request.targets is None else request.targets.places_m
    return World(system, vehicles(case, types), _rate_hz(case, system), noise, targets)


def _rate_hz(case: Case, system: System) -> float:
    """Rows a second: the last ranging sensor's rate where it is known."""
    last = system.stages[-1].ranging
    role = case.stages[-1].role("ranging")
    entry = None if last is None or role is None else role.sensor(last.id)
    rate = None if entry is None else entry.rate
    return DEFAULT_HZ if rate is None else float(rate)


def _asked(world: World, request: PlanRequest) -> tuple[World, PlanWanted, tuple[NamedEffect, ...]]:
    """What the options and the diagnosis ask for together, in a world that knows it; nothing: what
    usually matters.  With it what the diagnosis names and the system cannot have, left out."""
    system, stated = world.system, request.asked
    found = PlanWanted() if request.diagnosis is None else asked_of(system, request.diagnosis)
    named = {one: label_of(system, one, "--diagnosis") for one in found.named}
    labels = {*named.values(), *(label_of(system, one, "the plan") for one in stated.named)}
    world = world.with_asked(labels)
    known = {one.candidate.label for one in world.every}
    foreign = tuple(one for one, label in named.items() if label not in known)
    found = found.without(foreign)
    given = {one.text for one, _ in stated.reach}
    reach = (*stated.reach, *(one for one in found.reach if one[0].text not in given))
    asked = PlanWanted(reach, (*stated.pairs, *found.pairs))
    if not asked.named:
        asked = usual(system, world.every)
    if not asked.named:
        raise PlanError("nothing to plan for: no effect applies to this system")
    return world, asked, foreign


def _legs_of(world: World, goal: Goal) -> tuple[Leg, ...]:
    """The legs of the vehicles that carry what is asked for; the others hold meanwhile."""
    asked = {*goal.wanted, *(k for p in goal.pairs for k in (*p.first, *p.second))}
    stages = {world.every[k].candidate.stage for k in asked}
    return tuple(leg for leg in world.legs if leg.stage in stages)


def _sampled(world: World) -> Scene:
    """A log of all legs one after the other, as far as every stage has some."""
    stages = range(len(world.vehicles))
    every = [joined([g.course for g in world.legs if g.stage == k]) for k in stages]
    shortest = min(len(course) for course in every)
    cut = [
        type(c)(c.ahead[:shortest], c.right[:shortest], c.down[:shortest], c.turn[:shortest])
        for c in every
    ]
    return world.view(world.driven(cut))


def _sizes(world: World, view: Scene) -> tuple[float, Array]:
    """RMS error [m] that the noise makes, and that one unit of every unknown makes."""
    structure, level = world.noise(view)
    visible = np.isfinite(view.log.truth_m)
    return noise_rms_m(structure, level, visible), rms_per_unit(columns(view, world.every))


def _beyond_first(
    view: Scene, every: Sequence[Unknown], goal: Goal
) -> tuple[Goal, tuple[BeyondFirst, ...]]:
    """Pairs whose size is known, beyond first order: where their columns follow the unknowns'."""
    pairs, found, at = [], [], len(every)
    for pair in goal.pairs:
        one = beyond_first(view, every, pair)
        if one is not None:
            pair = replace(pair, beyond=(at, tuple(range(at + 1, at + one.width))))
            found.append(one)
            at += one.width
        pairs.append(pair)
    return replace(goal, pairs=tuple(pairs)), tuple(found)


def _is_one(information: Array, pair: PairGoal) -> bool:
    """Whether two effects make the same error on all legs, whatever the second's parameters have
    to be: said of a known size alone, of which the errors themselves are compared."""
    if pair.beyond is None:
        return False
    own = float(pair.sizes @ information[np.ix_(pair.first, pair.first)] @ pair.sizes)
    return noncentrality_of(information, pair) < SAME_ERROR * own


def _words(pair: PairGoal) -> str:
    """A pair by its effects' names."""
    return " and ".join(pair.names)


def _separable(goal: Goal, library: Array, share: float) -> tuple[Goal, tuple[str, ...]]:
    """The goal without further pairs that no drive tells apart, and these in words.

    The pair that is named first stays: then no drive reaches it, and the plan says so.
    share: of the library, what the best legs tell at most in the minutes that are given; what is
    another beyond first order only has to show in that, or it would hold up all others.
    """
    kept, apart = list(goal.pairs[:1]), []
    for pair in goal.pairs:
        most = share if pair.beyond is not None and len(goal.pairs) > 1 else MOST_OF_ALL
        if pair_ratio(min(most, MOST_OF_ALL) * library, pair) > 1.0:
            apart.append(_words(pair))
        elif pair not in kept:
            kept.append(pair)
    if len(kept) > 1 and apart and apart[0] == _words(goal.pairs[0]):
        kept = kept[1:]
    wanted = set(goal.wanted)
    if goal.pairs and kept and kept[0] is not goal.pairs[0]:
        own = {k for p in goal.pairs[:1] for k in (*p.first, *p.second)}
        asked = {k for k, t in zip(goal.wanted, goal.tolerance, strict=True) if math.isfinite(t)}
        wanted = (wanted - (own - asked)) | set(kept[0].first) | set(kept[0].second)
    tolerance = dict(zip(goal.wanted, goal.tolerance, strict=True))
    order = tuple(sorted(wanted))
    sizes = np.array([tolerance.get(k, math.inf) for k in order])
    return Goal(order, sizes, tuple(kept)), tuple(apart)
