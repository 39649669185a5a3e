"""Every requirement of a chosen design anew, from the spec, in 60-digit decimals.

The proof behind a PASS: it takes the loaded spec and the names of what was chosen, and shares no
code with the model, the tables or the solvers.  Formulas (E. R. Jellum et al., arXiv:2209.01136v2):
  sensor error  = sum of sigma_p + sigma_r + (sigma_Theta + sigma_u) d      (eq. sensor_error_ub)
  sync error    = (v_max + d omega_max) tau_sys, summed over stages         (eq. sync_error_ub)
  tau_crit      = sensor error / (v_max + d omega_max)                      (eq. t_crit)
tau_sys is the largest bound of any two timestamps that meet: tau_a + tau_ref + offset of their
timelines; a stage without a ranging sensor meets true time, which is UTC.  Where stages give two
ends of a distance, all of it is computed at every combination of ends, and the largest counts.
A figure is rounded to a float once, at the end, and that float is compared with the limit: a
printed limit that is met exactly passes, one that is missed by 1e-12 does not.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from typing import Any, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import NOTHING_KNOWN, Case, Known, RoleCase, StageCase
from syncline_design.spec.catalog import SensorEntry
from syncline_design.spec.requirement import SUMMED_KINDS
from syncline_design.spec.selection import RoleSelection, Selection
from syncline_design.verdict.recheck_facts import impossible, sample_spacing, underway
from syncline_design.verdict.recheck_noise import bends, sigma_at
from syncline_design.verdict.recheck_sums import (
    BUDGETS,
    RecheckedPieces,
    money,
    owned_pieces,
    sum_of,
)

DIGITS = 60
IMPLIED_SYNC = "SYNC"
IMPLIED_FACTS = "FACTS"  # fails where a chosen entry cannot work where it stands
Kind = Literal["accuracy", "sync", "cost", "mass", "power", "sample_spacing", "feasible"]


class NotADesign(ValueError):  # noqa: N818 - names a state of the input
    """A selection that the spec does not allow."""


@dataclass(frozen=True, slots=True)
class Rechecked:
    """One requirement: its exact value and limit, and whether it is met.

    value None: a catalog entry does not say.  implied: no requirement of the spec says it.
    left_open: what is told keeps the limit, but an entry does not tell all of it.
    """

    id: str
    kind: Kind
    value: Fraction | None
    limit: Fraction
    passed: bool
    implied: bool = False
    note: str = ""
    left_open: bool = False

    @property
    def value_float(self) -> float | None:
        """The value, rounded once."""
        return None if self.value is None else float(self.value)


@dataclass(frozen=True, slots=True)
class Recheck:
    """All requirements but the Monte Carlo ones, and the sums behind them (m, s, m/s)."""

    requirements: tuple[Rechecked, ...]
    cost: Fraction | None
    mass: Fraction | None
    power: Fraction | None
    sensor_error_m: Fraction
    sync_rate_mps: Fraction
    tau_sys_s: Fraction
    sync_error_m: Fraction
    total_m: Fraction
    sync_ratio: Fraction
    owned: tuple[tuple[str, int], ...] = ()  # what is at no cost, with how many pieces it takes

    @property
    def passed(self) -> bool:
        """Whether every requirement is met."""
        return all(one.passed for one in self.requirements)


@dataclass(frozen=True, slots=True)
class _Chosen:
    """One role's entries: the sensor, its timestamp error, timeline and hardware."""

    sensor: Any
    bought: RecheckedPieces
    error: Any
    method: Any  # None for an error given in place
    timeline: str  # "utc" or the vehicle whose host clock it is
    tau: Decimal = field(default=Decimal(0))
    look: Any = None  # of its stage


def recheck(
    case: Case,
    selection: Selection,
    known: Known = NOTHING_KNOWN,
) -> Recheck:
    """Recompute every requirement of a selection, with what known effects add.

    Raises NotADesign where the spec does not allow a choice.
    """
    with localcontext(Context(prec=DIGITS)):
        return _recheck(case, selection, known)


