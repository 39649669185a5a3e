"""What may take one role of a case: every sensor with every way of stamping it, as columns.

Formulas (E. R. Jellum et al., arXiv:2209.01136v2, and the design rules):
sensor error per role: sigma_p; sigma_Theta d; sigma_r + sigma_u d (eq. sensor_error_ub);
own tau_crit = that error / rate, rate v_max for position, v_max + d omega_max otherwise
(eq. t_crit per sensor).  An option that is looked at is worked out in fractions and rounded once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Literal, overload

import numpy as np

from syncline_design.choice.exclusions import Excluded, Exclusions
from syncline_design.choice.options import (
    EVERYWHERE,
    RESOURCES,
    Bools,
    Floats,
    Indices,
    Option,
    Options,
    Requires,
    ResourceName,
    Resources,
    Spent,
    numbered,
    ranked,
)
from syncline_design.choice.table import RoleTable
from syncline_design.machine.deadline import unhurried
from syncline_design.model.quantity import Quantity
from syncline_design.model.roles import RoleName
from syncline_design.spec.barred import barred_method, barred_sensor, surroundings
from syncline_design.spec.case import Case, RoleCase, StageCase, usable_primitives
from syncline_design.spec.catalog import (
    ClockEntry,
    InfrastructureEntry,
    SensorEntry,
    TimestampingEntry,
)
from syncline_design.spec.exact import fraction_of, norm, tau_bound
from syncline_design.spec.existence import RuledOut, interval_of, out_of_reach

INLINE = "inline"


@dataclass(frozen=True, slots=True)
class SensorEffects:
    """What known effects add where one sensor takes a role: its whole extra tau, exactly the
    systematic errors that hang on it, and their share in proportion to its noise."""

    tau_s: float = 0.0
    systematic_m: Fraction = Fraction(0)
    noise_m: Fraction = Fraction(0)


BySensor = Mapping[tuple[str, RoleName, str], SensorEffects]  # stage name, role, sensor
NO_SENSOR: BySensor = {}
NO_WAY = np.array([-1], dtype=np.intp)


@dataclass(frozen=True, slots=True)
class Motion:
    """How a stage moves, exactly: v_max [m/s], d [m] (0 without ranging), omega_max [rad/s]."""

    speed: Fraction
    distance: Fraction
    turn: Fraction
    ranges: bool

    def lets_in(self, role: RoleName) -> bool:
        """Whether a role's noise enters the error: attitude alone does not."""
        return self.ranges or role == "position"

    @property
    def turning(self) -> Fraction:
        """d omega_max [m/s]."""
        return self.distance * self.turn

    @property
    def rate(self) -> Fraction:
        """v_max + d omega_max [m/s]."""
        return self.speed + self.turning


def sensor_error(sensor: SensorEntry, role: RoleName, motion: Motion) -> Fraction:
    """A role's term of the sensor-induced error [m] (eq. sensor_error_ub)."""
    if not motion.lets_in(role):
        return Fraction(0)
    if role == "position":
        return norm(sensor.sigma_position or 0.0, 3)
    if role == "attitude":
        return norm(sensor.sigma_attitude or 0.0, 3) * motion.distance
    bearing = norm(sensor.sigma_bearing or 0.0, 2) * motion.distance
    return fraction_of(sensor.sigma_range or 0.0) + bearing


def motion_of(stage: StageCase) -> Motion:
    """How the platform of a stage moves."""
    platform, ranges = stage.platform.entry, stage.role("ranging") is not None
    distance = fraction_of(platform.distance) if ranges else Fraction(0)
    return Motion(fraction_of(platform.v_max), distance, fraction_of(platform.omega_max), ranges)


