"""Progress on standard error: one line that renews itself, for a study also one now and then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from syncline_design.model.figure_text import grouped
from syncline_design.report import numbers

if TYPE_CHECKING:
    from syncline_design.studies.result import Progress

ON_TERMINAL_S, IN_LOG_S = 0.2, 10.0
SILENT_S = 1.0  # nothing is said of what is done within a second


class ProgressLine:
    """Call it with every Progress; it writes as often as a reader can use."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._last = 0.0

    def __call__(self, progress: Progress) -> None:
        """Write the line when it is time to, and always at the end."""
        now = time.monotonic()
        done = progress.done >= progress.total
        if now - self._last < (ON_TERMINAL_S if self._live else IN_LOG_S) and not done:
            return
        self._last = now
        text = progress_text(progress)
        if self._live:
            self._stream.write(f"\r\x1b[2K{text}" + ("\n" if done else ""))
        else:
            self._stream.write(text + "\n")
        self._stream.flush()


class StepLine:
    """What a command is doing: on a terminal a line that renews itself, once it takes longer than a
    second; in a log a line now and then."""

    def __init__(self, stream: TextIO | None = None, *, quiet: bool = False) -> None:
        self._stream = stream or sys.stderr
        self._quiet = quiet
        self._live = self._stream.isatty()
        self._last = 0.0
        self._shown = False

    def __call__(self, doing: str, elapsed_s: float) -> None:
        """Renew the line when it is time to."""
        every_s = ON_TERMINAL_S if self._live else IN_LOG_S
        if self._quiet or elapsed_s < SILENT_S or elapsed_s - self._last < every_s:
            return
        self._last, self._shown = elapsed_s, self._live
        text = f"{doing or 'working'} ({numbers.places(elapsed_s, 0)} s)"
        self._stream.write(f"\r\x1b[2K{text}" if self._live else f"{text}\n")
        self._stream.flush()

    def clear(self) -> None:
        """Take the line away."""
        if self._shown:
            self._stream.write("\r\x1b[2K")
            self._stream.flush()
            self._shown = False


@contextmanager
def busy(doing: str) -> Iterator[None]:
    """Signs of progress while something is done that cannot be asked how far it is."""
    line, over, start = StepLine(), threading.Event(), time.monotonic()

    def tell() -> None:
        while not over.wait(ON_TERMINAL_S):
            line(doing, time.monotonic() - start)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()
        line.clear()


def progress_text(progress: Progress) -> str:
    """`180 of 500 cases, 40 already there, 00:12 left`."""
    parts = [f"{grouped(progress.done)} of {grouped(progress.total)} cases"]
    if progress.reused:
        parts.append(f"{grouped(progress.reused)} already there")
    if progress.retried:
        parts.append(f"{grouped(progress.retried)} done again")
    left = progress.remaining_s
    if progress.done < progress.total:
        parts.append("estimating" if left is None else f"{_clock(left)} left")
    else:
        parts.append(f"took {_clock(progress.elapsed_s)}")
    return ", ".join(parts)


def _clock(seconds: float) -> str:
    whole = round(seconds)
    hours, rest = divmod(whole, 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes:02d}:{left:02d}"
