"""A plan from its request to its result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design import __version__
from syncline_design.diagnosis.result import Diagnosis, SpecRead
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured, pinned_system
from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.model.system import System
from syncline_design.planning.drives import Outcome, World, outcome
from syncline_design.planning.from_diagnosis import asked_of
from syncline_design.planning.information import (
    Unknown,
    canonical_correlation,
    columns,
    fisher,
    noise_rms_m,
    rms_per_unit,
    sigmas,
    with_shift,
)
from syncline_design.planning.legs import Leg
from syncline_design.planning.path import States, joined
from syncline_design.planning.planned_log import Drive
from syncline_design.planning.result import (
    After,
    Flown,
    Plan,
    PlannedLeg,
    PlannedTarget,
    PlanProvenance,
    Separated,
    StandardPlan,
)
from syncline_design.planning.search import (
    AREA_SHARE,
    NONCENTRALITY,
    Judge,
    Search,
    Told,
    best_legs,
    extent_m,
    lasting_s,
    noncentrality_of,
    others_of,
    pair_ratio,
    together,
)
from syncline_design.planning.standard import Round, rounds, rounds_needed, standard_legs
from syncline_design.planning.vehicle import vehicles
from syncline_design.planning.wanted import (
    Asked,
    Goal,
    PairGoal,
    PlanError,
    goal_of,
    keys_of,
    text_of,
    usual,
)
from syncline_design.spec.case import Case

NOTHING_ASKED: Final = Asked()
DEFAULT_HZ: Final = 10.0
SECONDS: Final = 60.0
LONGEST_S: Final = 4 * 3600.0  # of a drive that is looked for to say the least minutes
SEARCH_SHARE: Final = 0.5  # of the command's time
UNSEEN: Final = 0.7  # of the prior: what a drive leaves that uncertain, it does not show
MOST_OF_ALL: Final = 1e4  # times all legs: what that does not tell apart, no drive does
ROW_S: Final = 0.1  # between rows of the path that is written
MOST_PATH_ROWS: Final = 200_000


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """What a plan is asked for; none of all: a commissioning drive."""

    asked: Asked = NOTHING_ASKED
    diagnosis: Diagnosis | None = None
    minutes: float = 10.0
    flown: tuple[Path, ...] = ()
    seed: int = 0


@dataclass(frozen=True, eq=False)
class PlanRun:
    """A plan, and the path that it is made of: what is written as waypoints.

    path: of the vehicle that drives, at most ROW_S apart; target_m: what is aimed at from a row
    on, NaN where nothing is.  leg: by row, its place among the plan's.  driven: every stage's
    motion and the targets, at the rows of the log.  motion: of the vehicle on the path.
    others: the paths of a chain's other vehicles at the same moments, by stage.
    """

    result: Plan
    path: States
    target_m: Array
    leg: tuple[int, ...]
    driven: Drive
    motion: str
    others: Mapping[str, States]


def plan(case: Case, request: PlanRequest | None = None) -> PlanRun:
    """The drive that tells what is asked.

    Raises BadInput for a spec that cannot be used, PlanError for a request that cannot be met at
    all; what cannot be reached in the minutes is a result.
    """
    with one_thread():
        return _Planning.begun(case, request or PlanRequest()).run()


@dataclass(frozen=True, eq=False)
class _Planning:
    """One plan in the making."""

    case: Case
    request: PlanRequest
    world: World
    goal: Goal
    judge: Judge
    told: tuple[Told, ...]
    inseparable: tuple[str, ...]

    @classmethod
    def begun(cls, case: Case, request: PlanRequest) -> _Planning:
        if not (0.0 < request.minutes < math.inf):
            raise PlanError(f"--minutes {request.minutes:g}: expected more than 0 minutes")
        system = pinned_system(case)
        world = _world(case, system, request.diagnosis)
        asked = _asked(system, world.every, request)
        in_force().doing("looking at the legs")
        noise_m, per_unit = _sizes(world)
        goal = goal_of(system, world.every, asked, noise_m, per_unit)
        prior = np.array([one.prior for one in world.every])
        told = world.looked_at(_legs_of(world, goal))
        library = np.sum([t.at(h, SECONDS * h) for t in told for h in range(4)], axis=0)
        goal, apart = _separable(system, world.every, goal, library)
        others = others_of(world.every, goal, library, prior)
        return cls(case, request, world, goal, Judge(goal, prior, others), told, apart)

    @property
    def system(self) -> System:
        return self.world.system

    def run(self) -> PlanRun:
        most_s = SECONDS * self.request.minutes
        in_force().doing("searching for legs")
        limit = in_force().left_s()
        deadline = in_force().inner(None if limit is None else SEARCH_SHARE * limit)
        search = Search(self.told, self.judge, deadline, self._area())
        chosen, whole = best_legs(search, most_s, max(LONGEST_S, most_s))
        in_force().doing("looking at the whole drive")
        chosen, found = self._judged(search, chosen, most_s)
        least_s = self._least_s(found, whole, most_s)
        return self._result(found, least_s, most_s)

    def _area(self) -> tuple[float, float] | None:
        """The tightest area of the vehicles that drive; PlanError where not one leg fits."""
        stages = {t.leg.stage for t in self.told}
        areas = [v.area_m for k, v in enumerate(self.world.vehicles) if k in stages and v.area_m]
        if not areas:
            return None
        area = (min(a[0] for a in areas), min(a[1] for a in areas))
        known = Search(self.told, self.judge, in_force(), area)
        if not any(known.fits([told]) for told in self.told):
            least = min((extent_m([told]) for told in self.told), key=max)
            raise PlanError(
                f"area [{area[0]:g} m, {area[1]:g} m]: not one leg of this vehicle stays within "
                f"it; the smallest takes {least[0] / AREA_SHARE:.0f} m by "
                f"{least[1] / AREA_SHARE:.0f} m: widen it, or lower v_max"
            )
        return area

    def _judged(
        self, search: Search, chosen: list[Told], most_s: float
    ) -> tuple[list[Told], Outcome]:
        """The whole drive; with more legs where the joints took what the search had counted on."""
        found = outcome(self.world, chosen)
        for _ in range(3):
            if self._reached(found) or not search.reaches(chosen):
                break
            added = self._one_more(search, chosen, most_s - lasting_s(chosen))
            if added is None:
                break
            chosen = [*chosen, added]
            found = outcome(self.world, chosen)
        return chosen, found

    def _one_more(self, search: Search, chosen: list[Told], left_s: float) -> Told | None:
        """The leg that tells most about what is worst."""
        trials = [t for t in self.told if t.lasts_s <= left_s and search.fits([*chosen, t])]
        if not trials:
            return None
        return min(trials, key=lambda t: search.value([*chosen, t])[1])

    def _reached(self, found: Outcome) -> bool:
        ratios = self.judge.ratios(found.after[-1], exact=True)
        return bool(np.all(ratios <= 1.0))

    def _least_s(self, found: Outcome, whole: list[Told], most_s: float) -> float | None:
        """The least time that reaches all: this drive's, a longer one's, or so many of its kind."""
        if self._reached(found) and _duration_s(found) <= most_s:
            return _duration_s(found)
        search = Search(self.told, self.judge, in_force())
        if search.reaches(whole):
            return max(lasting_s(whole), 1.001 * most_s)
        again = Round("", together(whole), lasting_s(whole), len(whole))
        needed = rounds_needed(self.judge, again)
        return None if needed is None else math.ceil(needed) * again.lasts_s

    def _result(self, found: Outcome, least_s: float | None, most_s: float) -> PlanRun:
        duration = _duration_s(found)
        reached = self._reached(found) and duration <= most_s
        path, target, leg = self._path(found)
        legs = self._legs(found)
        spec = self.case.spec
        origin = spec.log.origin if spec.log else None
        result = Plan(
            reached=reached,
            spec=SpecRead(spec.name, str(self.case.path)),
            minutes=self.request.minutes,
            duration_s=duration,
            least_minutes=None if least_s is None else least_s / SECONDS,
            legs=legs,
            after=tuple(self._after(one.name, i) for one, i in zip(legs, found.after, strict=True)),
            tolerance=self._tolerance(),
            pairs=tuple(self._separated(found.after[-1], p) for p in self.goal.pairs),
            inseparable=self.inseparable,
            confused=self._confused(found.after[-1]),
            unseen=self._unseen(found.after[-1]),
            columns=columns_needed(self.system),
            rate_hz=self.world.rate_hz,
            noise=_noise_words(self.world),
            priors=dict(zip(self.keys, map(float, self.judge.prior), strict=True)),
            standard=self._standard(duration),
            targets=_targets(found.driven),
            surveyed=self.world.surveyed is not None,
            assumed=_assumed(self.world),
            origin_deg_m=None
            if origin is None
            else (math.degrees(origin[0]), math.degrees(origin[1]), float(origin[2])),
            provenance=PlanProvenance(
                __version__,
                self.request.seed,
                self.case.spec_sha256,
                self.case.catalogs_sha256,
            ),
            flown=self._flown(),
        )
        vehicle = self.world.vehicles[found.stretches[-1].leg.stage]
        others = {
            one.name: found.driven.states[k].at(path.time_s)
            for k, one in enumerate(self.system.stages)
            if k != found.stretches[-1].leg.stage
        }
        return PlanRun(result, path, target, leg, found.driven, vehicle.motion, others)

    @property
    def keys(self) -> tuple[str, ...]:
        return keys_of(self.system, self.world.every)

    def _tolerance(self) -> dict[str, float]:
        pairs = zip(self.goal.wanted, self.goal.tolerance, strict=True)
        return {self.keys[k]: float(t) for k, t in pairs if math.isfinite(t)}

    def _sigma(self, information: Array) -> dict[str, float]:
        index = list(self.goal.wanted)
        found = sigmas(information, index)
        return {self.keys[k]: float(s) for k, s in zip(index, found, strict=True)}

    def _correlation(self, information: Array) -> float | None:
        if not self.goal.pairs:
            return None
        pair = self.goal.pairs[0]
        return canonical_correlation(information, pair.first, pair.second)

    def _after(self, leg: str, information: Array) -> After:
        every = sigmas(information, range(len(self.keys)), self.judge.prior)
        return After(
            leg,
            self._sigma(information),
            {key: float(s) for key, s in zip(self.keys, every, strict=True)},
            self._correlation(information),
        )

    def _separated(self, information: Array, pair: PairGoal) -> Separated:
        names = [self.world.every[k].parameter.name for k in pair.first]
        return Separated(
            *pair.names,
            canonical_correlation(information, pair.first, pair.second),
            noncentrality_of(information, pair),
            NONCENTRALITY,
            pair_ratio(information, pair) <= 1.0,
            dict(zip(names, map(float, pair.sizes), strict=True)),
        )

    def _confused(self, information: Array) -> tuple[str, ...]:
        """Effects that, left free alone, would take what is asked."""
        places = self.judge.confusing(information)
        return tuple(text_of(self.system, self.world.every[k]) for k in places)

    def _unseen(self, information: Array) -> tuple[str, ...]:
        """Effects whose parameters stay as uncertain as before, whole or some of them."""
        every = sigmas(information, range(len(self.keys)), self.judge.prior)
        hidden: dict[str, list[str]] = {}
        whole: dict[str, int] = {}
        for one, sigma in zip(self.world.every, every, strict=True):
            text = text_of(self.system, one)
            whole[text] = whole.get(text, 0) + 1
            if sigma > UNSEEN * one.prior:
                hidden.setdefault(text, []).append(one.parameter.name)
        return tuple(
            text if len(names) == whole[text] else f"{text}: {', '.join(names)}"
            for text, names in hidden.items()
        )

    def _legs(self, found: Outcome) -> tuple[PlannedLeg, ...]:
        return tuple(
            PlannedLeg(
                f"{k} {one.leg.name}",
                one.from_s,
                one.to_s,
                one.leg.words + self._meanwhile(one.leg.stage),
                self.system.stages[one.leg.stage].name,
                math.degrees(one.heading_rad) % 360.0,
            )
            for k, one in enumerate(found.stretches, start=1)
        )

    def _meanwhile(self, stage: int) -> str:
        """What the other vehicles of a chain do."""
        held = [
            f"{v.stage} hovers"
            if v.join_mps == 0.0
            else f"{v.stage} circles wide at {v.join_mps:.2g} m/s"
            for k, v in enumerate(self.world.vehicles)
            if k != stage
        ]
        return f"; meanwhile {' and '.join(held)}" if held else ""

    def _standard(self, duration_s: float) -> tuple[StandardPlan, ...]:
        stage = self.world.every[self.goal.wanted[0]].candidate.stage if self.goal.wanted else 0
        found = []
        told = self.world.looked_at(standard_legs(self.world.vehicles[stage], stage))
        for one in rounds(told):
            in_force().check()
            needed = rounds_needed(self.judge, one)
            information = duration_s / one.lasts_s * one.information
            legs = None if needed is None else math.ceil(one.legs * needed - 1e-9)
            found.append(
                StandardPlan(
                    one.name,
                    legs,
                    self._sigma(information),
                    self._correlation(information),
                    None if legs is None else legs * one.lasts_s / one.legs / SECONDS,
                )
            )
        return tuple(found)

    def _path(self, found: Outcome) -> tuple[States, Array, tuple[int, ...]]:
        """The path of the vehicle that drives (of several, the last), as it is written."""
        driven = found.driven
        stage = found.stretches[-1].leg.stage
        states = driven.states[stage]
        begun, end = float(states.time_s[0]), float(states.time_s[-1])
        count = min(math.ceil((end - begun) / ROW_S - 1e-9), MOST_PATH_ROWS)
        time_s = np.linspace(begun, end, count + 1)
        path = states.at(time_s)
        rows = np.searchsorted(states.time_s, time_s + 1e-9, side="right") - 1
        target = np.full((len(time_s), 3), np.nan)
        if driven.aims is not None:
            target = driven.aims.aimed_m[np.clip(rows, 0, len(states.time_s) - 1)]
        starts = np.array([one.from_s for one in found.stretches])
        leg = np.clip(np.searchsorted(starts, time_s, side="right") - 1, 0, None)
        return path, target, tuple(int(k) for k in leg)

    def _flown(self) -> Flown | None:
        """A measured log held against what is asked: its own motion and targets, its own rate."""
        if not self.request.flown:
            return None
        in_force().doing("looking at the flown log")
        inputs = measured(self.case, self.request.flown)
        if len(inputs.system.stages) != len(self.system.stages):
            raise PlanError("--flown: the log holds not all stages of the spec")
        view = scene(inputs.system, inputs.log, inputs.known)
        own = replace(self.world, rate_hz=self.world.computed_hz)
        structure, level = own.noise(view)
        information = fisher(structure, level, with_shift(view, self.world.every))
        ratios = self.judge.ratios(information, exact=True)
        return Flown(
            tuple(path.name for path in self.request.flown),
            inputs.log.duration_s,
            len(inputs.log),
            self._sigma(information),
            self._correlation(information),
            bool(np.all(ratios <= 1.0)),
        )


def _duration_s(found: Outcome) -> float:
    return found.stretches[-1].to_s


def _world(case: Case, system: System, diagnosis: Diagnosis | None) -> World:
    types = tuple("" if s.ranging is None else s.ranging.type for s in system.stages)
    noise = None if diagnosis is None else diagnosis.noise
    return World(system, vehicles(case, types), _rate_hz(case, system), noise)


def _rate_hz(case: Case, system: System) -> float:
    """Rows a second: the last ranging sensor's rate where it is known."""
    last = system.stages[-1].ranging
    role = case.stages[-1].role("ranging")
    entry = None if last is None or role is None else role.sensor(last.id)
    rate = None if entry is None else entry.rate
    return DEFAULT_HZ if rate is None else float(rate)


