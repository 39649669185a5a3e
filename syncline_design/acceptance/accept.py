"""Hold the evidence of logs against what a spec's verdict rests on."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from syncline_design import __version__
from syncline_design.acceptance.assumptions import Assumed, assumptions
from syncline_design.acceptance.by_clock import by_clock
from syncline_design.acceptance.by_log import by_log
from syncline_design.acceptance.judgement import Judgement, together
from syncline_design.acceptance.result import (
    NAMES,
    Acceptance,
    AcceptedSpec,
    AssumptionName,
    AssumptionResult,
    EvidenceFile,
    worst,
)
from syncline_design.clocks.reading import is_clock_log
from syncline_design.clocks.study import TimingSettings, TimingStudy, study_logs
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.run import diagnose
from syncline_design.diagnosis.search import DiagnosisSettings
from syncline_design.machine.deadline import in_force
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw
from syncline_design.verdict.optimise import as_measured
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

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
    """Studies of clocks by what they tell of, and the diagnosis of the measured log."""

    clocks: Mapping[str, TimingStudy]
    log: Diagnosis | None


def accept(
    case: Case, logs: Sequence[Path], settings: AcceptSettings | None = None, seed: int = 0
) -> Acceptance:
    """One row for every assumption of the spec's verdict; pinned, or its best design.

    Raises BadInput for logs that cannot be used or told apart.
    """
    settings = settings or AcceptSettings()
    in_force().doing("checking the spec")
    verdict = check_loaded(case, CheckSettings(seed=seed))
    of_clocks, of_places = _sorted_logs(case, logs, settings)
    rests_on = [one for one in assumptions(case, verdict) if one.name in settings.asked]
    evidence = _evidence(case, of_clocks, of_places, settings, seed)
    rows = tuple(_row(case, one, evidence, rests_on) for one in rests_on)
    sound = verdict.verdict == "meets"
    return Acceptance(
        verdict=worst(row.status for row in rows) if sound else "broken",
        spec=AcceptedSpec(verdict.name, verdict.file, verdict.verdict),
        asked=settings.asked,
        assumptions=rows,
        evidence=tuple(_files(of_clocks, of_places)),
        notes=tuple(_notes(verdict, evidence)),
        version=__version__,
        seed=seed,
    )


def _sorted_logs(
    case: Case, logs: Sequence[Path], settings: AcceptSettings
) -> tuple[dict[str, list[Path]], list[Path]]:
    """(clock logs by what they tell of, logs of places)."""
    of_clocks = {name: list(paths) for name, paths in settings.assigned.items()}
    _demand_places(case, of_clocks)
    plain = [path for path in logs if is_clock_log(path)]
    if plain:
        of_clocks.setdefault(_only_vehicle(case, plain[0]), []).extend(plain)
    return of_clocks, [path for path in logs if path not in plain]


def _vehicles(case: Case) -> list[str]:
    return list(dict.fromkeys(stage.choice.vehicle_name for stage in case.stages))


def _sensors(case: Case) -> list[str]:
    return [f"{stage.choice.name}/{role.role}" for stage in case.stages for role in stage.roles]


def _demand_places(case: Case, assigned: Mapping[str, Sequence[Path]]) -> None:
    known = [*_vehicles(case), *_sensors(case)]
    wrong = next((name for name in assigned if name not in known), None)
    if wrong is not None:
        expected = "a vehicle or STAGE/ROLE: " + ", ".join(known)
        raise BadInput((Flaw(str(case.path), 0, 0, "", f"--assign {wrong}: not in the spec",
                             expected, repr(wrong), ""),))  # fmt: skip


def _only_vehicle(case: Case, log: Path) -> str:
    """Whose clock an unassigned clock log tells of."""
    clocked = [name for name in _vehicles(case) if case.clocks(name)]
    known = clocked or _vehicles(case)
    if len(known) > 1:
        raise BadInput((Flaw(str(log), 0, 0, "", "a clock log, and the spec has several vehicles",
                             "--assign VEHICLE=LOG for each", ", ".join(known), ""),))  # fmt: skip
    return known[0]


def _evidence(
    case: Case,
    of_clocks: Mapping[str, list[Path]],
    of_places: list[Path],
    settings: AcceptSettings,
    seed: int,
) -> _Evidence:
    studies = {name: study_logs(paths, settings.timing) for name, paths in of_clocks.items()}
    wanted = any(name not in CLOCKS for name in settings.asked) or not studies
    found = None
    if of_places or (wanted and case.spec.log is not None and case.spec.log.files):
        found = diagnose(as_measured(case, seed), of_places,
                         DiagnosisSettings(seed=seed))  # fmt: skip
    return _Evidence(studies, found)


def _row(
    case: Case, one: Assumed, evidence: _Evidence, rests_on: Sequence[Assumed]
) -> AssumptionResult:
    said = list(_said(case, one, evidence, rests_on))
    return together(case, one, said)


def _said(
    case: Case, one: Assumed, evidence: _Evidence, rests_on: Sequence[Assumed]
) -> Iterator[Judgement]:
    vehicles = {stage.choice.name: stage.choice.vehicle_name for stage in case.stages}
    vehicle = vehicles[one.stage]
    if one.name == "clock" and vehicle in evidence.clocks:
        yield by_clock(one, evidence.clocks[vehicle])
    if one.name == "timing" and f"{one.stage}/{one.role}" in evidence.clocks:
        yield by_clock(one, evidence.clocks[f"{one.stage}/{one.role}"])
    if evidence.log is not None:
        clocked = any(a.name == "clock" and vehicles[a.stage] == vehicle for a in rests_on)
        yield by_log(one, evidence.log, last_stage=case.stages[-1].choice.name, has_clock=clocked)


def _files(of_clocks: Mapping[str, list[Path]], of_places: list[Path]) -> Iterator[EvidenceFile]:
    for name, paths in of_clocks.items():
        for path in paths:
            yield EvidenceFile(str(path), "clock", name, _digest(path))
    for path in of_places:
        yield EvidenceFile(str(path), "log", "", _digest(path))


def _digest(path: Path) -> str:
    """SHA-256 of a file; of a folder none."""
    if not path.is_file():
        return ""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _notes(verdict: Verdict, evidence: _Evidence) -> Iterator[str]:
    if verdict.verdict != "meets":
        yield f"on paper the spec's verdict is {verdict.verdict}: there is nothing to accept"
    for name, study in evidence.clocks.items():
        yield from (f"clock of {name}: {note}" for note in study.timing.notes)
    if evidence.log is not None:
        yield from evidence.log.log.notes
        yield from (c.message for c in evidence.log.checks)
