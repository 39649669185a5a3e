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
    as it was.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
    except OSError as error:
        raise explained(path, error) from None
    try:
        demand_plain(os.fstat(descriptor))
        if fcntl is not None:
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
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
    except OSError as error:
        raise explained(path, error) from None
    except UnsuitableError as error:
        raise explained(path, OSError(str(error))) from None
    finally:
        os.close(descriptor)


def whole_lines(content: bytes) -> bytes:
    """What a file holds up to its last line end: all that was written whole."""
    return content[: content.rfind(b"\n") + 1]


def _content(descriptor: int) -> bytes:
    parts = []
    os.lseek(descriptor, 0, os.SEEK_SET)
    while part := os.read(descriptor, 1 << 20):
        parts.append(part)
    return b"".join(parts)