def _asked(system: System, every: Sequence[Unknown], request: PlanRequest) -> Asked:
    """What the options and the diagnosis ask for together; nothing: what usually matters."""
    reach, pairs = list(request.asked.reach), list(request.asked.pairs)
    if request.diagnosis is not None:
        found = asked_of(system, request.diagnosis)
        given = {one.text for one, _ in reach}
        reach += [entry for entry in found.reach if entry[0].text not in given]
        pairs += found.pairs
    asked = Asked(tuple(reach), tuple(pairs))
    if not asked.reach and not asked.pairs:
        asked = usual(system, every)
    if not asked.reach and not asked.pairs:
        raise PlanError("nothing to plan for: no effect applies to this system")
    return asked


def _legs_of(world: World, goal: Goal) -> tuple[Leg, ...]:
    """The legs of the vehicles that carry what is asked for; the others hold meanwhile."""
    asked = {*goal.wanted, *(k for p in goal.pairs for k in (*p.first, *p.second))}
    stages = {world.every[k].candidate.stage for k in asked}
    return tuple(leg for leg in world.legs if leg.stage in stages)


def _sizes(world: World) -> tuple[float, Array]:
    """RMS error [m] that the noise makes, and that one unit of every unknown makes."""
    stages = range(len(world.vehicles))
    every = [joined([g.course for g in world.legs if g.stage == k]) for k in stages]
    shortest = min(len(course) for course in every)
    cut = [
        type(c)(c.ahead[:shortest], c.right[:shortest], c.down[:shortest], c.turn[:shortest])
        for c in every
    ]
    view = world.view(world.driven(cut))
    structure, level = world.noise(view)
    visible = np.isfinite(view.log.truth_m)
    return noise_rms_m(structure, level, visible), rms_per_unit(columns(view, world.every))


