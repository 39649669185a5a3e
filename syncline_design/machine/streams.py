"""Standard streams that may be closed or full, and messages that nothing in them can turn.

A message that cannot be written must not change the exit code, and the name of a file must not
move the cursor or speak to the CI system that reads along.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import sys
from typing import Any, TextIO, cast

_COMMAND = re.compile(r"^(\s*)::", re.MULTILINE)  # of GitHub Actions, at the start of a line


def secure_streams() -> None:
    """Make all three standard descriptors usable: none is handed to the next file opened.

    A closed standard error swallows what is said; a closed standard output says so when a result
    is to be written.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which is this
    if sys.stdout is None:
        sys.stdout = cast(TextIO, _Closed())
    sys.stderr = cast(TextIO, _Forgiving(sys.stderr))


class _Closed(io.TextIOBase):
    """Standard output that was closed before the program began."""

    def write(self, _: str) -> int:
        raise OSError(errno.EBADF, "it is closed")

    def writable(self) -> bool:
        return True


class _Forgiving(io.TextIOBase):
    """Standard error that never fails; what goes to no terminal is made harmless."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        if self._stream is not None:
            shown = text if self.isatty() else harmless(text)
            try:
                self._stream.write(shown)
            except (OSError, ValueError):
                self._give_up()
        return len(text)

    def flush(self) -> None:
        if self._stream is not None:
            try:
                self._stream.flush()
            except (OSError, ValueError):
                self._give_up()

    def _give_up(self) -> None:
        """Send what is still buffered to nowhere, or the interpreter fails on it at exit."""
        if self._stream is not None:
            with contextlib.suppress(OSError, ValueError):
                number = os.open(os.devnull, os.O_WRONLY)
                os.dup2(number, self._stream.fileno())
                os.close(number)
        self._stream = None

    def isatty(self) -> bool:
        with contextlib.suppress(OSError, ValueError):
            return self._stream is not None and self._stream.isatty()
        return False

    def fileno(self) -> int:
        if self._stream is None:
            raise OSError(errno.EBADF, "standard error is closed")
        return self._stream.fileno()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return getattr(self._stream, "encoding", None) or "utf-8"

    def writable(self) -> bool:
        return True

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__.get("_stream"), name)


def harmless(text: str, *, one_line: bool = False) -> str:
    """Text with control characters escaped and no line that a CI system takes for a command."""
    kept = "" if one_line else "\n\t"
    plain = "".join(c if c.isprintable() or c in kept else _escaped(c) for c in text)
    return without_commands(plain)


def without_commands(text: str) -> str:
    """Text without a line that GitHub Actions takes for a workflow command."""
    return _COMMAND.sub(r"\1\\x3a:", text).replace("##[", "#\\x23[")


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def say(message: str) -> None:
    """One message on standard error, whatever state that is in."""
    stream = sys.stderr
    if stream is not None:
        with contextlib.suppress(OSError, ValueError):
            stream.write(harmless(message) + "\n")
            stream.flush()