def _recheck(case: Case, selection: Selection, known: Known) -> Recheck:
    chosen = _all_chosen(case, selection, known)
    names = [stage.choice.name for stage in case.stages]
    ends = itertools.product(*(_ends(stage, chosen) for stage in case.stages))
    found_at = [
        _figures(case, selection, chosen, dict(zip(names, moves, strict=True))) for moves in ends
    ]
    worst = max(found_at, key=lambda one: one.sensor_error + one.sync_error + one.underway)
    ratio = max(one.ratio for one in found_at)
    fixed = sum((Decimal(v) for *_, v in known.systematic), Decimal(0))
    total = worst.sensor_error + worst.sync_error + worst.underway + fixed
    bought = list(_bought(case, selection, chosen))
    amounts = {name: sum_of(case, bought, name) for name in BUDGETS}
    found: dict[str, Fraction | None] = {name: amounts[name] for name in BUDGETS}
    found |= {"accuracy": Fraction(total), "sync": Fraction(ratio)}
    found["sample_spacing"], silent = sample_spacing(case, selection)
    return Recheck(
        (*_facts(case, selection), *_requirements(case, found, silent)),
        amounts["cost"],
        amounts["mass"],
        amounts["power"],
        Fraction(worst.sensor_error),
        Fraction(worst.rate),
        Fraction(worst.tau_sys),
        Fraction(worst.sync_error),
        Fraction(total),
        Fraction(ratio),
        owned_pieces(case, bought),
    )


@dataclass(frozen=True, slots=True)
class _Figures:
    """Sums [m, m/s, s] with every stage's object at one distance, and the largest tau/tau_crit."""

    sensor_error: Decimal
    rate: Decimal
    tau_sys: Decimal
    sync_error: Decimal
    ratio: Decimal
    underway: Decimal


def _figures(
    case: Case,
    selection: Selection,
    chosen: Mapping[tuple[str, RoleName], _Chosen],
    moves: Mapping[str, Moves],
) -> _Figures:
    rate = sum((v + turning for v, turning, _ in moves.values()), Decimal(0))
    meets = list(_meetings(case, selection, chosen, moves))
    tau_sys = max((bound for bound, _ in meets), default=Decimal(0))
    errors = {key: _sensor_error(key[1], one, moves[key[0]]) for key, one in chosen.items()}
    sensor_error = sum(errors.values(), Decimal(0))
    sync_error = rate * tau_sys
    if case.spec.sync_model == "per_sensor":
        sync_error = sum((bound * speed for bound, speed in meets), Decimal(0))
    ratios = [_ratio(rate * tau_sys, sensor_error)]
    for (stage, role), one in chosen.items():
        ratios.append(_ratio(one.tau * _own_rate(role, moves[stage]), errors[stage, role]))
    away = {name: Fraction(d) for name, (_, _, d) in moves.items()}
    moved = underway(case, selection, away)
    moved_m = Decimal(moved.numerator) / Decimal(moved.denominator)
    return _Figures(sensor_error, rate, tau_sys, sync_error, max(ratios), moved_m)


def _decimal(value: float) -> Decimal:
    """A figure of a file, exactly as written."""
    exact = getattr(value, "exact", None)
    if exact is None:
        return Decimal(value)
    return Decimal(exact.numerator) / Decimal(exact.denominator)


def _length(figures: Any, axes: int) -> Decimal:
    """Root of the sum of squares; a single figure counts once per axis."""
    if not isinstance(figures, tuple):
        return _decimal(figures) * Decimal(axes).sqrt()
    return sum((_decimal(f) ** 2 for f in figures), Decimal(0)).sqrt()


def _all_chosen(
    case: Case, selection: Selection, known: Known
) -> dict[tuple[str, RoleName], _Chosen]:
    """Entries of every role that the spec fills, in its order."""
    out: dict[tuple[str, RoleName], _Chosen] = {}
    for stage in case.stages:
        for role in stage.roles:
            name = stage.choice.name
            picked = selection.role(name, role.role)
            if picked is None:
                raise NotADesign(f"nothing is chosen for {role.role} of {name}")
            out[name, role.role] = _chosen(case, stage, role, picked, known)
    return out


def _chosen(
    case: Case,
    stage: StageCase,
    role: RoleCase,
    picked: RoleSelection,
    known: Known,
) -> _Chosen:
    name, pinned = stage.choice.name, role.choice.primitive
    sensor = role.sensor(picked.sensor)
    if sensor is None or pinned not in (None, picked.primitive):
        raise NotADesign(f"{picked.sensor} by {picked.primitive} is not open to {name}")
    method: Any = None
    if role.inline is not None:
        if pinned is not None and pinned not in ("arrival", *sensor.primitives):
            raise NotADesign(f"{picked.sensor} cannot be stamped by {pinned}")
        error, timeline = role.inline.error, role.inline.timeline
    else:
        method = role.method(picked.method)
        if method is None or not _serves(method.primitives, sensor.primitives, picked.primitive):
            raise NotADesign(f"{picked.method} cannot stamp {picked.sensor} by {picked.primitive}")
        error, timeline = method.error, method.timeline
    tau = _bound(error, case.spec.coverage_factor)
    tau += Decimal(known.extra_tau_s.get((name, picked.role), 0.0))
    host = stage.choice.vehicle or name
    given = role.choice.sensor  # an id, or the entry itself
    listed = given if isinstance(given, SensorEntry) else case.catalog.sensors[picked.sensor]
    bought = RecheckedPieces(picked.sensor, listed)
    return _Chosen(
        sensor, bought, error, method, "utc" if timeline == "utc" else f"host {host}", tau,
        stage.choice.look,
    )  # fmt: skip


