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
    pictured,
    refuse,
    watched,
)
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.streams import say
from syncline_design.model.figure_text import to_digits

if TYPE_CHECKING:
    from syncline_design.clocks.entry import EntryFiles
    from syncline_design.clocks.study import TimingSettings, TimingStudy
    from syncline_design.comparison.clock_meaning import TimingAndSpec
    from syncline_design.report.write import OutputTarget
    from syncline_design.spec.case import Case

_SHARE = "a share between 0 and 1, such as 0.95"
LogsArgument = Annotated[
    list[Path],
    typer.Argument(help="Logs of one clock: chrony, ntpd, linuxptp, gpsd, ppstest, CSV; .gz."),
]
AsOption = Annotated[
    str | None,
    typer.Option("--as", metavar="ID", help="Write a catalog entry of this id."),
]
EntryOption = Annotated[Literal["clock", "timestamping"], typer.Option(help="What --as writes.")]
WriteCatalogOption = Annotated[
    Path | None, typer.Option(metavar="PATH", help="Where --as writes; default: ID.yaml.")
]
SessionOption = Annotated[
    str, typer.Option(metavar="GAP", help="A longer gap begins a new session.")
]
CoverageOption = Annotated[float, typer.Option(help="Share of a session's time.")]
SessionShareOption = Annotated[float, typer.Option(help="Share of future sessions.")]
ConfidenceOption = Annotated[float, typer.Option(help="Confidence of the claim.")]
SpecOption = Annotated[
    Path | None, typer.Option(metavar="SPEC", help="Say what it means for this spec.")
]
SourceOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Which source of the logs to use.")
]
IndependentOption = Annotated[
    bool, typer.Option("--independent", help="These offsets do not steer the clock.")
]
DeclareOption = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=TIME", help="Add what no log shows: path_asymmetry=5us."),
]
UseOption = Annotated[
    Literal["larger", "statistical", "hard"], typer.Option(help="Which bound to take.")
]
ConditionsOption = Annotated[
    str | None, typer.Option(metavar="TEXT", help="Under which conditions it was measured.")
]


@guarded
def timing(
    log: LogsArgument,
    as_id: AsOption = None,
    entry: EntryOption = "clock",
    write_catalog: WriteCatalogOption = None,
    session: SessionOption = "1 h",
    coverage: CoverageOption = 0.95,
    session_share: SessionShareOption = 0.95,
    confidence: ConfidenceOption = 0.95,
    spec: SpecOption = None,
    source: SourceOption = None,
    independent: IndependentOption = False,
    declare: DeclareOption = None,
    use: UseOption = "larger",
    conditions: ConditionsOption = None,
    output: TimingOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Bound a clock's error from its logs, over sessions, with a stated claim."""
    deadline = deadline_of(time_limit)
    from syncline_design.clocks.study import TimingSettings
    from syncline_design.report.formats import TIMING_FORMATS

    if write_catalog is not None and as_id is None:
        refuse("syncline-design: --write-catalog needs --as ID, the entry's id")
    settings = TimingSettings(
        _time(session, "--session"), _share(coverage, "--coverage"),
        _share(session_share, "--session-share"), _share(confidence, "--confidence"),
        source, independent, use, entry, dict(_declared(one) for one in declare or ()), conditions,
    )  # fmt: skip
    wanted = _entry(as_id, write_catalog)
    reads = [*log, *([spec] if spec is not None else [])]
    targets = output_targets(
        output, pictured(TIMING_FORMATS), reads, wanted.files.paths if wanted else ()
    )
    with watched(deadline, targets, quiet=quiet):
        told = _told(log, settings, spec, wanted, seed)
    whole = told.whole if wanted is None else _written(told, settings, wanted)
    return _shown(whole, targets, quiet)


@dataclass(frozen=True, slots=True)
class _Entry:
    """What `--as` writes, and where."""

    identity: str
    files: EntryFiles


@dataclass(frozen=True, slots=True)
class _Told:
    """A study, what it means for the spec, and the currency of an entry."""

    study: TimingStudy
    whole: TimingAndSpec
    currency: str


def _entry(identity: str | None, catalog: Path | None) -> _Entry | None:
    from syncline_design.clocks.entry import entry_files

    return None if identity is None else _Entry(identity, entry_files(identity, catalog))


def _told(
    logs: list[Path], settings: TimingSettings, spec: Path | None, wanted: _Entry | None, seed: int
) -> _Told:
    """The logs read and bounded, and held against the spec."""
    from syncline_design.clocks.study import study_logs
    from syncline_design.spec.load import load

    case = None if spec is None else load(spec)
    study = study_logs(logs, settings)
    identity = "measured" if wanted is None else wanted.identity
    whole = _with_spec(study, settings, case, identity, seed)
    return _Told(study, whole, "EUR" if case is None else case.spec.currency)


def _shown(whole: TimingAndSpec, targets: list[OutputTarget], quiet: bool) -> int:
    from syncline_design.report.on_timing import on_timing, render_timing
    from syncline_design.report.render_console import console

    emit(console(on_timing(whole)), targets, lambda name: render_timing(name, whole), quiet=quiet,
         charts=lambda: {"": on_timing(whole)})  # fmt: skip
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


def _written(told: _Told, settings: TimingSettings, wanted: _Entry) -> TimingAndSpec:
    """The entry on the disk, unless no claim could be made."""
    from syncline_design.clocks.entry import with_entry, write_entry
    from syncline_design.comparison.clock_meaning import with_spec

    if not told.whole.claim.made:
        say(f"no claim, so no entry written: {told.whole.claim.why_not}")
        return told.whole
    timing = with_entry(told.study, wanted.identity, settings.kind, wanted.files, told.currency)
    write_entry(told.study, timing, wanted.files)
    say(f"entry {wanted.identity} written to {wanted.files.catalog}")
    return with_spec(timing, told.whole.spec)


def _share(value: float, option: str) -> float:
    if not (0.0 < value < 1.0):
        refuse(f"syncline-design: {option} {to_digits(value)}: expected {_SHARE}")
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
