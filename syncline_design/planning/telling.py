"""A drive that was found, told: what is known after each leg, what stays unseen, the path."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from syncline_design import __version__
from syncline_design.diagnosis.result import SpecRead
from syncline_design.effects.record import Array, Parameter
from syncline_design.machine.deadline import in_force
from syncline_design.machine.notebooks import Shown
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.model.system import System
from syncline_design.planning.approach import Approach, approach, run_up_words
from syncline_design.planning.areas import beyond_areas, tight_areas
from syncline_design.planning.drives import DrivenLeg, WholeDrive, World
from syncline_design.planning.fixed_targets import FixedTargets
from syncline_design.planning.flown_drives import flown_drives
from syncline_design.planning.from_diagnosis import cautions_of, foreign_words
from syncline_design.planning.information import (
    canonical_correlation,
    sigmas,
)
from syncline_design.planning.lacking import dear_legs, in_calm_water
from syncline_design.planning.left_open import confused, held, unseen, untold
from syncline_design.planning.pairs import (
    NONCENTRALITY,
    noncentrality_of,
    noncentrality_of_first,
    noncentrality_of_second,
    pair_ratio,
    told_from,
)
from syncline_design.planning.path import PathStates, unasked
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
    ToldBack,
)
from syncline_design.planning.setup import SECONDS, Setup
from syncline_design.planning.standard import legs_needed, line_plans, standard_legs
from syncline_design.planning.wanted import PairGoal

MOST_BLIND: Final = 0.15  # of a drive without a target in sight, before that is said
ROW_S: Final = 0.1  # between rows of the path that is written
MOST_PATH_ROWS: Final = 200_000


@dataclass(frozen=True, eq=False)
class PlanRun(Shown):
    """A plan, and the path that it is made of: what is written as waypoints.

    path: of the vehicle that drives, at most ROW_S apart; target_m: what is aimed at from a row
    on, NaN where nothing is.  leg: by row, its place among the plan's.  driven: every stage's
    motion and the targets, at the rows of the log.  motion: of the vehicle on the path.
    others: the paths of a chain's other vehicles at the same moments, by stage.  approach: what
    lies before and after it.
    """

    result: Plan
    path: PathStates
    target_m: Array
    leg: tuple[int, ...]
    driven: Drive
    motion: str
    others: Mapping[str, PathStates]
    approach: Approach


def duration_s(found: WholeDrive) -> float:
    """Of the whole drive."""
    return found.stretches[-1].to_s


@dataclass(frozen=True, eq=False)
class Telling:
    """What there is to say of drives of one setup."""

    setup: Setup

    def whole(self, found: WholeDrive, least_s: float | None, most_s: float) -> PlanRun:
        """The result and the path of a drive; least_s: the least time that reaches all."""
        path, target, leg = self._path(found)
        drives = found.stretches[-1].leg.stage
        vehicle = self.setup.world.vehicles[drives]
        others = {
            one.name: found.driven.states[k].at(path.time_s)
            for k, one in enumerate(self.setup.system.stages)
            if k != drives
        }
        return PlanRun(
            self._result(found, least_s, most_s), path, target, leg, found.driven, vehicle.motion,
            others, approach(vehicle, path),
        )  # fmt: skip

    def _result(self, found: WholeDrive, least_s: float | None, most_s: float) -> Plan:
        """What a drive tells; least_s: the least time that reaches all, most_s: what is given."""
        duration = duration_s(found)
        reached = self.setup.reached(found) and duration <= most_s
        legs = self._legs(found)
        spec = self.setup.case.spec
        origin = spec.log.origin if spec.log else None
        return Plan(
            reached=reached,
            spec=SpecRead(spec.name, str(self.setup.case.path)),
            minutes=self.setup.request.minutes,
            duration_s=duration,
            least_minutes=None if least_s is None else least_s / SECONDS,
            legs=legs,
            after=tuple(self._after(one.name, i) for one, i in zip(legs, found.after, strict=True)),
            tolerance=self._tolerance(),
            pairs=tuple(self._separated(found.after[-1], p) for p in self.setup.goal.pairs),
            inseparable=self.setup.inseparable,
            alike=self.setup.alike or None,
            confused=confused(self.setup, found.after[-1]),
            unseen=unseen(self.setup, found.after[-1]),
            columns=columns_needed(self.setup.system),
            rate_hz=self.setup.world.rate_hz,
            noise=_noise_words(self.setup.world),
            priors=dict(zip(self.setup.keys, map(float, self.setup.judge.prior), strict=True)),
            standard=self._standard(found) if self.setup.request.line_plans else (),
            targets=_targets(found.driven, self.setup.request.targets),
            surveyed=self.setup.world.surveyed is not None,
            assumed=_assumed(self.setup.world),
            origin_deg_m=None
            if origin is None
            else (math.degrees(origin[0]), math.degrees(origin[1]), float(origin[2])),
            provenance=PlanProvenance(
                __version__,
                self.setup.request.seed,
                self.setup.case.spec_sha256,
                self.setup.case.catalogs_sha256,
            ),
            flown=self._flown(),
            sized=bool(self.setup.world.beyond) or None,
            dear=tuple(dear_legs(self.setup, found)) or None if reached else None,
            calm=in_calm_water(self.setup, found) if reached else None,
            untold=untold(self.setup, found.after[-1]) or None,
            held=held(self.setup) or None,
            cautions=tuple(self._cautions(found, reached=reached)) or None,
        )

    def _cautions(self, found: WholeDrive, *, reached: bool) -> Iterator[str]:
        """What may make the plan another system's, or its drive one that cannot be driven."""
        setup, diagnosis = self.setup, self.setup.request.diagnosis
        if diagnosis is not None:
            yield from cautions_of(setup.case, setup.system, diagnosis)
            yield from foreign_words(setup.foreign)
        yield from beyond_areas(setup, found.driven)
        if not (reached or setup.inseparable):
            yield from tight_areas(setup)
        yield from _out_of_sight(found.driven)

    def _tolerance(self) -> dict[str, float]:
        pairs = zip(self.setup.goal.wanted, self.setup.goal.tolerance, strict=True)
        return {self.setup.keys[k]: float(t) for k, t in pairs if math.isfinite(t)}

    def _sigma(self, information: Array) -> dict[str, float]:
        index = list(self.setup.goal.wanted)
        found = sigmas(information, index)
        return {self.setup.keys[k]: float(s) for k, s in zip(index, found, strict=True)}

    def _correlation(self, information: Array) -> float | None:
        if not self.setup.goal.pairs:
            return None
        pair = self.setup.goal.pairs[0]
        return canonical_correlation(information, pair.first, pair.second)

    def _after(self, leg: str, information: Array) -> After:
        every = sigmas(information, range(len(self.setup.keys)), self.setup.judge.prior)
        return After(
            leg,
            self._sigma(information),
            {key: float(s) for key, s in zip(self.setup.keys, every, strict=True)},
            self._correlation(information),
            self._noncentrality(information),
        )

    def _noncentrality(self, information: Array) -> float | None:
        """Of the first pair where its size is known: that decides whether it is told."""
        if not self.setup.goal.pairs or not self.setup.goal.pairs[0].known:
            return None
        return noncentrality_of(information, self.setup.goal.pairs[0])

    def _separated(self, information: Array, pair: PairGoal) -> Separated:
        own, other = (
            [self.setup.world.every[k].parameter for k in places]
            for places in (pair.first, pair.second)
        )
        apart = pair_ratio(information, pair) <= 1.0
        larger, back = {}, None
        if not (apart or pair.known):
            sizes = zip(own, told_from(information, pair), strict=True)
            larger = {one.name: float(size) for one, size in sizes if size <= one.high}
        if not pair.known:
            back = ToldBack(
                noncentrality_of_second(information, pair), _sized(other, pair.second_sizes)
            )
        return Separated(
            *pair.names,
            canonical_correlation(information, pair.first, pair.second),
            noncentrality_of_first(information, pair),
            NONCENTRALITY,
            apart,
            _sized(own, pair.sizes),
            larger or None,
            back,
        )

    def _legs(self, found: WholeDrive) -> tuple[PlannedLeg, ...]:
        return tuple(
            PlannedLeg(
                f"{k} {one.leg.name}",
                one.from_s,
                one.to_s,
                self._with_turn(one) + self._meanwhile(one.leg.stage),
                self.setup.system.stages[one.leg.stage].name,
                math.degrees(one.heading_rad) % 360.0,
                math.degrees(one.turn_rad),
            )
            for k, one in enumerate(found.stretches, start=1)
        )

    def _with_turn(self, one: DrivenLeg) -> str:
        """What to do in a leg, from the turn on with which it begins."""
        angle = round(math.degrees(one.turn_rad))
        if angle == 0:
            vehicle = self.setup.world.vehicles[one.leg.stage]
            return one.leg.words + run_up_words(vehicle, one.leg.begins_mps or 0.0)
        joins_mps = self.setup.world.vehicles[one.leg.stage].join_mps
        speed = joins_mps if one.leg.begins_mps is None else one.leg.begins_mps
        how = f"at {to_digits(speed, 2)} m/s" if speed else "on the spot"
        side = "right" if angle > 0 else "left"
        words = one.leg.words
        return f"Turn {side} by {abs(angle)} deg {how}, then {words[0].lower()}{words[1:]}"

    def _meanwhile(self, stage: int) -> str:
        """What the other vehicles of a chain do."""
        held = [
            f"{v.stage} hovers"
            if v.join_mps == 0.0
            else f"{v.stage} circles wide at {to_digits(v.join_mps, 2)} m/s"
            for k, v in enumerate(self.setup.world.vehicles)
            if k != stage
        ]
        return f"; meanwhile {' and '.join(held)}" if held else ""

    def _standard(self, drive: WholeDrive) -> tuple[StandardPlan, ...]:
        world, wanted = self.setup.world, self.setup.goal.wanted
        stage = world.every[wanted[0]].candidate.stage if wanted else 0
        found = []
        vehicle = world.vehicles[stage]
        lines = standard_legs(vehicle, stage)
        if not lines:
            return ()
        for one in line_plans(vehicle, world.looked_at(lines)):
            in_force().check()
            legs = legs_needed(self.setup.judge, one)
            information = one.told_in(duration_s(drive))
            found.append(
                StandardPlan(
                    one.name,
                    legs,
                    self._sigma(information),
                    self._correlation(information),
                    None if legs is None else one.duration_s(legs) / SECONDS,
                    self._noncentrality(information),
                )
            )
        return tuple(found)

    def _path(self, found: WholeDrive) -> tuple[PathStates, Array, tuple[int, ...]]:
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
        """Measured logs held against what is asked, each with its own motion, targets and rate."""
        if not self.setup.request.flown:
            return None
        in_force().doing("looking at what was flown")
        drives = flown_drives(self.setup, self.setup.request.flown)
        return Flown(
            drives.files,
            drives.duration_s,
            drives.rows,
            self._sigma(drives.information),
            self._correlation(drives.information),
            self.setup.judge.enough(drives.information),
            drives.cautions or None,
            confused(self.setup, drives.information) or None,
            self._noncentrality(drives.information),
        )


