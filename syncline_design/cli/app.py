"""The command line: parse, call, print, exit.

Exit codes: 0 meets, 1 does not meet (infeasible included), 2 bad spec or usage, 3 no verdict.
"""

from __future__ import annotations

import copy
import gc
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from syncline_design import __version__
from syncline_design.cli import (
    acceptance,
    clocks,
    design,
    drives,
    evidence,
    library,
    logs,
    stamps,
    watching,
)
from syncline_design.cli.shared import NO_VERDICT
from syncline_design.machine.processes import forget_working_folder
from syncline_design.machine.streams import say, secure_streams
from syncline_design.report.formats import EVERY_FORMAT

OUTPUT = ("-o", "--output")
COMPLETION = "_SYNCLINE_DESIGN_COMPLETE"  # a shell's question: source_bash, complete_bash, ...


class _Commands(TyperGroup):
    """The commands; an empty argument (an unset variable, say) is not the working folder.

    Its help ends with an example too: of a command of its own.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        super().format_help(ctx, formatter)
        _tell_example(f"{_called(ctx)} {FIRST[ctx.info_name if ctx.parent else '']}".strip())

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for argument in args:
            if not argument or (argument.startswith("--") and argument.endswith("=")):
                shown = argument or '""'
                ctx.fail(f"an empty argument ({shown}); expected a path or a value")
        return super().parse_args(ctx, args)


class _Command(TyperCommand):
    """A command whose help ends with an example, in one line however long: a terminal shows it in
    several, yet what is copied from there is one call again.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, each_output(args))

    def format_help(self, ctx: Any, formatter: Any) -> None:
        super().format_help(ctx, formatter)
        _tell_example(_called(ctx))


def _called(ctx: Any) -> str:
    """The words by which a command was called, without the program's: `catalog list`."""
    words: list[str] = []
    while ctx.parent is not None:
        words.insert(0, ctx.info_name)
        ctx = ctx.parent
    return " ".join(words)


def _tell_example(name: str) -> None:
    typer.echo(f" Example: syncline-design {name} {EXAMPLES[name]}\n")


def each_output(args: list[str]) -> list[str]:
    """`-o svg:a png:b` as `-o svg:a -o png:b`, where `png:b` is no file that is there."""
    found: list[str] = []
    for argument in args:
        before = found[-2:]
        after_output = before[:-1] in ([one] for one in OUTPUT) or _is_output(before[-1:])
        form, colon, _ = argument.partition(":")
        if after_output and colon and form in EVERY_FORMAT and not Path(argument).exists():
            found.append(OUTPUT[0])
        found.append(argument)
    return found


def _is_output(before: list[str]) -> bool:
    """Whether the argument before holds option and value in one: `-ohtml`, `--output=html`."""
    return any(one.startswith(("-o", "--output=")) and one not in OUTPUT for one in before)


