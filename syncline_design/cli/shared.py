"""What every command shares: options, refusals, where results go."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, ParamSpec, Protocol

import typer

from syncline_design.cli.completions import SOLVER_ROADS, format_words, one_of
from syncline_design.machine.streams import say, without_commands
from syncline_design.report import formats

if TYPE_CHECKING:
    from syncline_design.machine.deadline import Deadline
    from syncline_design.report.document import Document
    from syncline_design.report.write import OutputTarget

PAGE_S = 1.0  # what drawing a page takes
BAD_INPUT, NO_VERDICT, INTERRUPTED = 2, 3, 130
PANIC = "PanicException"  # of a library in Rust; it passes by `except Exception`
DEBUG_VARIABLE = "SYNCLINE_DEBUG"  # set it to see the traceback of an internal error

P = ParamSpec("P")


class Unreadable(Protocol):
    """A file that gave nothing."""

    @property
    def reason(self) -> str: ...


_COMMAND: ContextVar[str] = ContextVar("command", default="report")  # that runs

SpecArgument = Annotated[Path, typer.Argument(help="System spec (YAML).", show_default=False)]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of every random number.")]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No text, only the exit code.")]
RoadOption = Annotated[
    str,
    typer.Option(
        "--road",
        "--method",
        help="To the proof: auto, front, milp or enumerate.",
        autocompletion=one_of(*SOLVER_ROADS),
    ),
]
TimeLimitOption = Annotated[
    float | None,
    typer.Option(min=0.0, help="Seconds for the whole command; then what is known."),
]
StudyTimeLimit = Annotated[
    float | None,
    typer.Option(min=0.0, help="Seconds for the whole command; the cases done by then are kept."),
]


def output_option(formats: tuple[str, ...]) -> Any:
    """`--output` of a command, its help naming the formats that it knows."""
    return typer.Option(
        "--output",
        "-o",
        metavar="FORMAT:PATH",
        autocompletion=format_words(formats),
        help=f"Write the result too; formats: {', '.join(formats)}; repeatable; path `-` is "
        "standard output"
        + (", no path a file named after the input for html" if "html" in formats else "")
        + ("; svg and png: a folder." if "svg" in formats else "."),
    )


def pictured(texts: tuple[str, ...]) -> tuple[str, ...]:
    """The formats of a command whose result has charts."""
    return (*texts, *formats.CHART_FORMATS)


CheckOutput = Annotated[list[str] | None, output_option(pictured(formats.CHECK_FORMATS))]
OptimizeOutput = Annotated[list[str] | None, output_option(pictured(formats.OPTIMIZE_FORMATS))]
SimulateOutput = Annotated[list[str] | None, output_option(pictured(formats.SIMULATE_FORMATS))]
DiagnoseOutput = Annotated[list[str] | None, output_option(pictured(formats.DIAGNOSE_FORMATS))]
StudyOutput = Annotated[list[str] | None, output_option(pictured(formats.STUDY_FORMATS))]
DiffOutput = Annotated[list[str] | None, output_option(formats.DIFF_FORMATS)]
AcceptOutput = Annotated[list[str] | None, output_option(formats.ACCEPT_FORMATS)]
LogOutput = Annotated[list[str] | None, output_option(formats.LOG_FORMATS)]
AuditOutput = Annotated[list[str] | None, output_option(pictured(formats.AUDIT_FORMATS))]
TimingOutput = Annotated[list[str] | None, output_option(pictured(formats.TIMING_FORMATS))]
WatchOutput = Annotated[list[str] | None, output_option(pictured(formats.WATCH_FORMATS))]
PlanOutput = Annotated[list[str] | None, output_option(pictured(formats.PLAN_FORMATS))]
ReproduceOutput = Annotated[list[str] | None, output_option(pictured(formats.REPRODUCE_FORMATS))]


def refuse(message: str, code: int = BAD_INPUT) -> NoReturn:
    say(message)
    raise typer.Exit(code)


def guarded(command: Callable[P, int]) -> Callable[P, None]:
    """Turn what can go wrong into a message and an exit code; never a traceback for a user."""

    @functools.wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        from syncline_design.machine.deadline import a_command, heard_again
        from syncline_design.machine.input_files import ReplacedInputError, noting
        from syncline_design.machine.result_files import OutputError
        from syncline_design.spec.load import BadInput

        _COMMAND.set(command.__name__)
        try:
            with heard_again(), noting(), a_command():
                code = command(*args, **kwargs)
        except typer.Exit:
            raise
        except BadInput as error:
            refuse(str(error))
        except ReplacedInputError as error:
            refuse(f"syncline-design: {error}")
        except OutputError as error:
            refuse(f"syncline-design: {error}", NO_VERDICT)
        except KeyboardInterrupt:
            _end_quietly()
            raise typer.Exit(INTERRUPTED) from None  # which the entry point puts into words
        except MemoryError:
            refuse("syncline-design: out of memory; no verdict", NO_VERDICT)
        except BaseException as error:
            foreign = isinstance(error, Exception) or type(error).__name__ == PANIC
            if not foreign or DEBUG_VARIABLE in os.environ:
                raise
            refuse_unexpected(error)
        raise typer.Exit(code)

    return run


def _end_quietly() -> None:
    """After an interrupt, what a library fails to tidy up at exit is nobody's concern."""
    if not hasattr(sys, "ps1"):
        sys.unraisablehook = lambda _: None


def show(text: str) -> None:
    """Print a text that is the whole result."""
    from syncline_design.report.write import STDOUT, OutputTarget, write_outputs

    write_outputs([(OutputTarget("text", STDOUT), text)])


