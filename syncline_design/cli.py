"""The command line: parse, call, print, exit.

Exit codes: 0 meets, 1 does not meet (infeasible included), 2 bad spec or usage, 3 no verdict.
"""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, ParamSpec

import typer

from syncline_design import __version__

if TYPE_CHECKING:
    from syncline_design.report.write import Target

BAD_INPUT, NO_VERDICT = 2, 3
DEBUG_VARIABLE = "SYNCLINE_DEBUG"  # set it to see the traceback of an internal error

# Looking for validation plugins among all installed packages costs a tenth of a short check.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

app = typer.Typer(
    name="syncline-design",
    help="Choose, verify and diagnose sensor payloads and their time synchronisation.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
catalog_app = typer.Typer(help="Look into the built-in catalogs.", no_args_is_help=True)
app.add_typer(catalog_app, name="catalog")

P = ParamSpec("P")

SpecArgument = Annotated[Path, typer.Argument(help="System spec (YAML).", show_default=False)]
OutputOption = Annotated[
    list[str] | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FORMAT:PATH",
        help="Write the result too; repeatable; `-` is standard output.",
    ),
]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of every random number.")]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No text, only the exit code.")]
MethodOption = Annotated[str, typer.Option(help="auto, front, milp or enumerate.")]
TimeLimitOption = Annotated[
    float | None, typer.Option(min=0.0, help="Seconds for the choice; beyond: no verdict.")
]


def _refuse(message: str, code: int = BAD_INPUT) -> NoReturn:
    print(message, file=sys.stderr)
    raise typer.Exit(code)


def guarded(command: Callable[P, int]) -> Callable[P, None]:
    """Turn what can go wrong into a message and an exit code; never a traceback for a user."""

    @functools.wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        from syncline_design.loading import BadInput
        from syncline_design.report.write import OutputError

        try:
            code = command(*args, **kwargs)
        except typer.Exit:
            raise
        except BadInput as error:
            _refuse(str(error))
        except OutputError as error:
            _refuse(f"syncline-design: {error}", NO_VERDICT)
        except KeyboardInterrupt:
            _refuse("syncline-design: interrupted", 130)
        except MemoryError:
            _refuse("syncline-design: out of memory; no verdict", NO_VERDICT)
        except Exception as error:
            if DEBUG_VARIABLE in os.environ:
                raise
            _refuse_internal(error)
        raise typer.Exit(code)

    return run


def _refuse_internal(error: Exception) -> NoReturn:
    """Known errors speak for themselves; unknown ones are ours."""
    codes: dict[str, int] = {
        "NoVerdict": NO_VERDICT,
        "SimulationError": BAD_INPUT,
        "DiagnosisError": BAD_INPUT,
        "StudyError": BAD_INPUT,
    }
    names = [c.__name__ for c in type(error).__mro__]
    for name, code in codes.items():
        if name in names:
            _refuse(f"syncline-design: {error}", code)
    _refuse(
        f"syncline-design: internal error, no verdict: {type(error).__name__}: {error}\n"
        f"Please report it with the spec; {DEBUG_VARIABLE}=1 shows where it happened.",
        NO_VERDICT,
    )


def _targets(output: list[str] | None, formats: tuple[str, ...]) -> list[Target]:
    from syncline_design.report.write import OutputError, check_targets, parse_target

    try:
        targets = [parse_target(text, formats) for text in output or ()]
        check_targets(targets)
    except OutputError as error:
        _refuse(f"syncline-design: {error}")
    return targets


def _emit(text: str, targets: list[Target], render: Callable[[str], str], *, quiet: bool) -> None:
    """Write every target, then the text unless something else already claims standard output."""
    from syncline_design.report.write import STDOUT, Target, write_outputs

    rendered = [(target, render(target.format)) for target in targets]
    if text and not quiet and not any(target.path == STDOUT for target in targets):
        rendered.append((Target("text", STDOUT), text))
    write_outputs(rendered)


