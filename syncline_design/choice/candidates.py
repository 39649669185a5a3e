"""What may take one role of a case: every sensor with every way of stamping it, as columns.

Formulas (E. R. Jellum et al., arXiv:2209.01136v2, and the design rules):
sensor error per role: sigma_p; sigma_Theta d; sigma_r + sigma_u d (eq. sensor_error_ub);
own tau_crit = that error / rate, rate v_max for position, v_max + d omega_max otherwise
(eq. t_crit per sensor).  An option that is looked at is worked out in fractions and rounded once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction
from typing import overload

import numpy as np

from syncline_design.choice.exclusions import Excluded, Exclusions
from syncline_design.choice.option import Names, Option
from syncline_design.choice.options import (
    RESOURCES,
    Bools,
    Floats,
    Indices,
    Options,
    Spent,
    numbered,
    ranked,
)
from syncline_design.choice.prices import amount_of, resources_of
from syncline_design.choice.stage_motion import (
    StageMotion,
    bends_of,
    motion_of,
    own_rate,
    range_sigma,
    sensor_error,
    underway_m,
)
from syncline_design.choice.table import Limits, RoleTable
from syncline_design.choice.ways import Way, ways_of_stamping
from syncline_design.machine.deadline import unhurried
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName
from syncline_design.spec.barred import barred_sensor, surroundings
from syncline_design.spec.case import Case, RoleCase, StageCase
from syncline_design.spec.catalog import (
    SensorEntry,
)
from syncline_design.spec.exact import fraction_of
from syncline_design.spec.existence import (
    SOUND_MPS,
    RuledOut,
    Surroundings,
    interval_of,
    is_acoustic,
    out_of_reach,
    spacing_m,
    strongest,
    too_sparse,
)


@dataclass(frozen=True, slots=True)
class SensorEffects:
    """What known effects add where one sensor takes a role: its whole extra tau, exactly the
    systematic errors that hang on it (with `underway_m`), and their share in proportion to its
    noise."""

    tau_s: float = 0.0
    systematic_m: Fraction = Fraction(0)
    noise_m: Fraction = Fraction(0)

    def and_underway(self, more_m: Fraction) -> SensorEffects:
        """With what moves while samples are apart or sound is under way [m]."""
        return replace(self, systematic_m=self.systematic_m + more_m) if more_m else self


BySensor = Mapping[tuple[str, RoleName, str], SensorEffects]  # stage name, role, sensor
NO_SENSOR: BySensor = {}
NO_WAY = np.array([-1], dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Every candidate of one role, in the order of the spec: a sensor and a way of stamping it.

    barred: why a sensor cannot work here at any distance and speed; near, far: between which
    distances [m] each measures; rate, sound: how often [1/s], and at which speed of sound [m/s];
    works: whether it measures at this distance, and often enough.  ways_of: numbers of the ways of
    stamping each sensor; sensor, way: of each row (way -1: stands for the sensor, where it cannot
    work here); fixed, turned: terms of each sensor's error, [m] and [m] per metre of distance.
    """

    case: Case
    stage: StageCase
    role: RoleCase
    motion: StageMotion
    effects: tuple[SensorEffects, ...]
    barred: tuple[RuledOut | None, ...]
    ways: tuple[Way, ...]
    ways_of: tuple[Indices, ...]
    sensor: Indices
    way: Indices
    fixed: Floats
    turned: Floats
    near: Floats
    far: Floats
    rate: Floats
    sound: Floats
    works: Bools
    made: dict[int, Option] = field(default_factory=dict)

    def table(self, vehicle: int, limits: Limits) -> RoleTable:
        """The options that keep their own tau_crit, and what is excluded."""
        works = self.works[self.sensor]
        stands_for, fits = self.way < 0, np.array([*(one.fits for one in self.ways), False])
        fitting = ~stands_for & fits[self.way]
        barred = np.array([one is not None for one in self.barred], dtype=bool)[self.sensor]
        gone = np.where(stands_for, barred | ~works, ~fitting & works)
        here, rest = np.flatnonzero(fitting & works), np.flatnonzero(gone)
        pool, beyond = self._columns(np.flatnonzero(fitting)).parted(works[fitting])
        keeps = pool.keep_own_tau_crit(limits.sync)
        options, poor = pool.parted(keeps)
        order = np.argsort(np.concatenate([rest, here[~keeps]]), kind="stable")
        name, stage = self.stage.choice.name, self.stage.index
        excluded = Exclusions(_Records(self, rest), poor, order, beyond)
        ordered = options.take(options.by_name())
        return RoleTable(
            stage, name, self.role.role, vehicle, ordered, excluded, self.motion.distance,
            self.motion.speed, self.motion.nearest,
        )  # fmt: skip

    def moved(self, table: RoleTable, motion: StageMotion, limits: Limits) -> RoleTable:
        """A table of these candidates where the stage moves in another way."""
        there, pool = replace(self, motion=motion, made={}), table.anywhere()
        error, added, crit, nearer = (figure[pool.sensor] for figure in there._figures())
        pool = replace(
            pool, make=there.__call__, error=error, added=added, crit=crit, nearer=nearer
        )
        there_now = replace(
            table, distance_m=motion.distance, speed_mps=motion.speed, nearest_m=motion.nearest
        )
        return there_now.settled(pool, limits)

    @property
    def _rate(self) -> Fraction | None:
        """What its own tau_crit is taken against [m/s]; None where motion does not matter."""
        return own_rate(self.role.role, self.motion)

    @property
    def _near(self) -> StageMotion | None:
        """The near end of the stage's distances, where it matters to the role."""
        return None if self.role.role == "position" else self.motion.near_end

    def _figures(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Of each sensor: its error, what it adds to the total [m], its own tau_crit [s], and how
        much smaller the error is at the near end [m]."""
        error = self.fixed + self.turned * float(self.motion.distance)
        if not self.motion.lets_in(self.role.role):
            error = np.zeros(len(error))
        added = error.copy()
        for place, one in enumerate(self.effects):
            if one.systematic_m:
                added[place] = float(self._error(place) + one.systematic_m)
        rate = self._rate
        crit = np.full(len(error), math.inf) if rate is None else error / float(rate)
        nearer, near = np.zeros(len(error)), self._near
        if near is not None:
            nearer = self.turned * float(self.motion.distance - near.distance) + self._eased(near)
            slower = own_rate(self.role.role, near)
            if slower is not None:
                crit = np.minimum(crit, (error - nearer) / float(slower))
            for place, sensor in enumerate(self.role.sensors):
                for bend in bends_of(sensor.entry, self.role.role, self.motion):
                    crit[place] = min(crit[place], bend.crit_s)
        return error, added, crit, nearer

    def _eased(self, near: StageMotion) -> Floats:
        """By how much the range noise of each sensor is smaller at the near end [m]."""
        found = np.zeros(len(self.fixed))
        if self.role.role == "ranging":
            for place, one in enumerate(self.role.sensors):
                if "sigma_range" in one.entry.tables:
                    far, close = self.motion.distance, near.distance
                    eased = range_sigma(one.entry, far) - range_sigma(one.entry, close)
                    found[place] = float(eased)
        return found

    def _columns(self, rows: Indices) -> Options:
        """Options of some rows as columns."""
        sensors, ways = self.sensor[rows], self.way[rows]
        error, added, crit, nearer = (figure[sensors] for figure in self._figures())
        extra = np.array([one.tau_s for one in self.effects], dtype=float)
        tau = np.array([float(way.tau) for way in self.ways], dtype=float)
        needs = tuple(dict.fromkeys(way.requires for way in self.ways))
        need = np.array([needs.index(way.requires) for way in self.ways], dtype=np.intp)
        method = numbered([way.method for way in self.ways])
        host = np.array([way.timeline == "host" for way in self.ways], dtype=bool)
        return Options(
            self.__call__, rows, self._ranks(rows), sensors, method[ways], error, added,
            tau[ways] + extra[sensors], crit, nearer, self.near[sensors], self.far[sensors],
            self.rate[sensors], self.sound[sensors], host[ways],
            tuple(self._spent(sensors, ways)), needs, need[ways],
        )  # fmt: skip

    def _ranks(self, rows: Indices) -> Indices:
        """Places in the order of names."""
        sensor = ranked([one.id for one in self.role.sensors])
        way = ranked([(one.primitive, one.method) for one in self.ways])
        return np.asarray(sensor[self.sensor[rows]] * len(way) + way[self.way[rows]])

    def _spent(self, sensors: Indices, ways: Indices) -> Iterator[Spent]:
        for name in RESOURCES:
            own = Spent.of([amount_of(self.case, name, one.entry) for one in self.role.sensors])
            stamp = Spent.of([amount_of(self.case, name, way.entry) for way in self.ways])
            yield own.take(sensors).plus(stamp.take(ways))

    def _error(self, place: int) -> Fraction:
        """A sensor's term of the sensor-induced error [m], exactly."""
        return sensor_error(self.role.sensors[place].entry, self.role.role, self.motion)

    def names_of(self, rows: Indices) -> list[Names]:
        """The names of some rows, none of which stands for a sensor that cannot work here."""
        sensors, ways = self.role.sensors, self.ways
        return [
            (sensors[s].id, ways[w].primitive, ways[w].method)
            for s, w in zip(self.sensor[rows].tolist(), self.way[rows].tolist(), strict=True)
        ]

    def __call__(self, row: int) -> Option:
        """The option of one row."""
        if row not in self.made:
            self.made[row] = self._option(int(self.sensor[row]), self.ways[self.way[row]])
        return self.made[row]

    def _option(self, place: int, way: Way) -> Option:
        """A sensor with one way of stamping, worked out in fractions and rounded once."""
        sensor, effects, rate = self.role.sensors[place], self.effects[place], self._rate
        error, systematic = self._error(place), effects.systematic_m
        tau, near = way.tau + Fraction(effects.tau_s), self._near
        crits = [] if rate is None else [error / rate]
        near_error, near_rate = None, None
        if near is not None:
            near_error = sensor_error(sensor.entry, self.role.role, near)
            near_rate = own_rate(self.role.role, near)
            crits += [] if near_rate is None else [near_error / near_rate]
        bends = bends_of(sensor.entry, self.role.role, self.motion)
        crits += [one.error_m / one.rate_mps for one in bends if one.rate_mps]
        return Option(
            sensor=sensor.id,
            primitive=way.primitive,
            method=way.method,
            sensor_error_m=float(error),
            tau_s=float(tau),
            tau_crit_s=float(min(crits)) if crits else math.inf,
            timeline=way.timeline,
            resources=resources_of(self.case, sensor.entry, way.entry),
            requires=way.requires,
            exact_error_m=error,
            exact_tau_s=tau,
            systematic_m=float(systematic),
            exact_systematic_m=systematic if systematic else None,
            noise_systematic_m=effects.noise_m,
            own_rate_mps=rate,
            near_error_m=near_error,
            near_rate_mps=near_rate,
            bends=bends,
            reach_m=(float(self.near[place]), float(self.far[place])),
            rate_hz=_finite(sensor.entry.rate, self.rate[place]),
            sound_mps=_finite(self.stage.choice.sound_speed or SOUND_MPS, self.sound[place]),
        )

    def excluded(self, row: int) -> Excluded:
        """Why one row is no option."""
        place, number = int(self.sensor[row]), int(self.way[row])
        name = self.role.sensors[place].id
        if number < 0:
            ways = [self.ways[k] for k in self.ways_of[place].tolist()]
            fitting = [self._option(place, way) for way in ways if not way.offered]
            return _impossible(name, "", "", self._why(place), fitting)
        way = self.ways[number]
        if way.barred is not None:
            options = [self._option(place, way)]
            return _impossible(name, way.primitive, way.method, way.barred, options)
        reason = f"{way.method} serves {way.served}; {name} has {way.offered}"
        if self.role.inline is not None:
            reason = f"{way.offered} is asked for; {name} has {way.served}"
        return Excluded(name, "", way.method, reason, figure=way.served, limit=way.offered)

    def _why(self, place: int) -> RuledOut:
        """Why a sensor cannot work here, its strongest reason."""
        sensor, barred = self.role.sensors[place], self.barred[place]
        around = surroundings(self.case, self.stage)
        found = [] if barred is None else [barred]
        if sensor.entry.modality == "ranging":
            found += out_of_reach(sensor.id, sensor.entry, around)
            found += too_sparse(sensor.id, sensor.entry, around)
        return strongest(found)


@dataclass(frozen=True, slots=True)
class _Records(Sequence[Excluded]):
    """Records of rows that are no options, each made where it is asked for."""

    candidates: Candidates
    rows: Indices

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, place: int) -> Excluded: ...
    @overload
    def __getitem__(self, place: slice) -> list[Excluded]: ...
    def __getitem__(self, place: int | slice) -> Excluded | list[Excluded]:
        if isinstance(place, slice):
            return list(map(self.candidates.excluded, self.rows[place].tolist()))
        return self.candidates.excluded(int(self.rows[place]))