def refuse_unexpected(error: BaseException) -> NoReturn:
    """Known errors speak for themselves; unknown ones are ours."""
    codes: dict[str, int] = {
        "NoVerdict": NO_VERDICT,
        "SimulationError": BAD_INPUT,
        "DiagnosisError": BAD_INPUT,
        "StudyError": BAD_INPUT,
        "PlanError": BAD_INPUT,
        "JointError": BAD_INPUT,
    }
    names = [c.__name__ for c in type(error).__mro__]
    for name, code in codes.items():
        if name in names:
            refuse(f"syncline-design: {error}", code)
    refuse(
        f"syncline-design: internal error, no verdict: {type(error).__name__}: {error}\n"
        f"Please report it with the spec; {DEBUG_VARIABLE}=1 shows where it happened.",
        NO_VERDICT,
    )


def output_targets(
    output: list[str] | None,
    formats: tuple[str, ...],
    reads: Sequence[Path] = (),
    writes: Sequence[Path | None] = (),
) -> list[OutputTarget]:
    """Where results go; refused where one would overwrite a file that the command reads.

    reads: files named on the command line; what these name in turn is held against the targets
    when it is opened.  writes: specs that are written besides.
    """
    from syncline_design.machine.input_files import ReplacedInputError, claim_outputs, note_read
    from syncline_design.report.write import (
        STDOUT,
        OutputError,
        apart,
        chart_places,
        check_targets,
        check_writable,
        parse_target,
    )

    specs = [path for path in writes if path is not None]
    try:
        for path in reads:
            _demand_option(path, formats)
        targets = [parse_target(text, formats, _stem(reads)) for text in output or ()]
        for path in specs:
            check_writable(path)
            apart(path, targets)
        check_targets(targets, reads)
        for path in reads:
            note_read(path)
        files = [Path(t.path) for t in targets if t.path != STDOUT]
        claim_outputs([*specs, *files, *chart_places(targets)])
    except (OutputError, ReplacedInputError) as error:
        refuse(f"syncline-design: {error}")
    return targets


def _demand_option(path: Path, formats: tuple[str, ...]) -> None:
    """Refuse a file that is none, and reads as an output whose option was forgotten."""
    form, colon, _ = str(path).partition(":")
    if colon and form in formats and not path.exists():
        refuse(
            f"syncline-design: {path}: no such file; an output takes its own option: "
            f"--output {path}"
        )


def _stem(reads: Sequence[Path]) -> str:
    """What a file is called that got no name: after what was read first, and the command."""
    return "-".join([*(path.stem for path in reads[:1] if path.stem), _COMMAND.get()])


def emit(
    text: str, targets: list[OutputTarget], render: Callable[[str], str | bytes], *, quiet: bool,
    charts: Callable[[], Mapping[str, Document]] = dict,
) -> None:  # fmt: skip
    """Write every target, then the text unless something else already claims standard output.

    charts: the documents whose charts go into a folder, by what the files' names begin with.
    """
    from syncline_design.report.progress_line import busy
    from syncline_design.report.write import STDOUT, OutputTarget, write_outputs

    rendered: list[tuple[OutputTarget, str | bytes]] = []
    with busy("writing results") if targets and not quiet else nullcontext():
        for target in targets:
            if target.format in formats.CHART_FORMATS:
                rendered += _charts(target, charts())
            else:
                rendered.append((target, render(target.format)))
    if text and not quiet and not any(target.path == STDOUT for target in targets):
        rendered.append((OutputTarget("text", STDOUT), without_commands(text)))
    write_outputs(rendered)
    for target in targets:
        if not target.named and not quiet:
            say(f"written to {target.path}")


def _charts(
    target: OutputTarget, documents: Mapping[str, Document]
) -> list[tuple[OutputTarget, str | bytes]]:
    """A target for each chart; the user is told where there is none."""
    from syncline_design.report.rendered import chart_files
    from syncline_design.report.write import OutputTarget

    found = chart_files(documents, "svg" if target.format == "svg" else "png")
    if not found:
        say(f"{target.path}: nothing written, this result has no chart")
    folder = Path(target.path)
    return [(OutputTarget(target.format, str(folder / name)), content) for name, content in found]


def demand_spec(write_spec: Path | None, spec: Path | None) -> None:
    """A spec to write into, where one is to be written."""
    if write_spec is not None and spec is None:
        refuse("syncline-design: --write-spec needs --spec SPEC, the spec to write into")


def say_unreadable(files: Iterable[Unreadable]) -> None:
    """Which files gave nothing, and why."""
    for one in files:
        say(one.reason)


def deadline_of(time_limit_s: float | None) -> Deadline:
    """The command's time limit, which begins now: before anything slow is imported."""
    from syncline_design.machine.deadline import Deadline, limit_command

    return limit_command(Deadline(time_limit_s, doing="reading"))


@contextmanager
def watched(
    deadline: Deadline, targets: Sequence[OutputTarget] = (), *, quiet: bool, steps: bool = True
) -> Iterator[None]:
    """The whole work of a command, its reading included, within its time limit.

    With time kept back for pages and, of commands that show no bar of their own, signs of progress
    (`steps`).  Where the time is over before anything can be concluded, the command ends.
    """
    from syncline_design.machine.deadline import OutOfTime, overdue, within
    from syncline_design.report.progress_line import StepLine

    if any(target.format in formats.PICTURED for target in targets):
        deadline.keep_back(PAGE_S)
    line = StepLine(quiet=quiet or not steps)
    deadline.tick = line
    try:
        with within(deadline), overdue(deadline):
            yield
    except OutOfTime:
        refuse(f"syncline-design: {deadline.passed()}; nothing can be concluded", NO_VERDICT)
    finally:
        line.clear()


def known_road(name: str) -> Any:
    if name not in SOLVER_ROADS:
        refuse(f"syncline-design: --road {name}: expected one of {', '.join(SOLVER_ROADS)}")
    return name
