"""The only place that writes files: whole or not at all, the old file intact on failure.

A file is written beside its place under a name of this program and moved there in one step.  While
that lasts it is locked (flock(2)), so that what a killed run left behind can be told from what a
running one still writes: only the former is cleared away, by the next run that writes there.
What a symlink leads to is replaced, the link stays; devices and pipes are written through.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import stat
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Final

from syncline_design.machine.deadline import OutOfTime, of_command, overdue
from syncline_design.machine.quick_dataclass import dataclass

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # no locks here: nothing is cleared away
    fcntl = None

_PIECE: Final = 4096  # what a pipe takes at once or not at all
_TEMPORARY: Final = re.compile(r"\.syncline-design-[0-9a-f]{32}\.part")
_DESCRIPTOR: Final = re.compile(r"/(?:dev/fd|proc/(?:self|thread-self)/fd)/([0-9]{1,6})")
_STANDARD: Final = {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}
_FLAGS: Final = os.O_CREAT | os.O_EXCL | os.O_RDWR | getattr(os, "O_CLOEXEC", 0)


class OutputError(Exception):
    """A result could not be written; the message says which, why and what to do."""


@dataclass(frozen=True, slots=True)
class _Staged:
    """A text on the disk beside its place; `descriptor` holds the lock."""

    temporary: Path
    descriptor: int
    final: Path


def descriptor_of(path: str | Path) -> int | None:
    """The open descriptor that a path such as /dev/stdout or /dev/fd/3 means."""
    text = str(path)
    found = _DESCRIPTOR.fullmatch(text)
    return int(found[1]) if found else _STANDARD.get(text)


def is_stream(path: str | Path) -> bool:
    """A device, a pipe or an open descriptor: written through, nothing there to keep intact."""
    if descriptor_of(path) is not None:
        return True
    try:
        mode = Path(path).stat().st_mode
    except (OSError, ValueError):
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def write_file(path: str | Path, content: bytes) -> None:
    """Write one file in one step; OutputError leaves the old one as it was."""
    write_files([(path, content)])


def write_files(files: Sequence[tuple[str | Path, bytes]]) -> None:
    """Write several files: all are on the disk before the first one is put in place."""
    staged: list[_Staged] = []
    try:
        for path, content in files:
            if not is_stream(path):
                staged.append(_stage(_final(path), content))
        for item in staged:
            _put_in_place(item)
    finally:
        for item in staged:
            _discard(item)
    for path, content in files:
        if is_stream(path):
            _write_through(Path(path), content)


def _final(path: str | Path) -> Path:
    """The file that a path means: what a symlink leads to, be it there yet or not."""
    final = Path(os.path.realpath(path))
    if final.is_symlink():
        raise OutputError(f"{path}: cannot write: a symlink that leads in a circle")
    return final


def replace_whole(final: Path, content: bytes) -> None:
    """Put a file in place in one step without waiting for the disk; OSError."""
    temporary, descriptor = _temporary_in(final.parent)
    try:
        write_all(descriptor, content)
        temporary.replace(final)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    finally:
        os.close(descriptor)


def clear_stale(folder: Path) -> None:
    """Remove temporary files that this program left in a folder when it was killed."""
    if fcntl is None:
        return
    try:
        with os.scandir(folder) as entries:
            found = [Path(e.path) for e in entries if _TEMPORARY.fullmatch(e.name)]
    except OSError:
        return
    for path in found:
        with contextlib.suppress(OSError):
            _remove_dead(path)


def _remove_dead(path: Path) -> None:
    """Remove a temporary file of this user that no running process holds."""
    assert fcntl is not None
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    descriptor = os.open(path, flags)
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode) or status.st_uid != os.geteuid():
            return
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # OSError: somebody writes it
        now = path.lstat()
        if (now.st_dev, now.st_ino) == (status.st_dev, status.st_ino):
            path.unlink()
    finally:
        os.close(descriptor)


def _temporary_in(folder: Path) -> tuple[Path, int]:
    """A new locked temporary file; one that was cleared away before it was locked is made anew."""
    while True:
        path = folder / f".syncline-design-{secrets.token_hex(16)}.part"
        descriptor = os.open(path, _FLAGS, 0o600)
        if fcntl is not None:
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_nlink:
            return path, descriptor
        os.close(descriptor)


def _feed(descriptor: int, content: bytes) -> None:
    """Write to a device or a pipe; OutOfTime where the command's time is over and nobody reads.

    As long as there is a reader, however slow, it gets everything.
    """
    for start in range(0, max(len(content), 1), _PIECE):
        with overdue(of_command()):
            write_all(descriptor, content[start : start + _PIECE])


def write_all(descriptor: int, content: bytes) -> None:
    left = memoryview(content)
    while left:
        left = left[os.write(descriptor, left) :]


def _stage(final: Path, content: bytes) -> _Staged:
    """Write a text to a temporary file in the folder of `final`, down to the disk."""
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        clear_stale(final.parent)
        temporary, descriptor = _temporary_in(final.parent)
    except OSError as error:
        raise explained(final, error) from None
    staged = _Staged(temporary, descriptor, final)
    try:
        write_all(descriptor, content)
        os.fsync(descriptor)
        temporary.chmod(_mode_for(final))
    except OSError as error:
        _discard(staged)
        raise explained(final, error) from None
    except BaseException:
        _discard(staged)
        raise
    return staged


def _discard(staged: _Staged) -> None:
    """Let go of a temporary file, whether it was moved to its place or not."""
    with contextlib.suppress(OSError):
        staged.temporary.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        os.close(staged.descriptor)


def _mode_for(final: Path) -> int:
    """The old file's permissions, or those the process gives new files (a temporary has 0600)."""
    with contextlib.suppress(OSError):
        return final.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _put_in_place(staged: _Staged) -> None:
    try:
        staged.temporary.replace(staged.final)
    except OSError as error:
        raise explained(staged.final, error) from None
    with contextlib.suppress(OSError):  # some file systems cannot sync a folder
        descriptor = os.open(staged.final.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _write_through(path: Path, content: bytes) -> None:
    number = descriptor_of(path)
    try:
        if number in (1, 2):
            with contextlib.suppress(AttributeError, ValueError):
                (sys.stdout if number == 1 else sys.stderr).flush()
        with overdue(of_command()):  # a pipe opens once somebody reads it
            opened = os.open(path, os.O_WRONLY) if number is None else os.dup(number)
        try:
            _feed(opened, content)
        finally:
            os.close(opened)
    except OSError as error:
        raise explained(path, error) from None
    except OutOfTime:
        limit = f"the time limit of {of_command().limit_s:g} s is over"
        raise OutputError(f"{path}: cannot write: nobody reads it, and {limit}") from None


def explained(final: Path, error: OSError) -> OutputError:
    """The error for a file that could not be written."""
    reason = error.strerror or str(error)
    if is_stream(final):
        return OutputError(f"{final}: cannot write: {reason}")
    kept = "the file that was there is unchanged" if final.exists() else "nothing was written"
    return OutputError(f"{final}: cannot write: {reason}; {kept}")
