"""The command about a built system: accept."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncline_design.cli.shared import (
    AcceptOutput,
    QuietOption,
    SeedOption,
    SpecArgument,
    TimeLimitOption,
    deadline_of,
    emit,
    guarded,
    output_targets,
    refuse,
    watched,
)

if TYPE_CHECKING:
    from syncline_design.comparison.acceptance import AssumptionName

_ASSIGNED = "expected OF=LOG, such as uav=tracking.log"


@guarded
def accept(
    spec: SpecArgument,
    log: Annotated[
        list[Path] | None,
        typer.Argument(help="Measured logs of places and logs of clocks, told by their content."),
    ] = None,
    assign: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OF=LOG",
            help="A clock log of one vehicle, or of one sensor's stamps (STAGE/ROLE=LOG).",
        ),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="Assumptions to ask for: timing,latency; default: all."),
    ] = None,
    independent: Annotated[
        bool, typer.Option("--independent", help="Offsets of clock logs do not steer the clocks.")
    ] = False,
    output: AcceptOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Hold logs of the built system against everything that its verdict rests on."""
    deadline = deadline_of(time_limit)
    from syncline_design.clocks.study import TimingSettings
    from syncline_design.comparison.accept import AcceptSettings
    from syncline_design.comparison.accept import accept as accept_logs
    from syncline_design.report.on_acceptance import (
        ACCEPT_FORMATS,
        on_acceptance,
        render_acceptance,
    )
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load

    assigned = _assigned(assign or [])
    reads = [spec, *(log or ()), *(path for paths in assigned.values() for path in paths)]
    timing = TimingSettings(independent=independent)
    settings = AcceptSettings(_asked(only), assigned, timing)
    targets = output_targets(output, ACCEPT_FORMATS, reads)
    with watched(deadline, targets, quiet=quiet):
        result = accept_logs(load(spec), log or (), settings, seed=seed)
    text = console(on_acceptance(result))
    emit(text, targets, lambda name: render_acceptance(name, result), quiet=quiet)
    return result.exit_code


def _assigned(texts: list[str]) -> dict[str, tuple[Path, ...]]:
    found: dict[str, tuple[Path, ...]] = {}
    for text in texts:
        name, mark, path = text.partition("=")
        if not (mark and name.strip() and path):
            refuse(f"syncline-design: --assign {text[:60]!r}: {_ASSIGNED}")
        found[name.strip()] = (*found.get(name.strip(), ()), Path(path))
    return found


def _asked(only: str | None) -> tuple[AssumptionName, ...]:
    from syncline_design.comparison.acceptance import NAMES

    if only is None:
        return NAMES
    names = [name.strip() for name in only.split(",")]
    wrong = next((name for name in names if name not in NAMES), None)
    if wrong is not None:
        refuse(f"syncline-design: --only {wrong!r}: expected some of {', '.join(NAMES)}")
    return tuple(name for name in NAMES if name in names)