def candidates(
    case: Case, stage: StageCase, role: RoleCase, usual: SensorEffects, by_sensor: BySensor
) -> Candidates:
    """Every (sensor, primitive, method) that the spec lets a role take, or why it cannot.

    usual: what known effects add where by_sensor does not say.
    """
    ways: list[Way] = []
    by_signals: dict[tuple[str, ...], Indices] = {}
    barred, of_sensor, terms, limited = [], [], [], []
    around = surroundings(case, stage)
    for sensor in unhurried(role.sensors):
        signals = tuple(sensor.entry.serves)
        if signals not in by_signals:
            found = list(ways_of_stamping(case, stage, role, sensor.entry))
            by_signals[signals] = np.arange(len(ways), len(ways) + len(found))
            ways += found
        of_sensor.append(by_signals[signals])
        barred.append(barred_sensor(case, stage, around, sensor))
        limited.append(_limited(sensor.entry, around))
        terms.append(_error_terms(sensor.entry, role.role))
    near, far, rate, sound, works = np.array(limited, dtype=float).reshape(-1, 5).T
    shown = [
        NO_WAY if bar is not None else own if work else np.append(NO_WAY, own)
        for own, bar, work in zip(of_sensor, barred, works.tolist(), strict=True)
    ]
    fixed, turned = np.array(terms, dtype=float).reshape(-1, 2).T
    name = stage.choice.name
    motion = motion_of(stage)
    effects = tuple(
        by_sensor.get((name, role.role, one.id), usual).and_underway(
            underway_m(one.entry, role.role, motion, case, stage)
        )
        for one in role.sensors
    )
    sensors = np.repeat(np.arange(len(shown)), [len(own) for own in shown])
    return Candidates(
        case, stage, role, motion, effects, tuple(barred), tuple(ways), tuple(of_sensor),
        sensors, np.concatenate([NO_WAY[:0], *shown]), fixed, turned, near, far,
        rate, sound, works > 0.0,
    )  # fmt: skip


