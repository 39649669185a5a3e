"""Legs put together to a whole drive, and what a log of it would tell after every leg."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.noise import NoiseLevel, Structure
from syncline_design.diagnosis.result import Noise
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.effects.acting import acting_of
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.planning.aims import beside
from syncline_design.planning.beyond import BeyondFirst
from syncline_design.planning.information import (
    Unknown,
    drift_columns,
    expected_noise,
    fisher,
    hardly_moved,
    late,
    unknowns,
    with_shift,
)
from syncline_design.planning.leg_library import library
from syncline_design.planning.legs import QUARTER_RAD, Leg, transition
from syncline_design.planning.path import STEP_S, CourseCommands, PathStates, joined, travelled
from syncline_design.planning.placing import LegTold, Room, Swept, arranged
from syncline_design.planning.planned_log import (
    Drive,
    apart,
    drive,
    one_after_another,
    planned_log,
    turned,
)
from syncline_design.planning.vehicle import Vehicle

COMPUTED_HZ = 10.0  # rows that are computed; more rows a second count as less noise each
MOST_ROWS = 12_000  # of a long drive that is only looked at for what it tells
GAP_S = 1000.0  # between legs that are looked at as one log: no noise lasts so long
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class World:
    """A system with its vehicles: what drives are made and judged in.

    rate_hz: rows a second that the log has.  measured: noise that a diagnosis found.  surveyed:
    targets that are there already (m, 3) [m]; None: they are put where the drive needs them.
    beyond: pairs that are judged beyond first order.  most_hz: rows a second that are computed.
    same_unknowns: those of another world, where they are to be the same; None: those that a drive
    of its own shows.
    """

    system: System
    vehicles: tuple[Vehicle, ...]
    rate_hz: float
    measured: Noise | None = None
    surveyed: Array | None = None
    beyond: tuple[BeyondFirst, ...] = ()
    most_hz: float = COMPUTED_HZ
    same_unknowns: tuple[Unknown, ...] | None = None

    @property
    def computed_hz(self) -> float:
        return min(self.rate_hz, self.most_hz)

    def coarse(self, duration_s: float, rows: int = MOST_ROWS) -> World:
        """The same for a drive of so much time, with at most so many rows.

        Its unknowns stay: which ones a log shows hangs on its rows a second.
        """
        most_hz = min(self.most_hz, rows / max(duration_s, 1.0))
        return replace(self, most_hz=most_hz, same_unknowns=self.every)

    @property
    def in_waves(self) -> bool:
        """Whether waves move a vehicle unasked, and tell effects apart."""
        return any(one.motion == "surface" and not one.calm for one in self.vehicles)

    @cached_property
    def calm(self) -> World:
        """The same without waves."""
        still = tuple(replace(one, calm=True) for one in self.vehicles)
        return replace(self, vehicles=still, same_unknowns=self.every)

    def driven(self, courses: Sequence[CourseCommands]) -> Drive:
        """A drive of courses, one a stage, all of one length."""
        step = 1.0 / self.computed_hz
        states = []
        for vehicle, course in zip(self.vehicles, courses, strict=True):
            whole = travelled(vehicle, course)
            count = max(math.floor((len(course) - 1) * STEP_S / step + 1e-9), 1)
            states.append(whole.at(step * np.arange(count + 1, dtype=np.float64)))
        return self._beside(apart(self.vehicles, states))

    def _beside(self, states: Sequence[PathStates]) -> Drive:
        """A drive with what it aims at; beside the targets where they are there already."""
        if self.surveyed is not None:
            shift = beside(self.vehicles[-1], states[-1].position_m, self.surveyed)
            states = [replace(one, position_m=one.position_m + shift) for one in states]
        return drive(self.system, self.vehicles, states, self.surveyed)

    def turned_about(self, courses: Sequence[CourseCommands]) -> list[Drive]:
        """A drive of courses at all four headings."""
        whole = self.driven(courses)
        every = [turned(whole, QUARTER_RAD * h) for h in range(4)]
        return every if self.surveyed is None else [self._beside(one.states) for one in every]

    def view(self, driven: Drive) -> Scene:
        """The log of a drive beside the system."""
        log = planned_log(self.system, driven)
        return scene(self.system, log, acting_of(self.system))

    def noise(self, view: Scene) -> tuple[Structure, NoiseLevel]:
        """Its noise; where the log has more rows than are computed, each counts for several."""
        structure, level = expected_noise(view, self.measured)
        share = math.sqrt(self.computed_hz / self.rate_hz)
        factor = tuple(share * f for f in level.factor)
        return structure, NoiseLevel(factor, level.slow, level.time_constant_s, level.size)

    def columns(self, view: Scene, after: Array | None = None) -> Array:
        """Slopes by every unknown, what pairs are beyond first order, what the noise shifts."""
        first = with_shift(view, self.every, after)
        beyond = [one.columns(view) for one in self.beyond]
        return np.concatenate([first[:, :, :-1], *beyond, first[:, :, -1:]], axis=2)

    def courses_of(self, stage: int, course: CourseCommands) -> list[CourseCommands]:
        """One stage drives, the others hold."""
        return [
            course if k == stage else held(vehicle, len(course))
            for k, vehicle in enumerate(self.vehicles)
        ]

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """Every leg of every stage's vehicle."""
        return tuple(leg for k, v in enumerate(self.vehicles) for leg in library(v, k))

    @cached_property
    def every(self) -> tuple[Unknown, ...]:
        """All unknowns, as a drive of one turning leg shows them."""
        if self.same_unknowns is not None:
            return self.same_unknowns
        return unknowns(self._turning)

    def with_asked(self, labels: Collection[tuple[str, str, int]]) -> World:
        """The same with what is asked for by name, though that drive hardly shows it."""
        more = tuple(u for u in hardly_moved(self._turning) if u.candidate.label in labels)
        return replace(self, same_unknowns=(*self.every, *more))

    @cached_property
    def _turning(self) -> Scene:
        """A drive of one turning leg."""
        turning = next((g for g in self.legs if g.name == "figure eight"), self.legs[0])
        return self.view(self.driven(self.courses_of(turning.stage, turning.course)))

    def looked_at(self, legs: Sequence[Leg]) -> tuple[LegTold, ...]:
        """What each of some legs alone would tell, at four headings; all looked at as one log."""
        flown = []
        for leg in legs:
            in_force().check()
            courses = self.courses_of(leg.stage, leg.course)
            flown += [planned_log(self.system, one) for one in self.turned_about(courses)]
        parts = self._apart(flown)
        return tuple(self._summed(leg, parts[4 * k : 4 * k + 4]) for k, leg in enumerate(legs))

    def alone(self, legs: Sequence[Leg]) -> tuple[Array, ...]:
        """Information from drives of one leg each, the run up to it with it; as one log, too."""
        flown = []
        for leg in legs:
            in_force().check()
            begun = transition(self.vehicles[leg.stage], 0.0, leg.begins_mps)
            courses = self.courses_of(leg.stage, joined([begun, leg.course]))
            flown.append(planned_log(self.system, self.driven(courses)))
        return tuple(now for now, _, _ in self._apart(flown))

    def _apart(self, flown: Sequence[Log]) -> list[tuple[Array, Array, Array]]:
        """G00, G0d + Gd0 and Gdd of each of some logs, looked at as the runs of one."""
        whole, ends = one_after_another(flown, GAP_S)
        view = scene(self.system, whole, acting_of(self.system))
        after = np.concatenate([late(whole.time_s[a:b]) for a, b in pairwise(ends) if b > a])
        noise, slopes, known = self.noise(view), self.columns(view, after), len(self.every)
        drifts = drift_columns(view, self.every, slopes[:, :, :known], after)
        slopes[:, :, :known] -= _since(whole.time_s, ends)[:, None, None] * drifts
        drifting = np.flatnonzero(np.any(drifts != 0.0, axis=(0, 1)))
        both = np.concatenate([slopes, drifts[:, :, drifting]], axis=2)
        count = slopes.shape[2]
        return [self._told(noise, both, slice(*pair), drifting, count) for pair in pairwise(ends)]

    def _told(
        self,
        noise: tuple[Structure, NoiseLevel],
        both: Array,
        rows: slice,
        drifting: Index,
        count: int,
    ) -> tuple[Array, Array, Array]:
        """G00, G0d + Gd0 and Gdd of some rows; count: of the columns before the drifts."""
        in_force().check()
        cross, twice = np.zeros((count, count)), np.zeros((count, count))
        if rows.stop - rows.start < 2:
            return cross, cross, twice
        found = fisher(noise[0].rows(rows), noise[1], both[rows])
        cross[:, drifting] = found[:count, count:]
        twice[np.ix_(drifting, drifting)] = found[count:, count:]
        return found[:count, :count], cross + cross.T, twice

    def _summed(self, leg: Leg, parts: Sequence[tuple[Array, Array, Array]]) -> LegTold:
        now, once, twice = (np.array([p[k] for p in parts]) for k in range(3))
        return self._placeable(leg, now, once, twice)

    def unjudged(self, leg: Leg) -> LegTold:
        """A leg with how it is placed alone, to ask whether it fits."""
        return self._placeable(leg, *(np.zeros((4, 1, 1)) for _ in range(3)))

    def _placeable(self, leg: Leg, now: Array, once: Array, twice: Array) -> LegTold:
        """A leg with what it tells and how it is placed."""
        vehicle = self.vehicles[leg.stage]
        path = travelled(vehicle, leg.course)
        turns_s = _turns_s(vehicle, leg.begins_mps)
        return LegTold(
            leg,
            now,
            once,
            twice,
            _swept(path),
            float(path.euler_rad[-1, 2]),
            turns_s,
            self._rooms[leg.stage],
            _runs_m(vehicle, leg, path),
        )

    @cached_property
    def _rooms(self) -> tuple[Room | None, ...]:
        """Where each stage's vehicle has to stay."""
        return tuple(
            None
            if one.area_m is None
            else Room(
                one.area_m,
                tuple(
                    _swept(travelled(one, transition(one, QUARTER_RAD * k))) for k in range(-2, 3)
                ),
            )
            for one in self.vehicles
        )


