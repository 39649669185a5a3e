"""The command that watches a system over time: watch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncline_design.cli.shared import (
    QuietOption,
    SeedOption,
    TimeLimitOption,
    WatchOutput,
    deadline_of,
    emit,
    guarded,
    output_targets,
    pictured,
    refuse,
    watched,
)
from syncline_design.machine.arguments import FALSE_ALARM_RATES

if TYPE_CHECKING:
    from syncline_design.campaign.watch_result import Watch
    from syncline_design.machine.deadline import Deadline


@guarded
def watch(
    store: Annotated[
        Path, typer.Argument(help="File that keeps what each run says; made by the first.")
    ],
    spec: Annotated[
        Path | None, typer.Argument(help="System spec (YAML).", show_default=False)
    ] = None,
    file: Annotated[
        list[Path] | None,
        typer.Argument(help="One more run, from one file or several; none: look again."),
    ] = None,
    accept: Annotated[
        bool,
        typer.Option("--accept", help="After a repair: hold later runs against one another only."),
    ] = False,
    leave_out: Annotated[
        int | None,
        typer.Option(
            "--leave-out",
            min=1,
            help="Count the run of this number no more; it stays in the store.",
            show_default=False,
        ),
    ] = None,
    take_back: Annotated[
        int | None,
        typer.Option(
            "--take-back",
            min=1,
            help="Count the run of this number again that was left out.",
            show_default=False,
        ),
    ] = None,
    reason: Annotated[
        str,
        typer.Option("--reason", help="Why a run is left out or taken back.", show_default=False),
    ] = "",
    output: WatchOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    false_alarm_rate: Annotated[
        float,
        typer.Option(
            min=FALSE_ALARM_RATES[0],
            max=FALSE_ALARM_RATES[1],
            help="Chance of a false alarm over all looks since a baseline.",
        ),
    ] = 0.05,
    require_informative: Annotated[
        bool,
        typer.Option(
            "--require-informative",
            help="Exit with 3 where nothing changed but the last run could not have shown it.",
        ),
    ] = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Add a run to those of a system, and say what changed since when."""
    deadline = deadline_of(time_limit)
    run = leave_out if take_back is None else take_back
    if sum((leave_out is not None, take_back is not None, accept)) > 1:
        refuse("syncline-design: watch: --accept, --leave-out and --take-back are calls of "
               "their own")  # fmt: skip
    if run is not None:
        back = take_back is not None
        return _leave_out(store, run, reason, spec, output, back=back, quiet=quiet)
    if accept:
        return _accept(store, spec, output, quiet=quiet)
    if spec is None:
        refuse("syncline-design: watch: expected STORE SPEC [FILE], found no SPEC; a new baseline "
               "takes `watch STORE --accept`")  # fmt: skip
    found = _look(store, spec, tuple(file or ()), output, false_alarm_rate, deadline, seed=seed,
                  quiet=quiet)  # fmt: skip
    return found.demanded_exit_code(informative=require_informative)


def _look(
    store: Path,
    spec: Path,
    files: tuple[Path, ...],
    output: list[str] | None,
    false_alarm_rate: float,
    deadline: Deadline,
    *,
    seed: int,
    quiet: bool,
) -> Watch:
    """The run added, all looked at, and said."""
    from syncline_design.campaign.watching import WatchRequest
    from syncline_design.campaign.watching import watch as watch_runs
    from syncline_design.diagnosis.settings import DiagnosisSettings
    from syncline_design.report.on_watch import WATCH_FORMATS, on_watch, render_watch
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load
    from syncline_design.verdict.pinned import as_measured

    targets = output_targets(output, pictured(WATCH_FORMATS), [store, spec, *files])
    with watched(deadline, targets, quiet=quiet):
        request = WatchRequest(store, files, false_alarm_rate)
        case = as_measured(load(spec), seed)
        found = watch_runs(case, request, DiagnosisSettings(seed=seed))
    emit(console(on_watch(found)), targets, lambda name: render_watch(name, found), quiet=quiet,
         charts=lambda: {"": on_watch(found)})  # fmt: skip
    return found


def _leave_out(
    store: Path,
    run: int,
    reason: str,
    spec: Path | None,
    output: list[str] | None,
    *,
    back: bool,
    quiet: bool,
) -> int:
    """A run that counts no more, or again, said in a line."""
    option = "--take-back" if back else "--leave-out"
    if spec is not None or output:
        refuse(f"syncline-design: watch STORE {option} N --reason TEXT takes nothing else")
    if not reason.strip():
        refuse(f"syncline-design: watch {option}: expected --reason TEXT, which every later look "
               "repeats")  # fmt: skip
    from syncline_design.campaign.watching import leave_out as leave_run_out

    stored = leave_run_out(store, run, reason, back=back)
    text = f"{store}: " + "; ".join(stored.left_out_words())
    emit(text, [], lambda name: name, quiet=quiet)
    return 0


def _accept(store: Path, spec: Path | None, output: list[str] | None, *, quiet: bool) -> int:
    """A new baseline, said in a line."""
    if spec is not None or output:
        refuse("syncline-design: watch STORE --accept takes nothing else")
    from syncline_design.campaign.watching import accept as accept_runs

    stored = accept_runs(store)
    count = len(stored.entries)
    text = f"{store}: runs from {count + 1} on are held against one another; {count} before stay"
    emit(text, [], lambda name: name, quiet=quiet)
    return 0
