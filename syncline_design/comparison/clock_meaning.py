"""What measured timing means for a spec: its verdict with the measured error in place, checked."""

from __future__ import annotations

from dataclasses import fields, replace

from syncline_design.clocks.entry import values_of
from syncline_design.clocks.result import ClockEntryKind, Timing
from syncline_design.clocks.study import TimingStudy
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.model.figure_text import to_digits
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import ClockEntry
from syncline_design.spec.choices import ClockChoice
from syncline_design.verdict.measured import COMMONLY, coverage_of
from syncline_design.verdict.named import NamedRole
from syncline_design.verdict.pinned import as_measured
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Provenance, RequirementResult, Verdict, Word
from syncline_design.verdict.verify import check_loaded


@dataclass(frozen=True, slots=True)
class SensorUnderTiming(Record):
    """One sensor of the spec's design.

    tau_s: of its stamps as the spec has them, its host clock's bound included where another sensor
    is on another clock; measured_tau_s: the same with the measured clock in place (None: of a
    method, which is not put in place); bound_ratio: the measured bound alone over tau_crit (None:
    of a sensor that no bound of a clock is counted for).
    """

    stage: str
    role: str
    sensor: str
    timeline: str
    tau_crit_s: float | None
    tau_s: float | None
    measured_tau_s: float | None
    bound_ratio: float | None


@dataclass(frozen=True, slots=True)
class TimingMeaning(Record):
    """The verdict as the spec has it and with the measured clock; after None: not put in place.

    tau_s, total_m: of the whole system, the largest timestamp difference and the error.
    asked_coverage: the share of the time for which the spec takes its bounds to hold, where the
    claim is for less.  accuracy: the limit that the error is held against.
    """

    name: str
    file: str
    before: Word
    after: Word | None
    tau_s: float | None
    measured_tau_s: float | None
    total_m: float | None
    measured_total_m: float | None
    requirement_changes: tuple[str, ...]
    sensors: tuple[SensorUnderTiming, ...]
    asked_coverage: float | None = optional()
    provenance: Provenance | None = optional()
    accuracy: RequirementResult | None = optional()


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingAndSpec(Timing):
    """What logs of a clock show, and what it means for a spec where one was given."""

    spec: TimingMeaning | None = optional()


def with_spec(timing: Timing, means: TimingMeaning | None) -> TimingAndSpec:
    """The result with what it means for a spec."""
    parts = {f.name: getattr(timing, f.name) for f in fields(Timing)}
    return TimingAndSpec(**parts, spec=means)


def timing_meaning(
    case: Case, study: TimingStudy, kind: ClockEntryKind, identity: str, seed: int
) -> TimingMeaning | None:
    """Check the spec as it is, and with every vehicle on the measured clock; None: no bound."""
    bound = study.timing.bound_s
    if bound is None:
        return None
    settings = CheckSettings(seed=seed)
    before = check_loaded(case, settings)
    own = as_measured(case, seed) if before.design is not None else case
    after = None
    if kind == "clock":
        after = check_loaded(on_clock(own, study, identity), settings)
    return TimingMeaning(
        before.name, before.file, before.verdict, None if after is None else after.verdict,
        _tau(before), _tau(after), _total(before), _total(after),
        _changes(before, after), _sensors(before, after, bound), _asked(case, study.timing),
        before.provenance, _accuracy(before),
    )  # fmt: skip


def _accuracy(before: Verdict) -> RequirementResult | None:
    """The tightest limit of the error."""
    rows = [row for row in before.requirements if row.kind == "accuracy"]
    return min(rows, key=lambda row: row.limit, default=None)


def _asked(case: Case, timing: Timing) -> float | None:
    """What the spec's coverage_factor asks for, where the claim is for less of the time."""
    asked = coverage_of(case)
    weaker = 1.0 - timing.claim.coverage > COMMONLY * (1.0 - asked)
    return asked if weaker else None


def on_clock(case: Case, study: TimingStudy, identity: str, vehicle: str | None = None) -> Case:
    """The case with a vehicle's host clock, or every one's, the measured one."""
    currency = case.spec.currency
    entry = ClockEntry.model_validate({
        "name": f"{identity}, measured",
        "offset": {
            "distribution": "empirical",
            "values": tuple(f"{to_digits(value, 9)} s" for value in values_of(study, "clock")),
            "bound": f"{study.timing.bound_s!r} s",
            "claim": {"coverage": study.timing.claim.coverage},
        },
        "cost": f"0 {currency}", "mass": "0 g", "power": "0 W", "source": "measured",
    })  # fmt: skip
    clocks = {**case.catalog.clocks, identity: entry}
    only = ClockChoice(candidates=(identity,))
    stages = tuple(
        one.model_copy(update={"clock": only})
        if vehicle is None or aboard.choice.vehicle_name == vehicle else one
        for one, aboard in zip(case.spec.stages, case.stages, strict=True)
    )  # fmt: skip
    return replace(
        case, catalog=case.catalog.model_copy(update={"clocks": clocks}),
        spec=case.spec.model_copy(update={"stages": stages}),
    )  # fmt: skip


def _tau(verdict: Verdict | None) -> float | None:
    return None if verdict is None or verdict.syncline is None else verdict.syncline.tau_s


def _total(verdict: Verdict | None) -> float | None:
    return None if verdict is None or verdict.syncline is None else verdict.syncline.total_m


def _changes(before: Verdict, after: Verdict | None) -> tuple[str, ...]:
    """Requirements whose status changes: `SYNC-1: pass to fail`."""
    if after is None:
        return ()
    was = {row.id: row.status for row in before.requirements}
    return tuple(
        f"{row.id}: {was[row.id]} to {row.status}"
        for row in after.requirements
        if row.id in was and was[row.id] != row.status
    )


def _sensors(
    before: Verdict, after: Verdict | None, bound_s: float
) -> tuple[SensorUnderTiming, ...]:
    taus, changed = _taus(before), _taus(after)
    return tuple(
        SensorUnderTiming(
            stage, role, row.sensor, row.timeline, row.tau_crit_s, taus[stage, role],
            changed.get((stage, role)),
            bound_s / row.tau_crit_s
            if row.tau_crit_s and taus[stage, role] != row.tau_s
            else None,
        )
        for (stage, role), row in _roles(before).items()
    )  # fmt: skip


def _taus(verdict: Verdict | None) -> dict[tuple[str, str], float]:
    """tau of every sensor's stamps: the offset of the clock that they stand on counts unless all
    sensors stand on that clock, where it cancels.
    """
    if verdict is None or verdict.design is None:
        return {}
    vehicles = {stage.name: stage.vehicle for stage in verdict.design.stages}
    offsets = {clock.vehicle: clock.offset_bound_s for clock in verdict.design.clocks}
    roles = _roles(verdict)
    on = {
        (stage, role): vehicles[stage] if row.timeline == "host" else None
        for (stage, role), row in roles.items()
    }
    apart = len(set(on.values())) > 1 or len(on) == 1
    return {
        key: row.tau_s + (offsets.get(clock, 0.0) if apart and (clock := on[key]) else 0.0)
        for key, row in roles.items()
    }


def _roles(verdict: Verdict) -> dict[tuple[str, str], NamedRole]:
    stages = verdict.design.stages if verdict.design is not None else ()
    return {(stage.name, role): row for stage in stages for role, row in stage.roles.items()}
