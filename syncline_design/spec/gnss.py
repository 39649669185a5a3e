"""Where GNSS is: which stages receive it, which get its time by a cable, what cannot do without.

A first stage has GNSS unless it lies at a depth; later stages have none; `gnss:` in a stage says
otherwise.  A cable (`timing_from:`) brings time, and passes on, but no antenna.  A host clock is
the vehicle's: one of the stages that share it has to have the time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

from syncline_design.spec.case import CandidateEntry, Case
from syncline_design.spec.catalog import ClockEntry, SensorEntry, TimestampingEntry
from syncline_design.spec.choices import StageChoice
from syncline_design.spec.existence import RuledOut
from syncline_design.spec.spec import Spec

GENERIC = ("gnss", "gps", "satnav")  # inside a word too: dgps, GnssCompass
ENDINGS = ("rtk", "ppk")  # nrtk, psrtk
SYSTEMS = {"navstar", "glonass", "galileo", "beidou", "bds", "qzss", "navic", "irnss"}
AUGMENTATIONS = {"sbas", "egnos", "waas", "msas", "gagan", "sdcm", "kass"}
CORRECTIONS = {"ppp", "vrs", "ntrip", "omnistar", "terrastar"}
NAMES = SYSTEMS | AUGMENTATIONS | CORRECTIONS | {"satellite", "global positioning"}


def has_gnss(spec: Spec, stage: StageChoice) -> bool:
    """Whether a stage has GNSS of its own."""
    if stage.gnss is not None:
        return stage.gnss
    return stage.name == spec.stages[0].name and not is_submerged(stage)


def has_gnss_time(spec: Spec, stage: StageChoice) -> bool:
    """Whether a stage has GNSS time, its own or by a cable from a stage that has it."""
    return any(has_gnss(spec, one) for one in _along_cables(spec, stage))


def _along_cables(spec: Spec, stage: StageChoice) -> Iterator[StageChoice]:
    """The stage and those that its time comes from, one after the other."""
    by_name = {one.name: one for one in spec.stages}
    for _ in spec.stages:
        yield stage
        if stage.timing_from is None:
            return
        stage = by_name[stage.timing_from]


def is_submerged(stage: StageChoice) -> bool:
    """Whether a stage is under water."""
    return stage.depth is not None and stage.depth > 0


def is_receiver(kind: str) -> bool:
    """Whether a sensor's free word for its type names a GNSS receiver: gnss, gps, gnss_rtk, DGPS.

    gnss/ins counts: without its receiver it is an INS, and its type says so.
    """
    words = re.split(r"[^a-z0-9]+", kind.casefold())
    words += [" ".join(pair) for pair in pairwise(words)]
    return any(
        word in NAMES or word.endswith(ENDINGS) or any(part in word for part in GENERIC)
        for word in words
    )


def deaf_sensor(
    case: Case, stage: StageChoice, sensor: CandidateEntry[SensorEntry]
) -> RuledOut | None:
    """Why a sensor would not hear on a stage; None where it needs no GNSS, or there is some."""
    needs = "gnss" in sensor.entry.needs or is_receiver(sensor.entry.type)
    if not needs or has_gnss(case.spec, stage):
        return None
    hint = "write gnss: yes in the stage where its antenna is above the water"
    reason = f"{sensor.id} needs GNSS; {stage.name} has none{_why(case.spec, stage)}; {hint}"
    return RuledOut("gnss", reason, "needs: gnss", "gnss: no")


def untimed_method(
    case: Case, stage: StageChoice, method: CandidateEntry[TimestampingEntry]
) -> RuledOut | None:
    """Why a timestamping method lacks GNSS time on a stage; None where it does not."""
    if not _needs_gnss(case, method.entry) or has_gnss_time(case.spec, stage):
        return None
    return _without_time(stage.name, method.id, _why(case.spec, stage))


def untimed_clock(case: Case, vehicle: str, clock: CandidateEntry[ClockEntry]) -> RuledOut | None:
    """Why a clock lacks GNSS time on a vehicle; None where it does not."""
    spec = case.spec
    stages = [stage for stage in spec.stages if stage.vehicle_name == vehicle]
    if not _needs_gnss(case, clock.entry) or any(has_gnss_time(spec, stage) for stage in stages):
        return None
    return _without_time(vehicle, clock.id, _why(spec, stages[0]))


def _without_time(where: str, name: str, why: str) -> RuledOut:
    hint = (
        "write gnss: yes in the stage if it has GNSS, timing_from: STAGE if a cable brings its time"
    )
    reason = f"{name} needs GNSS time; {where} has none{why}; {hint}"
    return RuledOut("gnss", reason, "needs: gnss", "gnss: no")


def _why(spec: Spec, stage: StageChoice) -> str:
    """How the spec comes to say that a stage has no GNSS."""
    if stage.gnss is not None:
        return " (gnss: no)"
    if is_submerged(stage):
        return f" (depth: {getattr(stage.depth, 'text', stage.depth)})"
    return " (a later stage has none unless it says so)" if stage != spec.stages[0] else ""


def _needs_gnss(case: Case, entry: TimestampingEntry | ClockEntry) -> bool:
    """Whether an entry, or shared hardware that it requires, needs GNSS."""
    hardware = (case.hardware[name].entry for name in entry.requires)
    return "gnss" in entry.needs or any("gnss" in one.needs for one in hardware)
