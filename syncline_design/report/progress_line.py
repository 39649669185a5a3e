"""Progress of a study on standard error: one line that renews itself, or one now and then."""

from __future__ import annotations

import sys
import time
from typing import TextIO

from syncline_design.report.study_words import progress_text
from syncline_design.study.progress import Progress

ON_TERMINAL_S, IN_LOG_S = 0.2, 10.0


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