def _turns_s(vehicle: Vehicle, begins_mps: float | None) -> tuple[float, float]:
    """Time straight on to a leg, and of a turn about to it; who begins at rest does not turn."""
    straight = transition(vehicle, 0.0, begins_mps).duration_s
    if begins_mps == 0.0 and not vehicle.hovers:
        return straight, math.inf
    return straight, transition(vehicle, math.pi, begins_mps).duration_s


def _swept(path: PathStates) -> Swept:
    (south, north), (west, east) = (
        (float(own.min() - own[0]), float(own.max() - own[0])) for own in path.position_m.T[:2]
    )
    north_m, east_m = (float(v) for v in path.position_m[-1, :2] - path.position_m[0, :2])
    return Swept((north_m, east_m), (south, north, west, east))


def _runs_m(vehicle: Vehicle, leg: Leg, path: PathStates) -> tuple[float, float]:
    """Run-up and run-out of a drive that one leg begins and ends.

    Where a leg begins at a speed of its own, the way straight on to it is that much longer.
    """
    begins = vehicle.join_mps if leg.begins_mps is None else leg.begins_mps
    ends = float(np.linalg.norm(path.velocity_mps[-1, :2]))
    further_m = (begins - vehicle.join_mps) * transition(vehicle, 0.0, begins).duration_s
    return vehicle.run_m(begins) + max(further_m, 0.0), vehicle.run_m(ends)


