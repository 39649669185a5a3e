"""Commands that show evidence: simulate, diagnose, reproduce."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncline_design.cli.shared import (
    DiagnoseOutput,
    QuietOption,
    ReproduceOutput,
    SeedOption,
    SimulateOutput,
    SpecArgument,
    TimeLimitOption,
    deadline_of,
    emit,
    guarded,
    output_targets,
    pictured,
    refuse,
    watched,
)
from syncline_design.machine.arguments import FALSE_ALARM_RATES, MOST_EFFECTS
from syncline_design.machine.streams import say

if TYPE_CHECKING:
    from syncline_design.campaign.joint import JointRequest
    from syncline_design.comparison.meaning import DesignMeaning
    from syncline_design.comparison.repairs import Repair
    from syncline_design.diagnosis import Diagnosis, DiagnosisSettings
    from syncline_design.machine.deadline import Deadline
    from syncline_design.spec.case import Case

LogsArgument = Annotated[
    list[Path] | None,
    typer.Argument(
        help="Measured logs, of any kind that is read; default: the spec's `log: files:`."
    ),
]
WriteSpecOption = Annotated[
    Path | None, typer.Option(metavar="PATH", help="Write the spec with the findings in it.")
]
FalseAlarmOption = Annotated[
    float,
    typer.Option(
        min=FALSE_ALARM_RATES[0],
        max=FALSE_ALARM_RATES[1],
        help="Chance that a clean log is found at fault.",
    ),
]
MaxEffectsOption = Annotated[
    int, typer.Option(min=0, max=MOST_EFFECTS, help="Effects named at most.")
]
InformativeOption = Annotated[
    bool,
    typer.Option(
        "--require-informative",
        help="Exit with 3 where the log agrees but could not have shown what would turn it.",
    ),
]
JointOption = Annotated[
    bool, typer.Option("--joint", help="Each LOG is a run of the same system; take them together.")
]
StartsOption = Annotated[
    str | None,
    typer.Option(
        metavar="1,1,2",
        help="With --joint: the start of the system that each log is of; default: its own.",
    ),
]
StoreOption = Annotated[
    Path | None,
    typer.Option(
        metavar="PATH",
        help="With --joint: keep what each log says in this file, with what it holds.",
    ),
]


@guarded
def simulate(
    spec: SpecArgument,
    output: SimulateOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    samples: Annotated[
        int | None, typer.Option(help="Monte Carlo samples; default: the spec's.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes for long runs; the result is the same.")
    ] = None,
    time_limit: TimeLimitOption = None,
) -> int:
    """Simulate the nonlinear chain against the Syncline over a grid of tau."""
    deadline = deadline_of(time_limit)
    from syncline_design.report.on_simulation import (
        SIMULATE_FORMATS,
        on_simulation,
        render_simulate,
    )
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load
    from syncline_design.verdict.simulated_spec import simulate_spec

    targets = output_targets(output, pictured(SIMULATE_FORMATS), [spec])
    with watched(deadline, targets, quiet=quiet):
        run = simulate_spec(load(spec), seed=seed, samples=samples, workers=workers)
    text = console(on_simulation(run.result, run.system))
    emit(text, targets, lambda name: render_simulate(name, run), quiet=quiet,
         charts=lambda: {"": on_simulation(run.result, run.system)})  # fmt: skip
    return 0


@guarded
def diagnose(
    spec: SpecArgument,
    log: LogsArgument = None,
    output: DiagnoseOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    write_spec: WriteSpecOption = None,
    false_alarm_rate: FalseAlarmOption = 0.05,
    max_effects: MaxEffectsOption = 8,
    require_informative: InformativeOption = False,
    joint: JointOption = False,
    starts: StartsOption = None,
    store: StoreOption = None,
    time_limit: TimeLimitOption = None,
) -> int:
    """Compare a measured log with the simulation: name what is missing, show the gap shrink."""
    deadline = deadline_of(time_limit)
    from syncline_design.comparison.meaning import with_design
    from syncline_design.diagnosis import DiagnosisSettings
    from syncline_design.report.diagnoses import DIAGNOSE_FORMATS, render_diagnose
    from syncline_design.report.on_diagnosis import on_diagnosis
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load
    from syncline_design.verdict.pinned import as_measured

    together = _joint(joint=joint, logs=log, starts=starts, store=store)
    reads = [spec, *(log or ()), *([] if store is None else [store])]
    targets = output_targets(output, pictured(DIAGNOSE_FORMATS), reads, [write_spec])
    settings = DiagnosisSettings(
        seed=seed, false_alarm_rate=false_alarm_rate, max_effects=max_effects
    )
    with watched(deadline, targets, quiet=quiet, steps=False), _progress(quiet) as progress:
        case = load(spec)
        pinned = as_measured(case, seed)
        found = _found(pinned, log or (), together, settings, progress)
        means = _meaning(case, found, seed, deadline)
        put_right = _repairs(pinned, found, seed, deadline)
        found = _with_drive(pinned, found)
    whole = with_design(found, means, put_right)
    if write_spec is not None:
        _write_findings(case, found, means, write_spec)
    text = console(on_diagnosis(whole))
    emit(text, targets, lambda name: render_diagnose(name, whole), quiet=quiet,
         charts=lambda: {"": on_diagnosis(whole)})  # fmt: skip
    return found.demanded_exit_code(informative=require_informative)


def _joint(
    *, joint: bool, logs: list[Path] | None, starts: str | None, store: Path | None
) -> JointRequest | None:
    """Logs to be taken together; refused where an option asks for it and `--joint` does not."""
    if not joint:
        given = [n for n, v in (("--starts", starts), ("--store", store)) if v is not None]
        if given:
            refuse(f"syncline-design: {given[0]} goes with --joint, where each LOG is a run of "
                   "its own; several LOGs without it are parts of one run")  # fmt: skip
        return None
    from syncline_design.campaign.joint import JointRequest, starts_of

    files = tuple(logs or ())
    named = None if starts is None else starts_of(starts, len(files))
    return JointRequest(files, named, store)


def _found(
    case: Case,
    logs: Sequence[Path],
    together: JointRequest | None,
    settings: DiagnosisSettings,
    progress: Callable[[str, float], None],
) -> Diagnosis:
    """The diagnosis of logs that are parts of one run, or each a run of its own."""
    if together is None:
        from syncline_design.diagnosis import diagnose as diagnose_log

        return diagnose_log(case, logs, settings, progress)
    from syncline_design.campaign.joint import diagnose_joint

    return diagnose_joint(case, together, settings, progress)


def _meaning(case: Case, found: Diagnosis, seed: int, deadline: Deadline) -> DesignMeaning | None:
    """What a diagnosis means for the design; without it the diagnosis stands, for want of time."""
    from syncline_design.comparison.meaning import meaning
    from syncline_design.machine.deadline import OutOfTime

    try:
        deadline.doing("checking the design with the findings")
        means = meaning(case, found.effects_entries(), seed)
        deadline.check()
        return means
    except OutOfTime:
        say(f"syncline-design: {deadline.passed()}")
        return None


def _repairs(
    case: Case, found: Diagnosis, seed: int, deadline: Deadline
) -> tuple[Repair, ...] | None:
    """What would put the system right; none where there is nothing to, or no time."""
    from syncline_design.comparison.repairs import repairs
    from syncline_design.machine.deadline import OutOfTime

    try:
        deadline.doing("looking for repairs")
        return repairs(case, found.findings, seed) or None
    except OutOfTime:
        say(f"syncline-design: {deadline.passed()}")
        return None


def _write_findings(case: Case, found: Diagnosis, means: DesignMeaning | None, path: Path) -> None:
    """Write the spec with the findings in it, or say why there is none."""
    entries = found.effects_entries()
    if means is not None:
        from syncline_design.spec.edit import with_effects_text, write_spec

        write_spec(with_effects_text(case, entries), path)
        first = "; of what cannot be told apart, the first (see note:)"
        several = any(entry.note for entry in entries)
        say(f"spec with the findings written to {path}{first if several else ''}")
        return
    if entries:
        why = "the time was over"
    else:
        why = "nothing was found that belongs into a spec" if found.findings else "nothing found"
    say(f"{why}: no spec written")


def _with_drive(case: Case, found: Diagnosis) -> Diagnosis:
    """The diagnosis with the drive that would tell what its log could not."""
    if not any(one.aliases for one in found.findings):
        return found
    from syncline_design.planning.next_drive import next_drive

    return replace(found, plan=next_drive(case, found))


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error where that is a terminal; otherwise nothing."""
    if quiet or not sys.stderr.isatty():
        yield lambda _, __: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda words, share: bar.update(task, description=words, completed=share)


@guarded
def reproduce(
    output: ReproduceOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Compute every table and figure of the paper and compare it with what is printed."""
    deadline = deadline_of(time_limit)
    from syncline_design.paper import reproduce as paper
    from syncline_design.report.formats import REPRODUCE_FORMATS
    from syncline_design.report.on_paper import on_paper
    from syncline_design.report.render_console import console
    from syncline_design.report.rendered import rendered

    targets = output_targets(output, pictured(REPRODUCE_FORMATS))
    with watched(deadline, targets, quiet=quiet):
        found = paper.reproduce(seed=seed)
    said = on_paper(found)
    emit(console(said), targets, lambda name: rendered(name, found, lambda: said), quiet=quiet,
         charts=lambda: {"": said})  # fmt: skip
    return 0 if found.ok else 1