def _print_version(value: bool) -> None:
    if value:
        print(f"syncline-design {__version__}")
        raise typer.Exit(0)


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Nothing to set up: every command stands alone."""


@app.command()
@guarded
def check(
    spec: Annotated[list[Path], typer.Argument(help="Specs, or folders of specs.")],
    output: OutputOption = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    method: MethodOption = "auto",
    time_limit: TimeLimitOption = None,
) -> int:
    """Validate a spec, choose what is open, verify, cross-check by Monte Carlo, say the verdict."""
    from syncline_design.report.checks import CHECK_FORMATS, render_checks
    from syncline_design.report.console import verdict_text
    from syncline_design.report.write import STDOUT
    from syncline_design.verify import CheckSettings, check_files, exit_code

    targets = _targets(output, CHECK_FORMATS)
    settings = CheckSettings(seed=seed, method=_method(method), time_limit_s=time_limit)
    verdicts = check_files(spec, settings)
    refused = [verdict for verdict in verdicts if verdict["verdict"] == "refused"]
    for verdict in refused:
        print(verdict["text"], file=sys.stderr)
    if refused:  # no file is written; what goes to standard output may say so
        targets = [target for target in targets if target.path == STDOUT]
    text = "\n".join(verdict_text(v) for v in verdicts if v not in refused)
    _emit(text, targets, lambda name: render_checks(name, verdicts), quiet=quiet)
    return max(exit_code(verdict) for verdict in verdicts)


def _method(name: str) -> Any:
    known = ("auto", "front", "milp", "enumerate")
    if name not in known:
        _refuse(f"syncline-design: --method {name}: expected one of {', '.join(known)}")
    return name


@app.command()
@guarded
def optimize(
    spec: SpecArgument,
    output: OutputOption = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    method: MethodOption = "auto",
    time_limit: TimeLimitOption = None,
    best: Annotated[int, typer.Option(min=1, help="How many truly different designs.")] = 1,
    pareto: Annotated[bool, typer.Option("--pareto", help="The exact Pareto front too.")] = False,
    resource: Annotated[
        Literal["cost", "mass", "power"], typer.Option(help="What the front sets against error.")
    ] = "cost",
    write_design: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write the spec with the design pinned.")
    ] = None,
) -> int:
    """Find the best design, proven: optimum, exact front, runners-up, prices, what it hinges on."""
    from syncline_design.loading import load
    from syncline_design.optimisation import OptimizeSettings, optimisation_text, optimize
    from syncline_design.report.optimisations import OPTIMIZE_FORMATS, render_optimize

    targets = _targets(output, OPTIMIZE_FORMATS)
    loaded = load(spec)
    settings = OptimizeSettings(
        best, pareto, resource, _method(method), time_limit_s=time_limit, seed=seed
    )
    found = optimize(loaded, settings)
    if write_design is not None and found.exit_code == 0:
        _write_design(found, write_design)
    _emit(optimisation_text(found), targets, lambda n: render_optimize(n, found), quiet=quiet)
    return found.exit_code


def _write_design(found: Any, path: Path) -> None:
    from syncline_design.optimisation import pinned_text
    from syncline_design.spec_writer import write_spec

    write_spec(pinned_text(found.loaded, found.problem, found.designs[0]), path)
    print(f"design written to {path}", file=sys.stderr)


@app.command()
@guarded
def reproduce(output: OutputOption = None, quiet: QuietOption = False) -> int:
    """Compute every table and figure of the paper and compare it with what is printed."""
    from syncline_design import reproduce as paper

    targets = _targets(output, ("json", "html"))
    data = paper.reproduce()
    _emit(paper.text(data), targets, lambda name: _reproduction(name, data), quiet=quiet)
    return 0 if data.ok else 1


def _reproduction(name: str, data: Any) -> str:
    from syncline_design.report.json_out import json_text
    from syncline_design.report.pages import render_reproduction

    return json_text(data.to_json()) if name == "json" else render_reproduction(data.to_json())


@app.command()
@guarded
def schema(
    name: Annotated[Literal["spec", "catalog"], typer.Argument(help="spec or catalog")],
) -> int:
    """Print the JSON Schema of specs or catalogs, for editors."""
    from syncline_design.schema import schema_text

    sys.stdout.write(schema_text(name))
    return 0


@app.command()
@guarded
def init(
    directory: Annotated[Path, typer.Argument(help="Folder for the starter spec.")],
) -> int:
    """Write a commented starter spec and its schema into a folder."""
    from syncline_design.scaffold import init_project

    for path in init_project(directory):
        print(path)
    return 0


@app.command()
@guarded
def simulate(
    spec: SpecArgument,
    output: OutputOption = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    samples: Annotated[
        int | None, typer.Option(help="Monte Carlo samples; default: the spec's.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes for long runs; the result is the same.")
    ] = None,
) -> int:
    """Simulate the nonlinear chain against the Syncline over a grid of tau."""
    from syncline_design.loading import load
    from syncline_design.report.simulations import SIMULATE_FORMATS, render_simulate
    from syncline_design.simulate.summary import summary_text
    from syncline_design.simulated_spec import simulate_spec

    targets = _targets(output, SIMULATE_FORMATS)
    loaded = load(spec)
    run = simulate_spec(loaded, seed=seed, samples=samples, workers=workers)
    text = f"{loaded.spec.name} ({spec})\n\n{summary_text(run.result, run.system)}"
    _emit(text, targets, lambda name: render_simulate(name, run), quiet=quiet)
    return 0


@app.command()
@guarded
def diagnose(
    spec: SpecArgument,
    log: Annotated[
        list[Path] | None,
        typer.Argument(help="Measured logs (CSV, Parquet); default: the spec's `log: files:`."),
    ] = None,
    output: OutputOption = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    write_spec: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write the spec with the findings in it.")
    ] = None,
    false_alarm_rate: Annotated[
        float, typer.Option(min=0.0005, max=0.5, help="Chance that a clean log is found at fault.")
    ] = 0.05,
    max_effects: Annotated[int, typer.Option(min=0, max=20, help="Effects named at most.")] = 4,
) -> int:
    """Compare a measured log with the simulation: name what is missing, show the gap shrink."""
    from syncline_design.after_diagnosis import as_measured, meaning
    from syncline_design.diagnose import DiagnosisSettings, summary_text
    from syncline_design.diagnose import diagnose as diagnose_log
    from syncline_design.loading import load
    from syncline_design.report.diagnoses import DIAGNOSE_FORMATS, render_diagnose

    targets = _targets(output, DIAGNOSE_FORMATS)
    loaded = load(spec)
    settings = DiagnosisSettings(
        seed=seed, false_alarm_rate=false_alarm_rate, max_effects=max_effects
    )
    with _progress(quiet) as progress:
        found = diagnose_log(as_measured(loaded), log or (), settings, progress)
        means = meaning(loaded, found, seed)
    data, text = found.to_json(), f"{loaded.spec.name} ({spec})\n\n{summary_text(found)}"
    if means is not None:
        data["design"] = means.to_json()
        text += "\nWhat it means for the design:\n" + "".join(f"  {x}\n" for x in means.lines)
    if write_spec is not None and means is not None:
        from syncline_design.spec_writer import write_spec as write_checked

        write_checked(means.spec_text, write_spec)
        print(f"spec with the findings written to {write_spec}", file=sys.stderr)
    elif write_spec is not None:
        print("nothing was found: no spec written", file=sys.stderr)
    _emit(text, targets, lambda name: render_diagnose(name, data), quiet=quiet)
    return found.exit_code


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


@catalog_app.command("list")
@guarded
def catalog_list(
    section: Annotated[
        str | None,
        typer.Argument(help="platforms, sensors, timestamping, infrastructure or clocks."),
    ] = None,
) -> int:
    """List what the built-in catalogs hold."""
    from syncline_design.loading import load_builtin
    from syncline_design.report.catalogs import SECTIONS, list_text

    if section is not None and section not in SECTIONS:
        _refuse(f"syncline-design: catalog list {section}: expected one of {', '.join(SECTIONS)}")
    sys.stdout.write(list_text(load_builtin(), section))
    return 0


@catalog_app.command("show")
@guarded
def catalog_show(identity: Annotated[str, typer.Argument(metavar="ID")]) -> int:
    """Show one catalog entry with its figures, sources and assumptions."""
    from syncline_design.loading import load_builtin
    from syncline_design.report.catalogs import show_text, suggestion

    catalog = load_builtin()
    text = show_text(catalog, identity)
    if text is None:
        _refuse(
            f"syncline-design: catalog show {identity}: no such entry"
            f"{suggestion(catalog, identity)}"
        )
    sys.stdout.write(text)
    return 0


def main() -> None:
    """Entry point of the `syncline-design` command."""
    app()


if __name__ == "__main__":
    main()
