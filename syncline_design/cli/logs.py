"""The commands about logs: log inspect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncline_design.cli.shared import (
    LogOutput,
    QuietOption,
    TimeLimitOption,
    deadline_of,
    demand_spec,
    emit,
    guarded,
    output_targets,
    say_unreadable,
    watched,
)
from syncline_design.machine.streams import say

if TYPE_CHECKING:
    from syncline_design.logs.inspection import LogInspection
    from syncline_design.spec.case import Case


@guarded
def inspect(
    file: Annotated[
        list[Path],
        typer.Argument(help="Logs: bags (or their folders), flight logs, trajectories, CSV, ..."),
    ],
    spec: Annotated[
        Path | None, typer.Option(metavar="SPEC", help="Map the streams to this spec.")
    ] = None,
    write_spec: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write the spec with the mapping in it.")
    ] = None,
    output: LogOutput = None,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """List the streams of logs, and propose how `diagnose` should read them."""
    deadline = deadline_of(time_limit)
    from syncline_design.logs.inspection import inspect_logs
    from syncline_design.logs.log_files import ONE_STAGE
    from syncline_design.logs.static_arms import spec_arms
    from syncline_design.report.formats import LOG_FORMATS
    from syncline_design.report.on_log import on_log, render_log
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load

    demand_spec(write_spec, spec)
    reads = [*(f for f in file if not f.is_dir()), *([spec] if spec is not None else [])]
    targets = output_targets(output, LOG_FORMATS, reads, [write_spec])
    with watched(deadline, targets, quiet=quiet):
        case = None if spec is None else load(spec)
        choice = None if case is None else case.spec.log
        found = inspect_logs(
            file,
            choice,
            _has_attitude(case),
            None if case is None else spec_arms(case.spec),
            ONE_STAGE if case is None else [stage.name for stage in case.spec.stages],
        )
    say_unreadable(found.unreadable)
    if not found.streams and found.unreadable:
        return found.exit_code  # nothing was read, nothing is written
    if write_spec is not None and case is not None:
        _write(found, case, write_spec)
    emit(console(on_log(found)), targets, lambda name: render_log(name, found), quiet=quiet)
    return found.exit_code


def _has_attitude(case: Case | None) -> bool:
    """Whether attitudes would be compared: a spec of one stage that has a sensor of them."""
    return case is None or (len(case.spec.stages) == 1 and case.spec.stages[0].attitude is not None)


def _write(found: LogInspection, case: Case, path: Path) -> None:
    from syncline_design.spec.edit import with_log_text, write_spec

    block = found.proposal.log.to_json()
    if not block and found.proposal.kind is None:
        say("no mapping: no spec written")
        return
    write_spec(with_log_text(case, block) if block else case.text, path)
    said = "with the mapping " if block else "as it is (the names of the columns are the mapping) "
    say(f"spec {said}written to {path}")