def _limited(sensor: SensorEntry, around: Surroundings) -> tuple[float, float, float, float, bool]:
    """Reach [m], rate [1/s] and speed of sound [m/s] of a sensor, and whether it works here.

    Rates are those of ranging sensors, whose samples are asked for.
    """
    near, far = interval_of(sensor, around.reflectivity)
    if sensor.modality != "ranging":
        return near, far, math.inf, math.inf, True
    works = near <= around.nearest and around.farthest <= far
    if works and around.spacing is not None:
        apart = spacing_m(sensor, around)
        works = apart is None or apart <= around.spacing
    sound = around.sound_speed if is_acoustic(sensor.type) else math.inf
    return near, far, sensor.rate or math.inf, sound, works


def _finite(value: float | None, column: float) -> Fraction | None:
    """A figure exactly, where it delays anything."""
    return None if value is None or math.isinf(column) else fraction_of(value)


def _error_terms(sensor: SensorEntry, role: RoleName) -> tuple[float, float]:
    """A sensor's error as [m] and [m] per metre of distance (eq. sensor_error_ub)."""
    if role == "position":
        return _norm(sensor.sigma_position, 3), 0.0
    if role == "attitude":
        return 0.0, _norm(sensor.sigma_attitude, 3)
    return float(sensor.sigma_range or 0.0), _norm(sensor.sigma_bearing, 2)


def _norm(figures: float | Sequence[float] | None, axes: int) -> float:
    """Euclidean norm over the axes; one figure holds for each of them."""
    if figures is None or isinstance(figures, float | int):
        return math.sqrt(axes) * abs(figures or 0.0)
    return math.hypot(*figures)


def _impossible(
    sensor: str, primitive: str, method: str, barred: RuledOut, options: list[Option]
) -> Excluded:
    """The record of what cannot work on its stage, with the options that it takes along."""
    return Excluded(
        sensor, primitive, method, barred.reason, code=barred.code, figure=barred.figure,
        limit=barred.limit, impossible=tuple(options),
    )  # fmt: skip
