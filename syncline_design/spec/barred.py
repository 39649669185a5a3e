"""What of a case cannot exist where it would stand: sensors, methods and clocks, by every rule.

The strongest reason stands for all.  How far a ranging sensor reaches is kept apart: distance is
what a remedy may change, all else stays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from syncline_design.spec.case import CandidateEntry, Case, StageCase
from syncline_design.spec.catalog import ClockEntry, Product, SensorEntry, TimestampingEntry
from syncline_design.spec.existence import (
    SOUND_MPS,
    RuledOut,
    Surroundings,
    not_sold,
    not_told,
    out_of_place,
    strongest,
    too_hot_or_cold,
)
from syncline_design.spec.facts import Medium
from syncline_design.spec.gnss import deaf_sensor, is_submerged, untimed_clock, untimed_method


def surroundings(case: Case, stage: StageCase) -> Surroundings:
    """What a stage of a spec asks of its sensors."""
    spec = case.spec
    following = next(iter(case.stages[stage.index + 1 : stage.index + 2]), None)
    choice, (near, far) = stage.choice, stage.distances
    wanted = (one for one in spec.requirements if one.kind == "sample_spacing")
    asked = (float(limit) for one in wanted if (limit := case.choice_limit(one)) is not None)
    return Surroundings(
        choice.name,
        near,
        far,
        path_medium(stage),
        choice.look,
        choice.depth,
        choice.temperature,
        choice.reflectivity,
        stage.platform.entry.v_max,
        min(asked, default=None),
        choice.sound_speed or SOUND_MPS,
        tuple(_interpolated(stage, following)),
    )


def _interpolated(stage: StageCase, following: StageCase | None) -> Iterator[tuple[str, str]]:
    """Roles of a stage whose samples are interpolated, each with whose acceleration counts."""
    own = stage.platform.entry
    if own.acceleration is not None:
        yield "position", stage.choice.name
    if own.angular_acceleration is not None and stage.role("ranging") is not None:
        yield "attitude", stage.choice.name
    if following is not None and following.platform.entry.acceleration is not None:
        yield "ranging", following.choice.name


def path_medium(stage: StageCase) -> Medium | None:
    """What the path to the object goes through: as the stage says; below the surface it is water;
    else as the platform says."""
    if stage.choice.medium is not None:
        return stage.choice.medium
    return "water" if is_submerged(stage.choice) else stage.platform.entry.medium


def barred_sensor(
    case: Case, stage: StageCase, around: Surroundings, sensor: CandidateEntry[SensorEntry]
) -> RuledOut | None:
    """Why a sensor cannot work on a stage at any distance; None where it can."""
    found = list(out_of_place(sensor.id, sensor.entry, around))
    deaf = deaf_sensor(case, stage.choice, sensor)
    found += [deaf] if deaf is not None else []
    found += _not_sold(case, sensor.id, sensor.entry)
    if case.spec.strict_facts:
        found += [
            RuledOut("unknown-fact", one.reason, f"{one.key}: not told", "strict_facts: yes")
            for one in not_told(sensor.id, sensor.entry, around)
        ]
    return _strongest(found)


def barred_method(
    case: Case, stage: StageCase, method: CandidateEntry[TimestampingEntry]
) -> RuledOut | None:
    """Why a timestamping method cannot work on a stage; None where it can."""
    found = _of_parts(case, method, [stage])
    untimed = untimed_method(case, stage.choice, method)
    return _strongest([*found, *([untimed] if untimed is not None else [])])


def barred_clock(case: Case, vehicle: str, clock: CandidateEntry[ClockEntry]) -> RuledOut | None:
    """Why a clock cannot run so on a vehicle; None where it can."""
    aboard = [stage for stage in case.stages if stage.choice.vehicle_name == vehicle]
    untimed = untimed_clock(case, vehicle, clock)
    found = _of_parts(case, clock, aboard)
    return _strongest([*found, *([untimed] if untimed is not None else [])])


def _of_parts(
    case: Case,
    one: CandidateEntry[TimestampingEntry] | CandidateEntry[ClockEntry],
    stages: Iterable[StageCase],
) -> Iterator[RuledOut]:
    """What is wrong with an entry, or with the shared hardware that it requires, on any stage."""
    parts: list[tuple[str, Product]] = [(one.id, one.entry)]
    parts += [(name, case.hardware[name].entry) for name in one.entry.requires]
    for name, entry in parts:
        yield from _not_sold(case, name, entry)
        for stage in stages:
            yield from too_hot_or_cold(name, entry, stage.choice.name, stage.choice.temperature)


def _not_sold(case: Case, name: str, entry: Product) -> Iterator[RuledOut]:
    return iter(()) if case.spec.allow_discontinued else not_sold(name, entry)


def _strongest(found: Iterable[RuledOut]) -> RuledOut | None:
    listed = list(found)
    return strongest(listed) if listed else None
