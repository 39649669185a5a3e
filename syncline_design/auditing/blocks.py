"""Receipt minus stamp in stretches: a low quantile of each, and which stretches to leave out."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.series import Array, Mask, median, percentile, scatter, spread
from syncline_design.machine.quick_dataclass import dataclass

MOST_BLOCKS: Final = 180
LEAST_MESSAGES: Final = 10  # of a block
FEW, LEAST_OF_FEW = 160, 6  # a log of so few messages makes do with smaller blocks
LOW: Final = 25.0  # per cent
_GAP: Final = 3.0  # of the usual length: a block with a gap in it lies nowhere
_BACKLOG: Final = 0.3  # of the usual length
_STEEP: Final = 1.0  # of the spread: how much a course may rise within a block
_CUBIC, _FLATTER = 4, 0.5  # parameters; of the spread before
LOADED_FEW: Final = 7.0  # over the messages of a block: how much more chance alone gives few
LOADED: Final = 1.7  # a spread so many times the usual: the host is busy, delays are longer


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """time_s: middle of each block; low_s: its low quantile; edges: places of the messages.

    noise_s: scatter of low_s, as neighbours and blocks further apart differ; usable: not of a busy
    host.  spread_s: usual interquartile range within a block.
    """

    time_s: Array
    low_s: Array
    usable: Mask
    noise_s: float
    spread_s: float
    edges: np.ndarray

    def __len__(self) -> int:
        return int(self.time_s.size)

    @property
    def length_s(self) -> float:
        return float(np.median(np.diff(self.time_s))) if len(self) > 1 else 0.0


def blocks_of(time_s: Array, late_s: Array) -> Blocks | None:
    """Blocks of equal numbers of messages; None where there are too few, or most came at once."""
    least = LEAST_MESSAGES if time_s.size >= FEW else LEAST_OF_FEW
    count = min(MOST_BLOCKS, time_s.size // least)
    if count < 8:
        return None
    edges = np.linspace(0, time_s.size, count + 1).astype(np.intp)
    low, width, middle = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        part = slice(edges[k], edges[k + 1])
        middle[k] = float(time_s[part].mean())
        low[k], width[k] = _level(time_s[part] - middle[k], late_s[part])
    if float(np.median(np.diff(middle))) <= 0.0:
        return None
    usual = float(np.median(width))
    loaded = LOADED + LOADED_FEW * count / time_s.size
    span = time_s[edges[1:] - 1] - time_s[edges[:-1]]
    typical = float(np.median(span))
    waited = span < _BACKLOG * typical  # messages that came at once, after the host stood still
    usable = _calm((_around(width) < loaded * usual + 1e-12) & ~waited)
    usable &= ~_stray(low, _noise(low)) & (span <= _GAP * typical + 1e-12)
    return Blocks(middle, low, usable, max(_noise(low), 1e-10), usual, edges)


def _level(time_s: Array, late_s: Array) -> tuple[float, float]:
    """(low quantile, spread) of a block; a steep course within it is taken off first.

    The spread is that of neighbours' differences over sqrt(2), which no even course enters; a
    steep one, as of what settles within some blocks, is taken off as a cubic.
    """
    width = spread(np.diff(late_s)) / float(np.sqrt(2.0))
    half = late_s.size // 2
    rise = median(late_s[half:]) - median(late_s[:half])
    run = median(time_s[half:]) - median(time_s[:half])
    if run > 0.25 * float(time_s[-1] - time_s[0]) and abs(rise) > _STEEP * width:
        late_s = late_s - time_s * rise / run
        if late_s.size >= LEAST_MESSAGES:
            late_s, width = _without_cubic(time_s, late_s, width)
    return percentile(late_s, LOW), width


def _without_cubic(time_s: Array, late_s: Array, width: float) -> tuple[Array, float]:
    """Without a course of third order but for its value in the middle, and the spread of what is
    left; as it was where that is no less spread."""
    scaled = time_s / float(np.ptp(time_s))
    powers = np.stack([scaled**k for k in range(_CUBIC)], axis=1)
    course = np.asarray(powers @ np.linalg.lstsq(powers, late_s, rcond=None)[0])
    left = late_s - course
    own = spread(np.diff(left)) / float(np.sqrt(2.0 * (1.0 - _CUBIC / left.size)))
    if own > _FLATTER * width:
        return late_s, width
    return np.asarray(left + np.interp(0.0, time_s, course)), own


def _calm(usable: Mask) -> Mask:
    """Blocks beside busy ones may be partly busy themselves."""
    padded = np.concatenate([[True], usable, [True]])
    return np.asarray(usable & padded[:-2] & padded[2:])


def _around(width: Array) -> Array:
    """Median of each block's spread and its neighbours': ten messages alone say little."""
    padded = np.concatenate([width[:1], width, width[-1:]])
    return np.asarray(np.median([padded[:-2], padded[1:-1], padded[2:]], axis=0))


def _noise(low: Array) -> float:
    """Scatter of a level: the largest that neighbours one, two and four blocks apart show.

    Delays that remember make neighbours alike; steps and slips are few and do not enter.
    """
    if low.size < 6:
        return scatter(low)
    return max(scatter(low[lag:] - low[:-lag]) for lag in (1, 2)) / float(np.sqrt(2.0))


def _stray(low: Array, noise: float) -> Mask:
    """Single blocks that stand out while those around them agree: a host that stood still."""
    out = np.zeros(low.size, bool)
    for k in range(1, low.size - 1):
        around = 0.5 * (low[k - 1] + low[k + 1])
        calm = abs(low[k - 1] - low[k + 1]) < 6.0 * noise
        out[k] = calm and low[k] - around > 8.0 * noise
    return out
