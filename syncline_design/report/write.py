"""Where results go: `--output FORMAT:PATH` read, checked before anything is computed, written."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.result_files import OutputError, descriptor_of, is_stream, write_files
from syncline_design.report.formats import CHART_FORMATS, NOT_FOR_A_TERMINAL

__all__ = [
    "STDOUT", "OutputError", "OutputTarget", "apart", "check_targets", "check_writable",
    "parse_target", "write_outputs",
]  # fmt: skip

STDOUT: Final = "-"
_OURS: Final = b'name="generator" content="syncline-design"'
_HEAD_BYTES: Final = 4096


@dataclass(frozen=True, slots=True)
class OutputTarget:
    """One `--output FORMAT:PATH`; path `-` is standard output; named: by the user."""

    format: str
    path: str
    named: bool = True


def parse_target(argument: str, known: Sequence[str], stem: str = "report") -> OutputTarget:
    """`html:out/report.html` -> Target; OutputError for an unknown format or an empty path.

    A bare format means standard output, as in `--output json`; pages and binary tables, which are
    of no use on a terminal, go to a file in the working folder named after `stem`.
    """
    name, separator, path = argument.partition(":")
    if name in known and name in CHART_FORMATS and path in ("", STDOUT):
        raise OutputError(
            f"--output {argument}: charts go into a folder, a file each; expected {name}:FOLDER, "
            f"as in --output {name}:charts"
        )
    if name not in known:
        raise OutputError(
            f"--output {argument}: unknown format {name!r}; expected one of {', '.join(known)}, "
            "as in --output json:result.json"
        )
    if separator and not path:
        raise OutputError(
            f"--output {argument}: no path after the colon; expected {name}:PATH, or {name}:- "
            "for standard output"
        )
    if not separator and name in NOT_FOR_A_TERMINAL:
        path = f"{stem}.{name}"
        _keep_others(Path(path), argument)
        return OutputTarget(name, path, named=False)
    return OutputTarget(name, STDOUT if not separator or descriptor_of(path) == 1 else path)


def _keep_others(path: Path, argument: str) -> None:
    """Refuse to replace, under a name that nobody gave, what is no page of ours."""
    try:
        with path.open("rb") as file:
            ours = _OURS in file.read(_HEAD_BYTES)
    except FileNotFoundError:
        return
    except OSError:
        ours = False
    if not ours:
        raise OutputError(
            f"--output {argument}: {path} exists and is no page of syncline-design; "
            f"name the file, as in --output {argument}:PATH"
        )


def check_targets(targets: Sequence[OutputTarget], reads: Sequence[Path] = ()) -> None:
    """Refuse, before anything is computed, targets that cannot be written or that collide.

    reads: files that the command is known to read; no result may take the place of one of them,
    nor of any YAML file, which would be a spec or a catalog.  What the command finds to read later
    on is held against the same targets when it is opened (`input_files.claim_outputs`).
    """
    inputs = {os.path.realpath(path) for path in reads}
    seen: set[str] = set()
    for target in targets:
        if target.format in CHART_FORMATS:
            _check_folder(target, inputs)
            continue
        key = STDOUT if target.path == STDOUT else os.path.realpath(target.path)
        if key in seen:
            where = "standard output" if key == STDOUT else target.path
            raise _twice(where)
        seen.add(key)
        _keep_from_charts(target, targets)
        if target.path.endswith("/"):
            raise _a_folder(target.path)
        if target.path != STDOUT and not is_stream(target.path):
            _keep_inputs(target, key, inputs)
            check_writable(Path(target.path))


def _twice(path: str) -> OutputError:
    return OutputError(f"two outputs go to {path}; give each its own path")


def _a_folder(path: str | Path) -> OutputError:
    return OutputError(f"{path}: is a folder; give the name of a file in it")


def _keep_from_charts(target: OutputTarget, targets: Sequence[OutputTarget]) -> None:
    """Refuse a file that a chart of another target might take the place of."""
    path = Path(os.path.realpath(target.path))
    for other in targets:
        charts = other.format in CHART_FORMATS and path.suffix == f".{other.format}"
        if charts and target.path != STDOUT and path.parent == Path(os.path.realpath(other.path)):
            raise _twice(target.path)


def _check_folder(target: OutputTarget, inputs: set[str]) -> None:
    """Refuse a place for charts that is a file, or cannot become a folder."""
    path = Path(target.path)
    if os.path.realpath(path) in inputs or (path.exists() and not path.is_dir()):
        raise OutputError(f"{target.path}: is no folder; {target.format} writes a file a chart")
    check_writable(path / f"chart.{target.format}")
    for place in chart_places([target]):
        _keep_inputs(target, os.path.realpath(place), inputs, place)


def chart_places(targets: Sequence[OutputTarget]) -> list[Path]:
    """What lies where charts may go, links as well: a chart would take its place."""
    return [
        place
        for target in targets
        if target.format in CHART_FORMATS
        for place in sorted(Path(target.path).glob(f"*.{target.format}"))
    ]


def apart(path: Path, targets: Sequence[OutputTarget]) -> None:
    """Refuse a file that is written besides the targets and is one of them."""
    key = os.path.realpath(path)
    for target in targets:
        if target.path != STDOUT and os.path.realpath(target.path) == key:
            raise _twice(target.path)


def _keep_inputs(
    target: OutputTarget, key: str, inputs: set[str], place: Path | None = None
) -> None:
    shown = target.path if place is None else place
    if key in inputs:
        raise OutputError(f"{shown}: is read by this command; write the result elsewhere")
    if key.endswith((".yaml", ".yml")) and Path(key).is_file():
        raise OutputError(
            f"{shown}: a YAML file is there, perhaps a spec or a catalog; "
            f"write {target.format} elsewhere"
        )


def check_writable(path: Path) -> None:
    """Refuse a path that cannot become a file."""
    try:
        path.lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise OutputError(f"{str(path)[:80]}...: the name is too long for a file") from None
    if path.is_dir():
        raise _a_folder(path)
    if is_stream(path):
        return
    parent = Path(os.path.realpath(path)).parent
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir():
        raise OutputError(f"{path}: {parent} is not a folder")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: no permission to write in {parent}")


def write_outputs(rendered: Sequence[tuple[OutputTarget, str | bytes]]) -> None:
    """Write every rendered text; files first, each atomically, then standard output.

    A full disk leaves every old file as it was.
    """
    write_files([(t.path, _encoded(text)) for t, text in rendered if t.path != STDOUT])
    for target, text in rendered:
        if target.path == STDOUT:
            _print(text)


def _encoded(text: str | bytes) -> bytes:
    return text if isinstance(text, bytes) else text.encode("utf-8", "backslashreplace")


def _print(text: str | bytes) -> None:
    """Print to standard output in UTF-8, whatever the locale says."""
    data = text if isinstance(text, bytes) or text.endswith("\n") else text + "\n"
    try:
        binary = getattr(sys.stdout, "buffer", None)
        if binary is None and isinstance(data, str):  # a text-only stand-in, as under a test runner
            sys.stdout.write(data)
        elif binary is not None:
            sys.stdout.flush()
            binary.write(_encoded(data))
        else:
            raise OutputError("standard output: takes text only; give this format a path")
        sys.stdout.flush()
    except OSError as error:
        _silence_stdout()
        reason = "closed by the reader" if isinstance(error, BrokenPipeError) else error.strerror
        raise OutputError(f"standard output: cannot write: {reason or error}") from None


def _silence_stdout() -> None:
    """Send what is still buffered to nowhere, or the interpreter fails on it again at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