def _since(time_s: Array, ends: Sequence[int]) -> Array:
    """How long after the very first row each run began, by row."""
    found = np.zeros_like(time_s)
    for begun, end in pairwise(ends):
        if end > begun:
            found[begun:end] = time_s[begun] - time_s[0]
    return found


def held(vehicle: Vehicle, steps: int) -> CourseCommands:
    """What a vehicle does while another one drives: hover, or wide circles.

    At the speed at which legs join: slower, it would have to brake at once where its leg ends.
    """
    speed = np.full(steps, vehicle.join_mps)
    zero = np.zeros(steps)
    return CourseCommands(
        speed, zero, zero, np.full(steps, 0.5 * vehicle.turn_radps(vehicle.join_mps))
    )


@dataclass(frozen=True, slots=True)
class DrivenLeg:
    """One leg in a whole drive: from when to when, the heading it begins at and the turn to that,
    with which it begins [rad]."""

    leg: Leg
    from_s: float
    to_s: float
    heading_rad: float
    turn_rad: float


def whole_drive(
    world: World, sequence: Sequence[LegTold]
) -> tuple[tuple[DrivenLeg, ...], list[CourseCommands]]:
    """The legs one after the other with the turns between them: stretches and courses by stage."""
    parts: list[list[CourseCommands]] = [[] for _ in world.vehicles]
    found, steps = [], 0
    for placed in arranged(sequence):
        leg = placed.told.leg
        begun = steps
        turn = transition(world.vehicles[leg.stage], placed.turn_rad, leg.begins_mps)
        for course in (turn, leg.course):
            for own, one in zip(parts, world.courses_of(leg.stage, course), strict=True):
                own.append(one)
            steps += len(course)
        heading_rad = QUARTER_RAD * placed.heading
        found.append(DrivenLeg(leg, begun * STEP_S, steps * STEP_S, heading_rad, placed.turn_rad))
    return tuple(found), [joined(own) for own in parts]


def steered_s(world: World, sequence: Sequence[LegTold]) -> float:
    """Time of the legs with the turns between them, to the step that is steered."""
    return whole_drive(world, sequence)[0][-1].to_s


@dataclass(frozen=True, eq=False)
class WholeDrive:
    """A whole drive with the information of all unknowns after each of its legs."""

    stretches: tuple[DrivenLeg, ...]
    driven: Drive
    view: Scene
    after: tuple[Array, ...]
    slopes: Array
    noise: tuple[Structure, NoiseLevel]
    sequence: tuple[LegTold, ...]


def whole_information(world: World, sequence: Sequence[LegTold]) -> Array:
    """Information of all unknowns from all rows of the whole drive."""
    _, courses = whole_drive(world, sequence)
    view = world.view(world.driven(courses))
    structure, level = world.noise(view)
    return fisher(structure, level, world.columns(view))


def outcome(world: World, sequence: Sequence[LegTold]) -> WholeDrive:
    """The whole drive judged: information after every leg, from all rows up to its end."""
    stretches, courses = whole_drive(world, sequence)
    driven = world.driven(courses)
    view = world.view(driven)
    slopes = world.columns(view)
    structure, level = world.noise(view)
    after = []
    for one in stretches:
        in_force().check()
        rows = slice(0, int(np.searchsorted(view.log.time_s, one.to_s)))
        after.append(fisher(structure.rows(rows), level, slopes[rows]))
    return WholeDrive(
        stretches, driven, view, tuple(after), slopes, (structure, level), tuple(sequence)
    )