def _separable(
    system: System, every: Sequence[Unknown], goal: Goal, library: Array
) -> tuple[Goal, tuple[str, ...]]:
    """The goal without further pairs that no drive tells apart, and these in words.

    The pair that is named first stays: then no drive reaches it, and the plan says so.
    """
    kept, apart = list(goal.pairs[:1]), []
    for pair in goal.pairs:
        lost = pair_ratio(MOST_OF_ALL * library, pair) > 1.0
        if lost:
            apart.append(f"{pair.names[0]} and {pair.names[1]}")
        elif pair not in kept:
            kept.append(pair)
    if len(kept) > 1 and apart and apart[0] == " and ".join(goal.pairs[0].names):
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


def _targets(driven: Drive) -> tuple[PlannedTarget, ...]:
    """The targets in use, numbered from 1."""
    if driven.aims is None:
        return ()
    used = np.unique(driven.aims.aimed[driven.aims.aimed >= 0])
    return tuple(
        PlannedTarget(int(k) + 1, *(float(v) for v in driven.aims.targets_m[k])) for k in used
    )


def _noise_words(world: World) -> str:
    if world.measured is not None:
        return "as the diagnosis fitted it: white and first-order Gauss-Markov per sensor"
    return (
        "as the spec states it: white noise of every sensor's sigma and its timing scatter, and "
        "the Gauss-Markov noise that its effects list"
    )


def _assumed(world: World) -> tuple[str, ...]:
    several = len(world.vehicles) > 1
    return tuple(
        f"{v.stage}: {words}" if several else words for v in world.vehicles for words in v.assumed
    )


def columns_needed(system: System) -> tuple[str, ...]:
    """The columns that the log of such a drive needs, by the names of docs/diagnosis.md."""
    found = ["time_s"]
    ranged = system.stages[-1].ranging is not None
    for k, stage in enumerate(system.stages):
        prefix = f"{stage.name}_" if len(system.stages) > 1 else ""
        own = [f"position_{axis}_m" for axis in ("north", "east", "down")] if k == 0 else []
        own += [f"{angle}_deg" for angle in ("roll", "pitch", "yaw")]
        own += [f"velocity_{axis}_mps" for axis in ("north", "east", "down")]
        own += [f"rate_{axis}_degps" for axis in "xyz"]
        if ranged:
            own += ["range_m", "azimuth_deg", "elevation_deg"]
        found += [prefix + name for name in own]
    stem = "target" if ranged else "reference"
    found += [f"{stem}_{axis}_m" for axis in ("north", "east", "down")]
    return tuple(found)
