"""Files that only grow: one whole line after the other, each on the disk before the next.

A line is written in one call under a lock and waited for (fsync), so a kill leaves at most one
line without its end.  Whoever writes next finds it and takes it away: it was never acknowledged.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from syncline_design.machine.input_files import UnsuitableError, demand_plain
from syncline_design.machine.result_files import explained, fcntl, write_all


def append_line(path: Path, line_after: Callable[[bytes], bytes]) -> None:
    """Append the line (its end included) that follows what the file holds; OutputError.

    line_after: from the file's whole lines to the line to append; what it raises leaves the file
    as it was, and makes none where there was none.
    """
    try:
        descriptor, made = _locked(path)
    except OSError as error:
        raise explained(path, error) from None
    except UnsuitableError as error:
        raise explained(path, OSError(str(error))) from None
    try:
        whole = whole_lines(_content(descriptor))
        line = line_after(whole)
        os.ftruncate(descriptor, len(whole))
        os.lseek(descriptor, 0, os.SEEK_END)
        try:
            write_all(descriptor, line)
            os.fsync(descriptor)
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(descriptor, len(whole))
            raise
        if made:
            _keep_name(path)
    except OSError as error:
        _unmake(path, descriptor, made=made)
        raise explained(path, error) from None
    except BaseException:
        _unmake(path, descriptor, made=made)
        raise
    finally:
        os.close(descriptor)


def _locked(path: Path) -> tuple[int, bool]:
    """The file, locked, and whether it was made for that.

    Whoever waited for the lock looks again whether the file is still the one of that name: another
    may have taken it away, and a line in it would be lost.
    """
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0)
    while True:
        try:
            descriptor, made = os.open(path, flags | os.O_EXCL, 0o666), True
        except FileExistsError:
            descriptor, made = os.open(path, flags, 0o666), False
        try:
            demand_plain(os.fstat(descriptor))
            if fcntl is not None:
                with contextlib.suppress(OSError):  # a file system without locks
                    fcntl.flock(descriptor, fcntl.LOCK_EX)
            if fcntl is None or _is_named(path, descriptor):
                return descriptor, made
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _is_named(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _unmake(path: Path, descriptor: int, *, made: bool) -> None:
    """Take a file away that was made for a line that did not come; it is locked still."""
    with contextlib.suppress(OSError):
        if made and os.fstat(descriptor).st_size == 0 and _is_named(path, descriptor):
            path.unlink()


def _keep_name(path: Path) -> None:
    """Wait until the name of a new file is on the disk, too."""
    with contextlib.suppress(OSError):  # a folder that cannot be opened, as on Windows
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def whole_lines(content: bytes) -> bytes:
    """What a file holds up to its last line end: all that was written whole."""
    return content[: content.rfind(b"\n") + 1]


def _content(descriptor: int) -> bytes:
    parts = []
    os.lseek(descriptor, 0, os.SEEK_SET)
    while part := os.read(descriptor, 1 << 20):
        parts.append(part)
    return b"".join(parts)
