"""The only place that writes result files: all or nothing, the old file intact on failure."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

STDOUT: Final = "-"


class OutputError(Exception):
    """A result could not be written; the message says which, why and what to do."""


@dataclass(frozen=True, slots=True)
class Target:
    """One `--output FORMAT:PATH`; path `-` is standard output."""

    format: str
    path: str


def parse_target(argument: str, known: Sequence[str]) -> Target:
    """`html:out/report.html` -> Target; OutputError for an unknown format or an empty path.

    A bare format means standard output, as in `--output json`.
    """
    name, separator, path = argument.partition(":")
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
    return Target(name, path if separator else STDOUT)


def check_targets(targets: Sequence[Target], reads: Sequence[Path] = ()) -> None:
    """Refuse, before anything is computed, targets that cannot be written or that collide.

    reads: files that the command reads; no result may take the place of one of them, nor of any
    YAML file, which would be a spec or a catalog.
    """
    inputs = {os.path.realpath(path) for path in reads}
    seen: set[str] = set()
    for target in targets:
        key = STDOUT if target.path == STDOUT else os.path.realpath(target.path)
        if key in seen:
            where = "standard output" if key == STDOUT else target.path
            raise OutputError(f"two outputs go to {where}; give each its own path")
        seen.add(key)
        _keep_inputs(target, key, inputs)
        if target.path != STDOUT:
            _check_writable(Path(target.path))


def _keep_inputs(target: Target, key: str, inputs: set[str]) -> None:
    if target.path == STDOUT:
        return
    if key in inputs:
        raise OutputError(f"{target.path}: is read by this command; write the result elsewhere")
    if key.endswith((".yaml", ".yml")) and Path(key).is_file():
        raise OutputError(
            f"{target.path}: a YAML file is there, perhaps a spec or a catalog; "
            f"write {target.format} elsewhere"
        )


def _check_writable(path: Path) -> None:
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file in it")
    if _is_stream(path):
        return
    parent = path.parent
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir():
        raise OutputError(f"{path}: {parent} is not a folder")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: no permission to write in {parent}")


def _is_stream(path: Path) -> bool:
    """A device or pipe, such as /dev/null: written to directly, nothing there to keep intact."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write_outputs(rendered: Sequence[tuple[Target, str | bytes]]) -> None:
    """Write every rendered text; files first, each atomically, then standard output.

    All texts are written to temporary files beside their targets before the first one is put in
    place, so that a full disk leaves every old file as it was.
    """
    staged: list[tuple[Path, Path]] = []
    files = [(Path(os.path.realpath(t.path)), text) for t, text in rendered if t.path != STDOUT]
    try:
        for final, text in files:
            if not _is_stream(final):
                staged.append((_stage(final, text), final))
        for temporary, final in staged:
            _put_in_place(temporary, final)
    finally:
        for temporary, _ in staged:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
    for final, text in files:
        if _is_stream(final):
            _write_stream(final, text)
    for target, text in rendered:
        if target.path == STDOUT:
            _print(text)


def _stage(final: Path, text: str | bytes) -> Path:
    """Write text to a temporary file in the folder of `final`, down to the disk."""
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(prefix=f".{final.name[:80]}.", dir=final.parent)
    except OSError as error:
        raise _explained(final, error) from None
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(_encoded(text))
            stream.flush()
            os.fsync(stream.fileno())
        Path(name).chmod(_mode_for(final))
    except OSError as error:
        with contextlib.suppress(OSError):
            Path(name).unlink(missing_ok=True)
        raise _explained(final, error) from None
    return Path(name)


def _encoded(text: str | bytes) -> bytes:
    return text if isinstance(text, bytes) else text.encode("utf-8")


def _mode_for(final: Path) -> int:
    """The old file's permissions, or those the process gives new files (mkstemp gives 0600)."""
    with contextlib.suppress(OSError):
        return final.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _put_in_place(temporary: Path, final: Path) -> None:
    try:
        temporary.replace(final)
    except OSError as error:
        raise _explained(final, error) from None
    with contextlib.suppress(OSError):  # some file systems cannot sync a folder
        descriptor = os.open(final.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _write_stream(path: Path, text: str | bytes) -> None:
    try:
        with path.open("wb") as stream:
            stream.write(_encoded(text))
    except OSError as error:
        raise _explained(path, error) from None


def _explained(final: Path, error: OSError) -> OutputError:
    reason = error.strerror or str(error)
    if _is_stream(final):
        return OutputError(f"{final}: cannot write: {reason}")
    kept = "the file that was there is unchanged" if final.exists() else "nothing was written"
    return OutputError(f"{final}: cannot write: {reason}; {kept}")


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
