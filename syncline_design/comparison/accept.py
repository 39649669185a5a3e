"""Hold the evidence of logs against what a spec's verdict rests on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Final

from syncline_design import __version__
from syncline_design.auditing.result import Audit
from syncline_design.auditing.run import audit
from syncline_design.clocks.study import TimingSettings, TimingStudy, study_logs
from syncline_design.comparison.acceptance import (
    NAMES,
    Acceptance,
    AcceptedSpec,
    AssumptionName,
    AssumptionResult,
    OneOfThese,
    worst,
)
from syncline_design.comparison.assumptions import Assumed, assumptions
from syncline_design.comparison.by_clock import Resting, by_clock
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.by_stamps import by_stamps
from syncline_design.comparison.by_unnamed_clock import by_unnamed_clock
from syncline_design.comparison.departing import Departing
from syncline_design.comparison.evidence_files import (
    EvidenceFiles,
    demand_own_clocks,
    evidence_files,
)
from syncline_design.comparison.judgement import Judgement, together
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.of_places import as_of_places, stamps_alone
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.comparison.shapes import once_changed
from syncline_design.comparison.stamp_meaning import held_against
from syncline_design.comparison.suspects import grouped
from syncline_design.diagnosis.built import sighted
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput
from syncline_design.verdict.measured import coverage_of
from syncline_design.verdict.pinned import as_measured
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import check_loaded

CLOCKS: Final = ("timing", "clock")  # what logs of clocks can show


@dataclass(frozen=True, slots=True)
class AcceptSettings:
    """asked: which assumptions; assigned: logs by what they tell of, `STAGE/ROLE` or a vehicle.

    timing: how clock logs are judged.
    """

    asked: tuple[AssumptionName, ...] = NAMES
    assigned: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    timing: TimingSettings = field(default_factory=TimingSettings)


@dataclass(frozen=True, slots=True)
class _Evidence:
    """Studies of clocks by what they tell of, the audit of stamps, the measured log's diagnosis.

    no_places: why recordings were read for their stamps alone; "" where they were not.
    """

    clocks: Mapping[str, TimingStudy]
    stamps: Audit | None
    log: LogEvidence | None
    no_places: str = ""


def accept(
    case: Case, logs: Sequence[Path], settings: AcceptSettings | None = None, *, seed: int
) -> Acceptance:
    """One row for every assumption of the spec's verdict; pinned, or its best design.

    Raises BadInput for logs that cannot be used or told apart.
    """
    settings = settings or AcceptSettings()
    in_force().doing("checking the spec")
    verdict = check_loaded(case, CheckSettings(seed=seed))
    files = evidence_files(case, logs, settings.assigned)
    every = assumptions(case, verdict, files.clocks)
    rests_on = [one for one in every if one.name in settings.asked]
    evidence = _evidence(case, files, settings, rests_on, seed)
    if evidence.log is None:
        files = replace(files, places=())  # as none was read as such
    in_force().doing("weighing the evidence")
    single = tuple(_row(case, one, evidence, seed) for one in rests_on)
    rows, groups = _in_groups(case, single, every, evidence)
    sound = verdict.verdict == "meets"
    broken_by = tuple(_broken_by(sound, rows, groups))
    return Acceptance(
        verdict="broken" if broken_by else worst(row.status for row in rows),
        broken_by=broken_by,
        spec=AcceptedSpec(verdict.name, verdict.file, verdict.verdict, verdict.provenance),
        asked=settings.asked,
        assumptions=rows,
        evidence=tuple(files.records),
        notes=tuple(_notes(verdict, evidence)),
        version=__version__,
        seed=seed,
        groups=groups,
    )


def _in_groups(
    case: Case, rows: tuple[AssumptionResult, ...], every: Sequence[Assumed], evidence: _Evidence
) -> tuple[tuple[AssumptionResult, ...], tuple[OneOfThese, ...]]:
    """Rows with their groups, and the groups; every: all that the verdict rests on."""
    log = evidence.log
    if log is None:
        return rows, ()

    def rows_of(part: Departing) -> tuple[str, ...]:
        return tuple(f"{a.stage}/{a.role}/{a.name}" for a in every if log.breaks(a, part))

    return grouped(case, rows, log.in_doubt, rows_of)


def _evidence(
    case: Case, files: EvidenceFiles, settings: AcceptSettings, rests_on: Sequence[Assumed],
    seed: int,
) -> _Evidence:  # fmt: skip
    share = max(settings.timing.coverage, coverage_of(case))
    timing = replace(settings.timing, coverage=share)
    studies = {name: study_logs(paths, timing) for name, paths in files.clocks.items()}
    demand_own_clocks(case, files.clocks)
    audited = None
    if files.stamps and "timing" in settings.asked:
        audited = held_against(audit(files.stamps), case, seed)
    log = _diagnosed(case, files, settings, rests_on, seed)
    if isinstance(log, str):
        return _Evidence(studies, audited, None, log)
    return _Evidence(studies, audited, log)


def _diagnosed(
    case: Case, files: EvidenceFiles, settings: AcceptSettings, rests_on: Sequence[Assumed],
    seed: int,
) -> LogEvidence | str | None:  # fmt: skip
    """Of the measured logs given, or of those that the spec names where they are asked for; why
    recordings tell of stamps alone, where they do."""
    wanted = any(name not in CLOCKS for name in settings.asked)
    places = [path for path in files.places if wanted or path not in files.stamps]
    named = case.spec.log is not None and bool(case.spec.log.files)
    if not places and not (wanted and named):
        return None
    pinned = as_of_places(as_measured(case, seed), places)
    try:
        sight = sighted(pinned, places, DiagnosisSettings(seed=seed, unseen_block=False))
    except BadInput:
        why = stamps_alone(case, places, files.stamps) if "timing" in settings.asked else ""
        if not why:
            raise
        return why
    sight = replace(sight, found=once_changed(sight.found))
    paper = OnPaper.beside(pinned, sight.found, seed)
    return LogEvidence.of(sight, paper, case.stages[-1].choice.name, _clocks(case, rests_on))


def _broken_by(
    sound: bool, rows: Sequence[AssumptionResult], groups: Sequence[OneOfThese]
) -> Iterator[str]:
    if not sound:
        yield "spec"
    yield from (row.name for row in rows if row.status == "broken")
    yield from (" or ".join(one.rows) for one in groups)


def _clocks(case: Case, rests_on: Sequence[Assumed]) -> dict[str, str]:
    """Of every stage whose vehicle has a clock among the assumptions, the stage of that row."""
    vehicles = {stage.choice.name: stage.choice.vehicle_name for stage in case.stages}
    rows = {vehicles[one.stage]: one.stage for one in rests_on if one.name == "clock"}
    return {name: rows[vehicle] for name, vehicle in vehicles.items() if vehicle in rows}


def _row(case: Case, one: Assumed, evidence: _Evidence, seed: int) -> AssumptionResult:
    return together(case, one, list(_said(case, one, evidence, seed)))


def _said(case: Case, one: Assumed, evidence: _Evidence, seed: int) -> Iterator[Judgement]:
    vehicles = {stage.choice.name: stage.choice.vehicle_name for stage in case.stages}
    vehicle = vehicles[one.stage]
    if one.name == "clock" and vehicle in evidence.clocks:
        study = evidence.clocks[vehicle]
        named = bool(case.clocks(vehicle))
        yield (by_clock(one, study, Resting.of(case)) if named
               else by_unnamed_clock(case, one, vehicle, study, seed))  # fmt: skip
    if one.name == "timing" and f"{one.stage}/{one.role}" in evidence.clocks:
        yield by_clock(one, evidence.clocks[f"{one.stage}/{one.role}"], Resting.of(case))
    horizon_s = Resting.of(case).horizon_s
    stamped = None if evidence.stamps is None else by_stamps(one, evidence.stamps, horizon_s)
    if one.name == "timing" and stamped is not None:
        yield stamped
    if evidence.log is not None:
        yield by_log(one, evidence.log)


def _notes(verdict: Verdict, evidence: _Evidence) -> Iterator[str]:
    if verdict.verdict != "meets":
        yield f"on paper the spec's verdict is `{verdict.verdict}`: there is nothing to accept"
    for name, study in evidence.clocks.items():
        yield from (f"clock of {name}: {note}" for note in study.timing.notes)
    if evidence.stamps is not None:
        yield from evidence.stamps.notes
    if evidence.no_places:
        yield evidence.no_places
    if evidence.log is not None:
        yield from evidence.log.found.log.notes
        yield from (c.message for c in evidence.log.found.checks)