app = typer.Typer(
    name="syncline-design",
    cls=_Commands,
    help="Choose, verify and diagnose sensor payloads and their time synchronisation.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
catalog = typer.Typer(
    help="Look into the built-in catalogs, check and grow your own.", no_args_is_help=True,
    cls=_Commands,
)  # fmt: skip
app.add_typer(catalog, name="catalog")
log = typer.Typer(help="Look into logs of every kind.", no_args_is_help=True, cls=_Commands)
app.add_typer(log, name="log")

FIRST = {"": "init", "catalog": "list", "log": "inspect"}  # the example of a group of commands
EXAMPLES = {  # by command, what its help ends with
    "check": "specs/uav_corridor.yaml -o html -o junit:result.xml",
    "optimize": "specs/uav_corridor.yaml --pareto --best 3 -o html",
    "simulate": "specs/uav_corridor.yaml --samples 100000 -o csv:errors.csv",
    "diagnose": "examples/hidden_latency.yaml examples/hidden_latency.csv --write-spec found.yaml",
    "watch": "drone7.jsonl examples/hidden_latency.yaml examples/hidden_latency.csv",
    "plan": "examples/hidden_latency.yaml --reach 'latency(position)=1 ms' -o html",
    "study": "specs/studies/uav_distance.yaml -o html -o csv:cases.csv",
    "diff": "specs/usv_mapping.yaml specs/usv_wire_missing.yaml -o markdown:diff.md",
    "timing": "/var/log/chrony/tracking.log --spec specs/uav_corridor.yaml -o html",
    "audit": "examples/hidden_latency.csv --spec examples/hidden_latency.yaml",
    "accept": "examples/hidden_latency.yaml examples/hidden_latency.csv --only latency",
    "reproduce": "-o html",
    "catalog list": "sensors --modality ranging --reach '120 m'",
    "catalog show": "velodyne_hdl32e",
    "catalog check": "lab.yaml",
    "catalog add": "--from-template lidar --to lab.yaml",
    "log inspect": "examples/hidden_latency.csv --spec examples/hidden_latency.yaml",
    "schema": "verdict",
    "init": "survey",
}


def _add(name: str, run: Callable[..., None]) -> None:
    """A command, by its name after the program's, with an example below its help."""
    group, _, own = name.rpartition(" ")
    home = {"": app, "catalog": catalog, "log": log}[group]
    home.command(own, cls=_Command)(run)


COMMANDS: dict[str, Callable[..., None]] = {
    "check": design.check,
    "optimize": design.optimize,
    "simulate": evidence.simulate,
    "diagnose": evidence.diagnose,
    "watch": watching.watch,
    "plan": drives.plan,
    "study": design.study,
    "diff": design.diff,
    "timing": clocks.timing,
    "audit": stamps.audit,
    "accept": acceptance.accept,
    "reproduce": evidence.reproduce,
    "catalog list": library.catalog_list,
    "catalog show": library.catalog_show,
    "catalog check": library.catalog_check,
    "catalog add": library.catalog_add,
    "log inspect": logs.inspect,
    "schema": library.schema,
    "init": library.init,
}
for _name, _run in COMMANDS.items():
    _add(_name, _run)


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


def called(arguments: list[str]) -> typer.Typer:
    """The application with the command that is called alone: reading the parameters of all others
    takes a tenth of a short command's time. Whole where no command comes first.
    """
    first = arguments[0] if arguments else ""
    one = copy.copy(app)
    one.registered_commands = [each for each in app.registered_commands if each.name == first]
    one.registered_groups = [each for each in app.registered_groups if each.name == first]
    return one if one.registered_commands or one.registered_groups else app


def main() -> None:
    """Entry point of the `syncline-design` command."""
    if COMPLETION in os.environ:
        _complete()
    secure_streams()
    forget_working_folder()
    _start_quickly()
    try:
        called(sys.argv[1:])()
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # help, or the version, to `| true`
            say("syncline-design: standard output: cannot write: closed by the reader")
            raise SystemExit(NO_VERDICT) from None
        raise
    except OSError as error:  # help, or the version, to a standard output that takes nothing
        say(f"syncline-design: standard output: cannot write: {error.strerror or error}")
        raise SystemExit(NO_VERDICT) from None


def _complete() -> None:
    """Answer a shell that asks how a word goes on, or for the script with which it asks."""
    from typer.completion import completion_init  # type: ignore[attr-defined]

    forget_working_folder()
    completion_init()
    app(prog_name="syncline-design", complete_var=COMPLETION)  # ends the process


def _start_quickly() -> None:
    """Spare a short command what only long ones need; commands import their parts after this.

    While it imports, a command makes many lasting objects and little garbage: looking for cycles as
    often as Python does by default costs a tenth of its time.  Looking for validation plugins among
    all installed packages costs about as much, and there are none.  Matrices are small and many:
    threads of the linear algebra library slow them down, and could change the last bits.
    """
    gc.set_threshold(50_000, 20, 20)
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    for name in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{name}_NUM_THREADS", "1")
