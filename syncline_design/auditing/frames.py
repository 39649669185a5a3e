"""Stamps taken when a bus handed a message over: USB does so at the ends of its frames only.

A full-speed device is polled every 1 ms, a high-speed one every 125 us or a power of two of these
(USB 2.0, 5.12 and 9.6.6), so arrivals lie on a comb of frames, late on it by an interrupt, some
10 us, and never early.  A sensor's own stamps lie on no such comb unless its interval is a whole
number of frames; then arrivals differ only where the sensor drifts over the edge of a frame.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.series import Array, Mask, spread
from syncline_design.machine.quick_dataclass import dataclass

FRAMES_S: Final = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
FULL_SPEED_S: Final = 1e-3
LEAST_NOISE_S: Final = 5e-6  # of an interrupt; what is evener are ticks that a sensor keeps
_NEAR: Final = 0.2  # of a frame: how far from the comb intervals are
_MOST_OFF: Final = 0.05  # of all intervals
_LEAST_VARIED, _SHARE = 3, 0.002  # of intervals that differ from the usual one
_LONGEST: Final = 1.5  # of an interval: a frame holds hardly more than one message
_STRETCH: Final = 24  # messages over which a comb stands still
_SKEWED: Final = 0.2


@dataclass(frozen=True, slots=True)
class Framed:
    """Stamps on a comb of frames, late on it by an interrupt.

    varied: whether intervals hold different numbers of frames, as no sensor of its own clock does;
    else the sensor's interval is a whole number of them.
    """

    frame_s: float
    noise_s: float
    varied: bool


def framed(when: Array) -> Framed | None:
    """The frames that stamps [s] lie on, the longest that fit."""
    if when.size < 4 * _STRETCH:
        return None
    passed = np.diff(when)
    usual = float(np.median(passed))
    whole: Framed | None = None
    for frame in FRAMES_S:
        if frame > _LONGEST * usual:
            continue
        counts = np.round(passed / frame)
        off = np.abs(passed - frame * counts) > _NEAR * frame
        if float(np.mean(off)) > _MOST_OFF:
            continue
        noise = _late_by(when, counts, frame)
        if noise is None:
            continue
        if _varies(counts, off):
            return Framed(frame, noise, True)
        whole = Framed(frame, noise, False) if frame == FULL_SPEED_S else whole
    return whole


def _varies(counts: Array, off: Mask) -> bool:
    """Whether intervals next to the usual one are there, on the comb as well; those of lost
    messages do not count."""
    values, often = np.unique(counts, return_counts=True)
    usual = float(values[int(np.argmax(often))])
    beside = (counts != usual) & (np.abs(counts - usual) <= max(1.0, 0.5 * usual))
    enough = int(beside.sum()) >= max(_LEAST_VARIED, _SHARE * counts.size)
    return enough and float(np.mean(off[beside])) < 2.0 * _MOST_OFF


def _late_by(when: Array, counts: Array, frame: float) -> float | None:
    """Scatter about the comb [s] where it is late rather than early, as an interrupt is."""
    x = when - frame * np.concatenate([[0.0], np.cumsum(counts)])
    pieces = x[: x.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    k = np.arange(_STRETCH) - 0.5 * (_STRETCH - 1)
    left = pieces - np.outer(pieces @ k / float(k @ k), k)
    about: NDArray[np.float64] = (left - np.median(left, axis=1, keepdims=True)).ravel()
    low, middle, high = np.percentile(about, [5.0, 50.0, 95.0])
    noise = spread(about)
    late = (high - middle) - (middle - low) > _SKEWED * (high - low)
    return noise if noise >= LEAST_NOISE_S and late else None
