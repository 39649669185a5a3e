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
TICKS_S: Final = (0.016, 0.008, 0.004)  # of the timers of serial chips, which hold back for longer
FULL_SPEED_S: Final = 1e-3
LEAST_NOISE_S: Final = 5e-6  # of an interrupt; what is evener are ticks that a sensor keeps
_NEAR: Final = 0.2  # of a frame: how far from the comb intervals are
_MOST_OFF: Final = 0.05  # of all intervals
_LEAST_VARIED, _SHARE = 3, 0.002  # of intervals that differ from the usual one
_ALL: Final = 0.95
_LONGEST: Final = 1.5  # of an interval: a frame holds hardly more than one message
_STRETCH: Final = 24  # messages over which a comb stands still
_SKEWED: Final = 0.2
_CLOCKS: Final = 3e-4  # of an interval
_PART_OF_FRAME: Final = 0.04  # 1 ms of 16 ms is 0.0625
_MOST_TRIED: Final = 500
_FEWEST, _MOST_NOISE = 8, 8.0  # messages on either side; spreads by which a comb has moved


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
    """The frames, or ticks of a timer, that stamps [s] lie on, the longest that fit."""
    if when.size < 4 * _STRETCH:
        return None
    passed = np.diff(when)
    usual = float(np.median(passed))
    for frame in FRAMES_S:
        if frame > _LONGEST * usual or not on_comb(passed, frame):
            continue
        noise = late_by(when, frame)
        if noise is not None and _varies(passed, frame):
            return Framed(frame, noise, True)
    for frame in (*TICKS_S, *(f for f in FRAMES_S if f >= FULL_SPEED_S)):
        if frame > _LONGEST * usual or not (on_comb(passed, frame) and _whole(when, frame)):
            continue
        if _leaves_comb(when, frame):
            continue
        noise = late_by(when, frame)
        if noise is not None:
            return Framed(frame, noise, False)
    return None


def on_comb(passed: Array, frame: float) -> bool:
    """Whether intervals [s] are whole numbers of frames."""
    return float(np.mean(_off(passed, frame))) <= _MOST_OFF


def _leaves_comb(when: Array, frame: float) -> bool:
    """Whether stamps move on by part of a frame and stay: they lie on a comb of shorter ones.

    A message that a host noted late is off by itself, and the next ones lie as those before.
    """
    passed = np.diff(when)
    x = when - frame * np.concatenate([[0.0], np.cumsum(np.round(passed / frame))])
    for at in np.flatnonzero(_off(passed, frame, _PART_OF_FRAME))[:_MOST_TRIED].tolist():
        before, after = x[max(0, at + 1 - _STRETCH) : at + 1], x[at + 1 : at + 1 + _STRETCH]
        if min(before.size, after.size) < _FEWEST:
            continue
        moved = float(np.median(after) - np.median(before))
        if abs(moved) > _PART_OF_FRAME * frame and abs(moved) > _MOST_NOISE * spread(after):
            return True
    return False


def _whole(when: Array, frame: float) -> bool:
    """Whether the usual interval is a whole number of frames, but for what two clocks differ by."""
    usual = float(np.median(when[_STRETCH:] - when[:-_STRETCH])) / _STRETCH
    return abs(usual - frame * round(usual / frame)) < _CLOCKS * usual


def _off(passed: Array, frame: float, near: float = _NEAR) -> Mask:
    return np.asarray(np.abs(passed - frame * np.round(passed / frame)) > near * frame)


def _varies(passed: Array, frame: float) -> bool:
    """Whether intervals next to the usual one are there, on the comb as well; those of lost
    messages do not count, nor those of longer ticks."""
    counts = np.round(passed / frame)
    values, often = np.unique(counts, return_counts=True)
    usual = float(values[int(np.argmax(often))])
    beside = (counts != usual) & (np.abs(counts - usual) <= max(1.0, 0.5 * usual))
    enough = int(beside.sum()) >= max(_LEAST_VARIED, _SHARE * counts.size)
    if not enough or float(np.mean(_off(passed, frame)[beside])) >= 2.0 * _MOST_OFF:
        return False
    longer = [round(tick / frame) for tick in TICKS_S if usual % round(tick / frame) == 0]
    return not any(float(np.mean(counts[beside] % ticks == 0.0)) > _ALL for ticks in longer)


def late_by(when: Array, frame: float) -> float | None:
    """Scatter about the comb [s] where it is late rather than early, as an interrupt is."""
    counts = np.round(np.diff(when) / frame)
    x = when - frame * np.concatenate([[0.0], np.cumsum(counts)])
    pieces = x[: x.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    k = np.arange(_STRETCH) - 0.5 * (_STRETCH - 1)
    left = pieces - np.outer(pieces @ k / float(k @ k), k)
    about: NDArray[np.float64] = (left - np.median(left, axis=1, keepdims=True)).ravel()
    low, middle, high = np.percentile(about, [5.0, 50.0, 95.0])
    noise = spread(about)
    late = (high - middle) - (middle - low) > _SKEWED * (high - low)
    return noise if noise >= LEAST_NOISE_S and late else None
