"""The spec beside the log: which system made it, and whether the two fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.problem import build_problem, sole_design
from syncline_design.diagnosis.level import demand_level
from syncline_design.diagnosis.mending import Reread, mended
from syncline_design.diagnosis.set_back import set_back
from syncline_design.effects.acting import Acting, acting_of
from syncline_design.logs.columns import ISO_TIMES, known_names, shown
from syncline_design.logs.given_once import demand_once
from syncline_design.logs.log import Log
from syncline_design.logs.log_files import row_sources
from syncline_design.logs.pose_pairs import lever_m
from syncline_design.logs.reading import holds_poses, read_log
from syncline_design.logs.static_arms import spec_arms
from syncline_design.logs.stream_sources import laid_by
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.quantity import si_name
from syncline_design.model.system import System
from syncline_design.spec.case import Case
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice
from syncline_design.spec.yaml_text import Flaw, KeyPath


@dataclass(frozen=True, slots=True)
class Measured:
    """A system with the log it made, and the effects that its spec already knows."""

    system: System
    log: Log
    known: tuple[Acting, ...]
    files: tuple[str, ...] = ()
    reread: Reread | None = None


def measured(case: Case, paths: Sequence[Path]) -> Measured:
    """Resolve the spec, read the log, and refuse what does not fit."""
    system = pinned_system(case)
    names = [stage.name for stage in system.stages]
    choice = case.spec.log or LogChoice()
    _demand_known_columns(case, choice.columns, names)
    ranges = system.stages[-1].ranging is not None
    files = list(paths) or own_files(case)
    demand_once(files)
    first = system.stages[0]
    lever = lever_m(first.position, first.attitude) if len(names) == 1 else None
    poses = lever is not None
    sources = row_sources(files, choice, names, poses, spec_arms(case.spec))

    def read(slip_s: float) -> Log:
        log = read_log(sources, names, choice.columns, ranges, slip_s, choice.origin, lever)
        return replace(log, laid=laid_by(sources))

    log = read(0.0)
    reread: Reread | None = read if len(sources) > 1 else None
    system = replace(system, stages=system.stages[: len(log.stages)])
    if log.kind == "pose":  # no ranging sensor took part in it
        system = replace(system, stages=(replace(system.stages[0], ranging=None),))
    _demand_fit(case, system, log)
    known = acting_of(system)
    if reread and any(holds_poses(one, choice.columns, names) for one in sources):
        reread = partial(set_back, system, log, whole=read)
    if files:
        demand_level(files[0], system, log, known)
    for one in known:
        if one.effect.kind == "discrete":
            log = mended(log, one, reread)
    kept = tuple(one for one in known if one.effect.kind != "discrete")
    return Measured(system, log, kept, tuple(path.name for path in files), reread)


def _demand_known_columns(case: Case, mapping: Mapping[str, str], stages: Sequence[str]) -> None:
    """Refuse `ranger_m: ...`: nothing would be read for it, and nobody would notice."""
    known = known_names(stages if len(stages) > 1 else ())
    for name in mapping:
        if si_name(name) not in known and name not in ISO_TIMES:
            written = [shown(one) for one in sorted(known)]
            hint = did_you_mean(name, written)
            expected = "a column of a log such as range_m or roll_deg"
            raise _refuse(case, ("log", "columns", name), "no such column", expected, hint)


def own_files(case: Case) -> list[Path]:
    """The files that the spec's `log:` names, beside the spec."""
    files = case.spec.log.files if case.spec.log else ()
    if not files:
        raise _refuse(case, (), "no log given", "a LOG argument, or log: {files: [...]}")
    folder = case.path.parent.resolve()
    paths = []
    for index, name in enumerate(files):
        path = (folder / name).resolve()
        if not path.is_relative_to(folder):
            raise _refuse(case, ("log", "files", index), "outside the spec's folder", name)
        paths.append(path)
    return paths


def pinned_system(case: Case) -> System:
    """The system of a spec that leaves nothing open; its effects come along."""
    found = sole_design(build_problem(case))
    if found is None:
        raise _refuse(
            case,
            ("stages",),
            "the spec leaves choices open, and a log comes from one system",
            "every role pinned by `sensor:` and `timestamping:`",
            "optimize SPEC --write-design writes a pinned spec",
        )
    problem, design = found
    return system_of(case, problem, design)


def _demand_fit(case: Case, system: System, log: Log) -> None:
    if system.stages[0].position is None:
        raise _refuse(case, ("stages", 0), "the first stage has no position sensor")
    if log.kind != "georeference":
        return
    for k, stage in enumerate(system.stages):
        for role in ("attitude", "ranging"):
            if getattr(stage, role) is None:
                raise _refuse(
                    case,
                    ("stages", k),
                    f"the log holds ranges to targets, but stage {stage.name!r} has no {role} "
                    "sensor",
                    f"a {role} sensor, or a log with reference_north_m, ... instead of targets",
                )


def _refuse(
    case: Case, path: KeyPath, message: str, expected: str = "", hint: str = ""
) -> BadInput:
    shown = ".".join(map(str, path))
    problem = Flaw(str(case.path), *case.position(path), shown, message, expected, hint=hint)
    return BadInput((problem,))