def _sized(parameters: Sequence[Parameter], sizes: Array) -> dict[str, float]:
    return {one.name: float(size) for one, size in zip(parameters, sizes, strict=True)}


def _out_of_sight(driven: Drive) -> Iterator[str]:
    """For how much of the drive no target is in sight, in words, where that is much."""
    share = 0.0 if driven.aims is None else float(np.mean(driven.aims.aimed < 0))
    if share > MOST_BLIND:
        part = to_digits(100.0 * share, 2)
        yield f"For {part} % of the drive no target is in sight, and nothing is logged there."


def _targets(driven: Drive, fixed: FixedTargets | None) -> tuple[PlannedTarget, ...]:
    """The targets in use, numbered from 1; those that are surveyed already by their names."""
    if driven.aims is None:
        return ()
    found = []
    for k in np.unique(driven.aims.aimed[driven.aims.aimed >= 0]):
        north, east, down = map(float, driven.aims.targets_m[k])
        name = None if fixed is None else fixed.names[k]
        found.append(PlannedTarget(int(k) + 1, north, east, down, name))
    return tuple(found)


def _noise_words(world: World) -> str:
    if world.measured is not None:
        return "as the diagnosis fitted it: white and first-order Gauss-Markov per sensor"
    return (
        "as the spec states it: white noise of every sensor's sigma and its timing scatter, and "
        "the Gauss-Markov noise that its effects list"
    )


def _assumed(world: World) -> tuple[str, ...]:
    several = len(world.vehicles) > 1
    every = (
        (v.stage, words)
        for v in world.vehicles
        for words in (*v.assumed, *filter(None, (unasked(v),)))
    )
    return tuple(f"{stage}: {words}" if several else words for stage, words in every)


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
