"""The command about stamps: audit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncline_design.cli.shared import (
    AuditOutput,
    QuietOption,
    SeedOption,
    TimeLimitOption,
    deadline_of,
    demand_spec,
    emit,
    guarded,
    output_targets,
    pictured,
    say_unreadable,
    watched,
)
from syncline_design.machine.streams import say

if TYPE_CHECKING:
    from syncline_design.auditing.result import Audit
    from syncline_design.spec.case import Case


@guarded
def audit(
    file: Annotated[
        list[Path],
        typer.Argument(help="Logs: bags (or their folders), flight logs, CSV with two times, ..."),
    ],
    spec: Annotated[
        Path | None, typer.Option(metavar="SPEC", help="Hold the streams against its tau_crit.")
    ] = None,
    write_spec: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write the spec with the residuals as timestamp errors."),
    ] = None,
    output: AuditOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Name every fault of the stamps in logs, from stamps and receipts alone."""
    deadline = deadline_of(time_limit)
    from syncline_design.auditing.run import audit as audit_files
    from syncline_design.comparison.stamp_meaning import held_against
    from syncline_design.report.formats import AUDIT_FORMATS
    from syncline_design.report.on_audit import on_audit, render_audit
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load

    demand_spec(write_spec, spec)
    reads = [*file, *([spec] if spec is not None else [])]
    targets = output_targets(output, pictured(AUDIT_FORMATS), reads, [write_spec])
    with watched(deadline, targets, quiet=quiet):
        case = None if spec is None else load(spec)
        found = audit_files(file)
        if case is not None:
            found = held_against(found, case, seed)
    say_unreadable(found.unreadable)
    for one in found.unexamined:
        say(f"{one.file}: {one.reason}")
    if write_spec is not None and case is not None:
        _write(found, case, write_spec)
    emit(console(on_audit(found)), targets, lambda name: render_audit(name, found), quiet=quiet,
         charts=lambda: {"": on_audit(found)})  # fmt: skip
    return found.exit_code


def _write(found: Audit, case: Case, path: Path) -> None:
    from syncline_design.comparison.stamp_meaning import keeping_theirs, spec_with_residuals
    from syncline_design.spec.edit import write_spec

    kept = keeping_theirs(found)
    if kept:
        say(f"{', '.join(kept)}: stamped in hardware, of which receipts say nothing; timestamping "
            "as the spec has it")  # fmt: skip
    text = spec_with_residuals(found, case)
    if text is None:
        say("no stream whose receipts say something of its stamps plays a role of the spec: no "
            "spec written")  # fmt: skip
        return
    write_spec(text, path)
    say(f"spec with the residuals written to {path}")
