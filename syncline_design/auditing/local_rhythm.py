"""Stamps on a grid of sensors whose interval changes slowly: were they cut off to it, or measured?

Over some dozen messages such a sensor (a sonar that waits for its echo) keeps a smooth course, and
stamps that a grid cuts off lie up to a grain before it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.series import Array

_STRETCH: Final = 16  # messages
_POWERS: Final = 3  # of a course over them: a parabola
_WITHIN: Final = 1.15  # grains about a course, of what a grid makes
_LEAST: Final = 6  # stretches


def off_course(when: Array, late: Array, grain_s: float) -> tuple[Array, Array] | None:
    """By how much stamps lie off the smooth course of those around them, and receipts minus stamps
    of the same messages (k, 16) [s]; None where few stretches keep one to within a grain."""
    size = when.size // _STRETCH * _STRETCH
    if size < _LEAST * _STRETCH:
        return None
    number = np.linspace(-1.0, 1.0, _STRETCH)
    course = np.linalg.qr(np.vander(number, _POWERS))[0]
    pieces = when[:size].reshape(-1, _STRETCH)
    pieces = pieces - pieces[:, :1]
    off = pieces - pieces @ course @ course.T
    kept = np.ptp(off, axis=1) < _WITHIN * grain_s
    if int(kept.sum()) < _LEAST:
        return None
    return off[kept], late[:size].reshape(-1, _STRETCH)[kept]