@dataclass(frozen=True, slots=True)
class _Way:
    """One way of stamping: a primitive and a method, or why it is none.

    entry: None where the spec gives the error in place; barred: why it cannot work on this stage;
    served, offered: what does not fit one another.
    """

    primitive: str
    method: str
    tau: Fraction = Fraction(0)
    timeline: Literal["host", "utc"] = "host"
    entry: TimestampingEntry | None = None
    requires: Requires = ()
    barred: RuledOut | None = None
    served: str = ""
    offered: str = ""

    @property
    def fits(self) -> bool:
        """Whether it is an option, poor as it may be."""
        return self.barred is None and not self.offered


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Every candidate of one role, in the order of the spec: a sensor and a way of stamping it.

    barred: why a sensor cannot work here at any distance; near, far: between which distances [m]
    each measures.  ways_of: numbers of the ways of stamping each sensor; sensor, way: of each row
    (way -1: stands for the sensor, where it cannot work here); fixed, turned: terms of each
    sensor's error, [m] and [m] per metre of distance.
    """

    case: Case
    stage: StageCase
    role: RoleCase
    motion: Motion
    effects: tuple[SensorEffects, ...]
    barred: tuple[RuledOut | None, ...]
    ways: tuple[_Way, ...]
    ways_of: tuple[Indices, ...]
    sensor: Indices
    way: Indices
    fixed: Floats
    turned: Floats
    near: Floats
    far: Floats
    made: dict[int, Option] = field(default_factory=dict)

    def table(self, vehicle: int, sync_limit: float) -> RoleTable:
        """The options that keep their own tau_crit, and what is excluded."""
        works = self._reaches(self.motion)[self.sensor]
        stands_for, fits = self.way < 0, np.array([*(one.fits for one in self.ways), False])
        fitting = ~stands_for & fits[self.way]
        barred = np.array([one is not None for one in self.barred], dtype=bool)[self.sensor]
        gone = np.where(stands_for, barred | ~works, ~fitting & works)
        here, rest = np.flatnonzero(fitting & works), np.flatnonzero(gone)
        pool, beyond = self._columns(np.flatnonzero(fitting)).parted(works[fitting])
        keeps = pool.keep_own_tau_crit(sync_limit)
        options, poor = pool.parted(keeps)
        order = np.argsort(np.concatenate([rest, here[~keeps]]), kind="stable")
        name, stage = self.stage.choice.name, self.stage.index
        excluded = Exclusions(_Records(self, rest), poor, order, beyond)
        ordered = options.take(options.by_name())
        return RoleTable(stage, name, self.role.role, vehicle, ordered, excluded)

    def moved(self, table: RoleTable, motion: Motion, sync_limit: float) -> RoleTable:
        """A table of these candidates where the stage moves in another way."""
        there, pool = replace(self, motion=motion, made={}), table.anywhere()
        error, added, crit = (figure[pool.sensor] for figure in there._figures())
        pool = replace(pool, make=there.__call__, error=error, added=added, crit=crit)
        here, beyond = pool.parted(self._reaches(motion)[pool.sensor])
        return table.with_pool(here, sync_limit, beyond)

    def _reaches(self, motion: Motion) -> Bools:
        """Which sensors measure at a stage's distance."""
        distance = float(motion.distance)
        return np.asarray((self.near <= distance) & (distance <= self.far))

    @property
    def _rate(self) -> Fraction | None:
        """What its own tau_crit is taken against [m/s]; None where motion does not matter."""
        rate = self.motion.speed if self.role.role == "position" else self.motion.rate
        return rate if self.motion.lets_in(self.role.role) and rate > 0 else None

    def _figures(self) -> tuple[Floats, Floats, Floats]:
        """Of each sensor: its error, what it adds to the total [m] and its own tau_crit [s]."""
        error = self.fixed + self.turned * float(self.motion.distance)
        if not self.motion.lets_in(self.role.role):
            error = np.zeros(len(error))
        added = error.copy()
        for place, one in enumerate(self.effects):
            if one.systematic_m:
                added[place] = float(self._error(place) + one.systematic_m)
        rate = self._rate
        crit = np.full(len(error), math.inf) if rate is None else error / float(rate)
        return error, added, crit

    def _columns(self, rows: Indices) -> Options:
        """Options of some rows as columns."""
        sensors, ways = self.sensor[rows], self.way[rows]
        error, added, crit = (figure[sensors] for figure in self._figures())
        extra = np.array([one.tau_s for one in self.effects], dtype=float)
        tau = np.array([float(way.tau) for way in self.ways], dtype=float)
        needs = tuple(dict.fromkeys(way.requires for way in self.ways))
        need = np.array([needs.index(way.requires) for way in self.ways], dtype=np.intp)
        method = numbered([way.method for way in self.ways])
        host = np.array([way.timeline == "host" for way in self.ways], dtype=bool)
        return Options(
            self.__call__, rows, self._ranks(rows), sensors, method[ways], error, added,
            tau[ways] + extra[sensors], crit, self.near[sensors], self.far[sensors], host[ways],
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

    def __call__(self, row: int) -> Option:
        """The option of one row."""
        if row not in self.made:
            self.made[row] = self._option(int(self.sensor[row]), self.ways[self.way[row]])
        return self.made[row]

    def _option(self, place: int, way: _Way) -> Option:
        """A sensor with one way of stamping, worked out in fractions and rounded once."""
        sensor, effects, rate = self.role.sensors[place], self.effects[place], self._rate
        error, systematic = self._error(place), effects.systematic_m
        tau = way.tau + Fraction(effects.tau_s)
        return Option(
            sensor=sensor.id,
            primitive=way.primitive,
            method=way.method,
            sensor_error_m=float(error),
            tau_s=float(tau),
            tau_crit_s=math.inf if rate is None else float(error / rate),
            timeline=way.timeline,
            resources=resources_of(self.case, sensor.entry, way.entry),
            requires=way.requires,
            exact_error_m=error,
            exact_tau_s=tau,
            systematic_m=float(systematic),
            exact_systematic_m=systematic if systematic else None,
            noise_systematic_m=effects.noise_m,
            own_rate_mps=rate,
            reach_m=(float(self.near[place]), float(self.far[place])),
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
        """Why a sensor cannot work here: how far it reaches comes first."""
        sensor, barred = self.role.sensors[place], self.barred[place]
        short = next(out_of_reach(sensor.id, sensor.entry, surroundings(self.stage)), barred)
        assert short is not None
        return short


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
    ways: list[_Way] = []
    by_signals: dict[tuple[str, ...], Indices] = {}
    barred, of_sensor, terms, reach = [], [], [], []
    around = surroundings(stage)
    for sensor in unhurried(role.sensors):
        signals = tuple(sensor.entry.serves)
        if signals not in by_signals:
            found = list(_ways(case, stage, role, sensor.entry))
            by_signals[signals] = np.arange(len(ways), len(ways) + len(found))
            ways += found
        of_sensor.append(by_signals[signals])
        barred.append(barred_sensor(case, stage, around, sensor))
        reach.append(interval_of(sensor.entry, around.reflectivity))
        terms.append(_error_terms(sensor.entry, role.role))
    shown = [
        NO_WAY if bar is not None else own if limits == EVERYWHERE else np.append(NO_WAY, own)
        for own, bar, limits in zip(of_sensor, barred, reach, strict=True)
    ]
    near, far = np.array(reach, dtype=float).reshape(-1, 2).T
    fixed, turned = np.array(terms, dtype=float).reshape(-1, 2).T
    name = stage.choice.name
    effects = tuple(by_sensor.get((name, role.role, one.id), usual) for one in role.sensors)
    sensors = np.repeat(np.arange(len(shown)), [len(own) for own in shown])
    return Candidates(
        case, stage, role, motion_of(stage), effects, tuple(barred), tuple(ways), tuple(of_sensor),
        sensors, np.concatenate([NO_WAY[:0], *shown]), fixed, turned, near, far,
    )  # fmt: skip


def _ways(case: Case, stage: StageCase, role: RoleCase, sensor: SensorEntry) -> Iterator[_Way]:
    """Every way of stamping a sensor of these signals, or why it is none.

    Where the spec gives the error in place, a primitive that is pinned has to be the sensor's.
    """
    pinned, factor = role.choice.primitive, case.spec.coverage_factor
    if role.inline is not None:
        if pinned is not None and pinned not in sensor.serves:
            yield _Way("", INLINE, served=", ".join(sensor.serves), offered=pinned)
            return
        tau, timeline = tau_bound(role.inline.error, factor), role.inline.timeline
        yield _Way(pinned or INLINE, INLINE, tau, "utc" if timeline == "utc" else "host")
        return
    for method in role.methods:
        entry = method.entry
        timeline = "utc" if entry.timeline == "utc" else "host"
        primitives = usable_primitives(sensor, entry, pinned)
        barred = barred_method(case, stage, method)
        tau, requires = tau_bound(entry.error, factor), tuple(sorted(entry.requires.items()))
        for primitive in primitives:
            yield _Way(primitive, method.id, tau, timeline, entry, requires, barred)
        if not primitives:
            offered = pinned or ", ".join(sensor.serves)
            yield _Way("", method.id, served=", ".join(entry.primitives), offered=offered)


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


Priced = SensorEntry | TimestampingEntry | ClockEntry | InfrastructureEntry


def resources_of(case: Case, *entries: Priced | None) -> Resources:
    """Sums over entries; None where one of them does not say."""
    sums: dict[str, Fraction | None] = {}
    for name in RESOURCES:
        amounts = [amount_of(case, name, entry) for entry in entries]
        known = [amount for amount in amounts if amount is not None]
        sums[name] = sum(known, Fraction(0)) if len(known) == len(amounts) else None
    return Resources(**sums)


def amount_of(case: Case, name: ResourceName, entry: Priced | None) -> Fraction | None:
    """What an entry takes; None where it does not say, or in a currency without a rate (loading
    refuses those of a spec's own).  Without an entry: nothing."""
    if entry is None:
        return Fraction(0)
    amount = getattr(entry, name)
    if name == "cost" and isinstance(amount, Quantity):
        return case.spec.in_currency(amount) if case.spec.can_convert(amount) else None
    return None if amount is None else fraction_of(amount)