def _serves(by_method: Sequence[str], by_sensor: Sequence[str], primitive: str) -> bool:
    """A method stamps by a primitive that both have; one of arrival stamps every sensor."""
    has = primitive == "arrival" or primitive in by_sensor
    return has and (primitive in by_method or "arrival" in by_method)


def _bound(error: Any, coverage_factor: float) -> Decimal:
    """Largest |mu| [s]: ends of a uniform error, |mean| + k std of a normal one, measured values.

    With the mean calibrated out, the same about the mean, plus what remains of it.
    """
    if error.bound is not None:  # measured: a claim of its own, whatever the distribution
        return _decimal(error.bound)
    spread = Decimal(0)
    if error.distribution == "uniform":
        ends = [_decimal(error.low), _decimal(error.high)]
    elif error.distribution == "normal":
        ends = [_decimal(error.mean)]
        spread = _decimal(coverage_factor) * _decimal(error.std)
    elif error.distribution == "constant":
        ends = [_decimal(error.value)]
    else:
        ends = [_decimal(value) for value in error.values]
    if error.calibrated is None:
        return max(abs(end) for end in ends) + spread
    middle = sum(ends, Decimal(0)) / len(ends)
    return max(abs(end - middle) for end in ends) + spread + _decimal(error.calibrated)


Moves = tuple[Decimal, Decimal, Decimal]  # v_max, d omega_max, d
_Moment = tuple[str, Decimal]  # timeline of a stamp, bound of its error against that timeline
_TRUE_TIME: _Moment = ("utc", Decimal(0))


def _ends(stage: StageCase, chosen: Mapping[tuple[str, RoleName], _Chosen]) -> tuple[Moves, ...]:
    """How a stage moves at each end of its distances."""
    platform = stage.platform.entry
    if (stage.choice.name, "ranging") not in chosen:
        return ((_decimal(platform.v_max), Decimal(0), Decimal(0)),)
    ends = [_decimal(platform.distance)]
    if stage.choice.distance is not None:
        ends = [_decimal(end) for end in stage.distances]
        sigma = chosen[stage.choice.name, "ranging"].sensor.sigma_range
        ends += [one for one in bends(sigma) if min(ends) < one < max(ends)]
    speed, turn = _decimal(platform.v_max), _decimal(platform.omega_max)
    return tuple((speed, end * turn, end) for end in ends)


def _sensor_error(role: RoleName, one: _Chosen, moves: Moves) -> Decimal:
    sensor, distance = one.sensor, moves[2]
    if role == "position":
        return _length(sensor.sigma_position, 3)
    if role == "attitude":
        return _length(sensor.sigma_attitude, 3) * distance
    along = sigma_at(sensor.sigma_range, distance, one.look)
    across = sigma_at(sensor.sigma_bearing, distance, one.look)
    along = _decimal(sensor.sigma_range) if along is None else along
    if across is not None:
        return along + across * Decimal(2).sqrt() * distance
    return along + _length(sensor.sigma_bearing, 2) * distance


def _own_rate(role: RoleName, moves: Moves) -> Decimal:
    """What a sensor's own tau_crit is taken against; 0 for an attitude that enters nothing."""
    speed, turning, distance = moves
    if role == "position":
        return speed
    return speed + turning if distance else Decimal(0)


def _ratio(caused: Decimal, error: Decimal) -> Decimal:
    """tau / tau_crit: the error that timestamps cause over the sensors' own."""
    if not caused:
        return Decimal(0)
    return caused / error if error else Decimal(10) ** 30


def _meetings(
    case: Case,
    selection: Selection,
    chosen: Mapping[tuple[str, RoleName], _Chosen],
    moves: Mapping[str, Moves],
) -> Iterator[tuple[Decimal, Decimal]]:
    """(bound of the relative timestamp error [s], rate [m/s]) of all that meet.

    A stage takes its object at one moment: the one at which its ranging sensor measured, or, where
    nothing ranges, the true time that the result is compared at.  Its position (a later stage: the
    chain before it, as stamped by the ranging there) and its attitude are held against that.
    """
    carried: _Moment | None = None
    for stage in case.spec.stages:
        speed, turning, _ = moves[stage.name]
        ranging = chosen.get((stage.name, "ranging"))
        located = _TRUE_TIME if ranging is None else (ranging.timeline, ranging.tau)
        if carried is None:
            own = chosen[stage.name, "position"]
            carried = (own.timeline, own.tau)
        held: list[tuple[_Moment, Decimal]] = [(carried, speed)]
        if ranging is not None:
            attitude = chosen[stage.name, "attitude"]
            held.append(((attitude.timeline, attitude.tau), turning))
        for (timeline, tau), rate in held:
            yield tau + located[1] + _between(case, selection, timeline, located[0]), rate
        carried = located


