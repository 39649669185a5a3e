"""The command about clocks: timing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from syncline_design.cli.shared import (
    QuietOption,
    SeedOption,
    TimeLimitOption,
    TimingOutput,
    deadline_of,
    emit,
    guarded,
    output_targets,
    refuse,
    watched,
)
from syncline_design.machine.streams import say

if TYPE_CHECKING:
    from syncline_design.clocks.entry import EntryFiles
    from syncline_design.clocks.study import TimingSettings, TimingStudy
    from syncline_design.comparison.clock_meaning import TimingAndSpec
    from syncline_design.spec.case import Case

_SHARE = "a share between 0 and 1, such as 0.95"


@guarded
def timing(
    log: Annotated[
        list[Path],
        typer.Argument(help="Logs of one clock: chrony, ntpd, linuxptp, gpsd, ppstest, CSV; .gz."),
    ],
    as_id: Annotated[
        str | None,
        typer.Option("--as", metavar="ID", help="Write a catalog entry of this id."),
    ] = None,
    entry: Annotated[
        Literal["clock", "timestamping"], typer.Option(help="What --as writes.")
    ] = "clock",
    write_catalog: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Where --as writes; default: ID.yaml.")
    ] = None,
    session: Annotated[
        str, typer.Option(metavar="GAP", help="A longer gap begins a new session.")
    ] = "1 h",
    coverage: Annotated[float, typer.Option(help="Share of a session's time.")] = 0.95,
    session_share: Annotated[float, typer.Option(help="Share of future sessions.")] = 0.95,
    confidence: Annotated[float, typer.Option(help="Confidence of the claim.")] = 0.95,
    spec: Annotated[
        Path | None, typer.Option(metavar="SPEC", help="Say what it means for this spec.")
    ] = None,
    source: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which source of the logs to use.")
    ] = None,
    independent: Annotated[
        bool, typer.Option("--independent", help="These offsets do not steer the clock.")
    ] = False,
    declare: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=TIME", help="Add what no log shows: path_asymmetry=5us."),
    ] = None,
    use: Annotated[
        Literal["larger", "statistical", "hard"], typer.Option(help="Which bound to take.")
    ] = "larger",
    conditions: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Under which conditions it was measured.")
    ] = None,
    output: TimingOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Bound a clock's error from its logs, over sessions, with a stated claim."""
    deadline = deadline_of(time_limit)
    from syncline_design.clocks.entry import entry_files
    from syncline_design.clocks.study import TimingSettings, study_logs
    from syncline_design.report.formats import TIMING_FORMATS
    from syncline_design.report.on_timing import on_timing, render_timing
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load

    if write_catalog is not None and as_id is None:
        refuse("syncline-design: --write-catalog needs --as ID, the entry's id")
    settings = TimingSettings(
        _time(session, "--session"), _share(coverage, "--coverage"),
        _share(session_share, "--session-share"), _share(confidence, "--confidence"),
        source, independent, use, entry, dict(_declared(one) for one in declare or ()), conditions,
    )  # fmt: skip
    files = None if as_id is None else entry_files(as_id, write_catalog)
    reads = [*log, *([spec] if spec is not None else [])]
    targets = output_targets(output, TIMING_FORMATS, reads, files.paths if files else ())
    with watched(deadline, targets, quiet=quiet):
        case = None if spec is None else load(spec)
        study = study_logs(log, settings)
        whole = _with_spec(study, settings, case, as_id or "measured", seed)
    if as_id is not None and files is not None:
        currency = "EUR" if case is None else case.spec.currency
        whole = _written(study, whole, as_id, settings, files, currency)
    emit(console(on_timing(whole)), targets, lambda name: render_timing(name, whole), quiet=quiet)
    return whole.exit_code


def _with_spec(
    study: TimingStudy, settings: TimingSettings, case: Case | None, identity: str, seed: int
) -> TimingAndSpec:
    from syncline_design.comparison.clock_meaning import timing_meaning, with_spec
    from syncline_design.machine.deadline import in_force

    if case is None:
        return with_spec(study.timing, None)
    in_force().doing("checking the spec with the measured clock")
    means = timing_meaning(case, study, settings.kind, identity, seed)
    return with_spec(study.timing, means)


def _written(
    study: TimingStudy, whole: TimingAndSpec, identity: str, settings: TimingSettings,
    files: EntryFiles, currency: str,
) -> TimingAndSpec:  # fmt: skip
    """The entry on the disk, unless no claim could be made."""
    from syncline_design.clocks.entry import with_entry, write_entry
    from syncline_design.comparison.clock_meaning import with_spec

    if not whole.claim.made:
        say(f"no claim, so no entry written: {whole.claim.why_not}")
        return whole
    timing = with_entry(study, identity, settings.kind, files, currency)
    write_entry(study, timing, files)
    say(f"entry {identity} written to {files.catalog}")
    return with_spec(timing, whole.spec)


def _share(value: float, option: str) -> float:
    if not (0.0 < value < 1.0):
        refuse(f"syncline-design: {option} {value:g}: expected {_SHARE}")
    return value


def _time(text: str, option: str) -> float:
    """`1 h`, `30min`; positive."""
    import re

    from syncline_design.model.quantity import Dimension, UnitError, parse_quantity

    spaced = re.sub(r"(?<=[0-9.])(?=[a-zA-Z\u00b5])(?![eE][-+]?[0-9])", " ", text.strip())
    try:
        value = float(parse_quantity(spaced, Dimension.TIME, tolerance=False))
    except UnitError as error:
        refuse(f"syncline-design: {option} {text[:40]!r}: {error}")
    if not (0.0 < value < math.inf):
        refuse(f"syncline-design: {option} {text[:40]!r}: expected more than 0 s")
    return value


def _declared(text: str) -> tuple[str, float]:
    name, mark, value = text.partition("=")
    if not mark or not name.strip().isidentifier():
        refuse(f"syncline-design: --declare {text[:60]!r}: expected NAME=TIME: path_asymmetry=5us")
    return name.strip(), _time(value, "--declare")