def _between(case: Case, selection: Selection, first: str, second: str) -> Decimal:
    """Bound of the offset between two timelines [s]."""
    if first == second:
        return Decimal(0)
    return _from_utc(case, selection, first) + _from_utc(case, selection, second)


def _from_utc(case: Case, selection: Selection, timeline: str) -> Decimal:
    if timeline == "utc":
        return Decimal(0)
    entry = _clock(case, selection, timeline.removeprefix("host "))
    if entry is None:
        return Decimal(0)
    drift = Decimal(0)
    if entry.drift is not None:
        drift = abs(_decimal(entry.drift)) * _decimal(entry.holdover)
    return _bound(entry.offset, case.spec.coverage_factor) + drift


def _clock(case: Case, selection: Selection, vehicle: str) -> Any:
    """The clock of a vehicle; it has to be one that the spec offers."""
    offered: set[str] = set()
    for stage in case.spec.stages:
        if (stage.vehicle or stage.name) == vehicle and stage.clock is not None:
            offered |= set(stage.clock.candidates)
    picked = selection.clock(vehicle)
    if (picked is None) != (not offered) or (picked is not None and picked not in offered):
        raise NotADesign(f"{picked or 'no clock'} is not open to vehicle {vehicle}")
    return case.clock(vehicle, picked)


def _bought(
    case: Case, selection: Selection, chosen: Mapping[tuple[str, RoleName], _Chosen]
) -> Iterator[RecheckedPieces]:
    """What a design buys: shared hardware once per vehicle and full set of channels."""
    channels: dict[tuple[str, str], int] = {}
    vehicles = {stage.name: stage.vehicle or stage.name for stage in case.spec.stages}
    for (stage, _), one in chosen.items():
        yield one.bought
        if one.method is not None:
            yield RecheckedPieces(None, one.method)
            for item, count in one.method.requires.items():
                key = (vehicles[stage], item)
                channels[key] = channels.get(key, 0) + count
    for vehicle in dict.fromkeys(vehicles.values()):
        clock, name = _clock(case, selection, vehicle), selection.clock(vehicle)
        if clock is not None and name is not None:
            yield RecheckedPieces(name, case.catalog.clocks[name])
            for item, count in clock.requires.items():
                channels[vehicle, item] = channels.get((vehicle, item), 0) + count
    for (_, item), count in channels.items():
        entry = case.catalog.infrastructure[item]
        yield RecheckedPieces(item, entry, (count + entry.channels - 1) // entry.channels)


def _requirements(
    case: Case, found: Mapping[str, Fraction | None], silent: Sequence[str]
) -> Iterator[Rechecked]:
    """silent: sensors whose rate is not told."""
    written = [one for one in case.spec.requirements if one.kind in SUMMED_KINDS]
    if not any(one.kind == "sync" for one in written):
        value = found["sync"]
        yield Rechecked(
            IMPLIED_SYNC, "sync", value, Fraction(1), _meets("sync", value, Fraction(1)), True
        )
    for one in written:
        limit = money(case, one.limit) if one.kind == "cost" else _exact(one.limit)
        value = found[one.kind]
        kind: Kind = one.kind  # type: ignore[assignment]  # others are left out above
        met = _meets(one.kind, value, limit)
        if one.kind == "sample_spacing" and silent and (met or value is None):
            note = f"{', '.join(silent)} gives no rate"
            yield Rechecked(one.id, kind, None, limit, False, note=note, left_open=True)
            continue
        yield Rechecked(one.id, kind, value, limit, met)


def _facts(case: Case, selection: Selection) -> Iterator[Rechecked]:
    """The implied requirement that the payload can exist, where it cannot: how much is wrong."""
    wrong = impossible(case, selection)
    if wrong:
        count, none = Fraction(len(wrong)), Fraction(0)
        yield Rechecked(IMPLIED_FACTS, "feasible", count, none, False, True, "; ".join(wrong))


def _exact(value: float) -> Fraction:
    return Fraction(getattr(value, "exact", value))


def _meets(kind: str, value: Fraction | None, limit: Fraction) -> bool:
    """Errors and ratios as floats rounded once, sums as they are; sync is strict."""
    if value is None:
        return False
    if kind in ("accuracy", "sample_spacing"):
        return float(value) <= float(limit)
    if kind == "sync":
        return float(value) < float(limit)
    return value <= limit
