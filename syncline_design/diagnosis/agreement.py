"""Do motion columns agree with the poses they are the derivative of?

Over windows the integral D of a column (velocity, body rate) and the change P of the pose (place,
attitude) must be the same vector.  The column's principal directions v_k are mapped by P to
w_k = P' u_k / s_k (D = U S V'), with a standard error from what is left; v_k itself is wanted.
A pose that comes late is allowed for, it is an effect of its own; a column that does is not.  What
a regression of P on D cannot see is asked for on its own: motion of the pose in which the column
has no part (a column of zeros), and a constant part of a velocity that the places do not follow.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.logs.log import GAP_FACTOR
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_estimate, to_digits, to_places
from syncline_design.model.normal import HALF_WITHIN

LENGTHS_S = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
LEAST_STEPS = 4  # rows in a window
LEAST_WINDOWS = 8
CLEAR = 20.0  # times the noise of a displacement: windows need not be longer
_AS_LARGE = 0.05
MOST_TURN_RAD = 0.7  # in one window: longer ones say no more
LAGS_S = np.linspace(-1.0, 1.0, 41)
LATE_S = 0.15  # by which a column may come late
MOVES = 10.0  # times its own noise: a direction that moves less is nothing but that noise
ERRORS = 4.0  # standard errors that a disagreement must have on top of the tolerance
ALIGNED = 1e-3  # of all motion: less beside it is how axes lie, and how the local level turns
LEAST_PART = 0.5  # of a clear motion of the pose that a column must show
ARM_M = 1.0  # by which places may be off in a turn: a wrong lever arm
SHIFT_S = 1.0  # by which stamps may step within a log
LEAST_BIAS_RADPS = 0.5 * np.pi / 180.0  # a constant of the rates that is none of our business
FITS = 0.1  # share of the motion that a named relation may leave
AXES = ("first", "second", "third")
UNITS = {3.6: "km/h", 1.943844: "knots", 3.28084: "ft/s", 1e3: "mm/s", 100.0: "cm/s"}
TURNS = {180.0 / np.pi: "degrees for radians", np.pi / 180.0: "radians for degrees"}
WORDS = {
    "velocity_columns": ("velocity columns", "its positions"),
    "rate_columns": ("rate columns", "its attitudes"),
}

Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class WindowRows:
    """Windows of a log: first and last row of each, and their lengths [s]."""

    time_s: Array
    rows: Index  # of the log, one per stamp
    first: Index
    last: Index

    @property
    def length_s(self) -> Array:
        length: Array = self.time_s[self.last] - self.time_s[self.first]
        return length

    def integral(self, series: Array, lag_s: float = 0.0) -> Array:
        """Integral of a series (n, 3) of the log over every window, `lag_s` later."""
        values = series[self.rows]
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(self.time_s)[:, None]
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        if lag_s == 0.0:
            return np.asarray(total[self.last] - total[self.first])
        ends = [
            np.stack([np.interp(at, self.time_s, total[:, k]) for k in range(3)], axis=1)
            for at in (self.time_s[self.last] + lag_s, self.time_s[self.first] + lag_s)
        ]
        return np.asarray(ends[0] - ends[1])

    def noise(self, series: Array) -> float:
        """Standard deviation that white noise of a series gives its integral over a window.

        From second differences, in which smooth motion cancels: their variance is six times.
        """
        values, step = series[self.rows], float(np.median(np.diff(self.time_s)))
        rough = np.median(np.abs(np.diff(values, 2, axis=0))) / HALF_WITHIN / np.sqrt(6.0)
        return float(rough * step * np.sqrt(np.median(self.last - self.first)))


def windows_of(time_s: Array, length_s: float, *, sliding: bool = False) -> WindowRows | None:
    """Windows of about one length, none over a gap; None where there are too few.

    Side by side, or sliding: one from every stamp.
    """
    stamps, rows = np.unique(time_s, return_index=True)
    step = np.diff(stamps)
    usual = float(np.median(step))
    stride = max(LEAST_STEPS, round(length_s / usual))
    apart = 1 if sliding else stride
    first = np.arange(0, stamps.shape[0] - stride, apart)
    last = first + stride
    gaps = np.concatenate([[0], np.cumsum(step > GAP_FACTOR * usual)])
    whole = gaps[first] == gaps[last]
    if int(np.sum(whole)) * apart < LEAST_WINDOWS * stride:
        return None
    return WindowRows(stamps, rows, first[whole], last[whole])


@dataclass(frozen=True, slots=True)
class Disagreement:
    """factor: size of the column over that of the pose's motion; words: what it looks like."""

    factor: float
    words: str


def disagreement(
    time_s: Array,
    place_m: Array | None,
    column: Array,
    rotation: Array,
    sigma: float,
    tolerance: float,
) -> Disagreement | None:
    """How a motion column contradicts places, or attitudes where no place is given.

    sigma: of a place [m], or of an attitude [rad].
    """
    found = _chosen(time_s, place_m, column, rotation, sigma)
    if found is None:
        return None
    spans, moved = found
    lag = max(LAGS_S, key=lambda at: (_likeness(moved, spans.integral(column, at)), -abs(at)))
    own = spans.integral(column, float(lag))
    places, words = place_m is not None, ""
    if not _differs(moved, own, spans.noise(column), tolerance):
        words = _missing(moved, own, sigma)
        if not words and _drifts(
            spans, moved, own, _allowed(spans, moved, sigma, places, tolerance)
        ):
            words = _offset_words(spans, moved, own, places)
        words = words or _late_words(spans, moved, column, float(lag), tolerance)
        return Disagreement(_ratio(moved, own), words) if words else None
    if _is_offset(spans, moved, own):
        return Disagreement(_ratio(moved, own), _offset_words(spans, moved, own, places))
    body = None
    if place_m is not None:
        body = spans.integral(rotate(rotation, column), float(lag))
    units = UNITS if place_m is not None else TURNS
    return _described(moved, own, body, units, (spans.noise(column), tolerance))


def _chosen(
    time_s: Array, place_m: Array | None, column: Array, rotation: Array, sigma_m: float
) -> tuple[WindowRows, Array] | None:
    """Windows in which there is motion to compare, and the pose's motion in them."""
    chosen = None
    for length_s in LENGTHS_S:
        spans = windows_of(time_s, length_s)
        if spans is None:
            break
        moved = moved_between(spans, place_m, rotation)
        size = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
        if place_m is None and chosen is not None and size > MOST_TURN_RAD:
            break
        chosen = spans, moved
        if place_m is not None and size > CLEAR * np.sqrt(2.0) * sigma_m:
            break
    return chosen


def moved_between(spans: WindowRows, place_m: Array | None, rotation: Array) -> Array:
    """Change of place [m], or sum of the turns [rad, body axes], over every window.

    The turns are summed step by step, as rates are: the turn between a window's ends is another
    vector where a vehicle rocks about two axes within it (coning), however small it is.
    """
    if place_m is not None:
        place = place_m[spans.rows]
        return np.asarray(place[spans.last] - place[spans.first])
    from scipy.spatial.transform import Rotation

    pose = Rotation.from_matrix(rotation[spans.rows])
    steps = (pose[:-1].inv() * pose[1:]).as_rotvec()
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return np.asarray(total[spans.last] - total[spans.first])


def _likeness(moved: Array, own: Array) -> float:
    """Share of the pose's motion that the column explains, up to one factor."""
    size = float(np.sum(own**2))
    return float(np.sum(moved * own)) ** 2 / size if size > 0.0 else 0.0


def _late_words(
    spans: WindowRows, moved: Array, column: Array, lag_s: float, tolerance: float
) -> str:
    """Says that a column comes late, if only late it shows the pose's motion.

    A pose that is late has a name, so that a column which is ahead says nothing.
    """
    if lag_s < LATE_S:
        return ""
    whole = float(np.sum(moved**2))
    left, now = (whole - _likeness(moved, spans.integral(column, at)) for at in (lag_s, 0.0))
    if now < max(2.0 * left, tolerance**2 * whole):
        return ""
    more = " or more" if lag_s >= LAGS_S[-2] else ""
    return f"they come about {format_estimate(lag_s, None, 's')}{more} late"


def _differs(moved: Array, own: Array, noise: float, tolerance: float) -> bool:
    """Whether any direction in which the column really moves comes out as another vector."""
    left, size, right = np.linalg.svd(own, full_matrices=False)
    least = MOVES * noise * np.sqrt(own.shape[0])
    kept = size > max(1e-9 * float(size[0]), least, 1e-300)
    if not np.any(kept):
        return False
    seen = (left[:, kept].T @ moved) / size[kept, None]
    rest = moved - own @ (right[kept].T @ seen)
    count = max(3 * (moved.shape[0] - int(np.sum(kept))), 1)
    error = np.sqrt(float(np.sum(rest**2)) / count) / size[kept]
    off = np.linalg.norm(seen - right[kept], axis=1)
    return bool(np.any(off > tolerance + ERRORS * np.sqrt(3.0) * error))


def _size(series: Array) -> float:
    """Root mean square length."""
    return float(np.sqrt(np.mean(np.sum(series**2, axis=1))))


def _ratio(moved: Array, own: Array) -> float:
    return _size(own) / max(_size(moved), 1e-300)


def _is_offset(spans: WindowRows, moved: Array, own: Array) -> bool:
    """Whether a constant accounts for the disagreement, and better than a factor does."""
    left = float(
        np.sum((own - _constant(spans, moved, own) * spans.length_s[:, None] - moved) ** 2)
    )
    scale = float(np.sum(moved * own)) / max(float(np.sum(own**2)), 1e-300)
    scaled = float(np.sum((moved - scale * own) ** 2))
    return left < min(scaled, FITS * float(np.sum(moved**2)))


def _missing(moved: Array, own: Array, sigma: float) -> str:
    """Says in which direction the pose clearly moves while the column shows less than half of it.

    The median decides what is clear, so that a jump of the pose is not taken for motion.  What a
    direction holds beside a far larger motion is no signal: a level vehicle's rates about the
    other axes may well be zero.
    """
    right = np.linalg.svd(moved, full_matrices=False)[2]
    along = moved @ right.T
    least = max(CLEAR * np.sqrt(2.0) * sigma, ALIGNED * _size(moved), 1e-9)
    for k in range(right.shape[0]):
        if float(np.median(np.abs(along[:, k]))) <= least:
            continue
        part = float(np.sum(along[:, k] * (own @ right[k]))) / float(np.sum(along[:, k] ** 2))
        if abs(part) < LEAST_PART:
            axis = AXES[int(np.argmax(np.abs(right[k])))]
            return (
                f"they show {to_places(100.0 * max(part, 0.0), 0)} % of the motion along "
                f"the {axis} axis"
            )
    return ""


def _constant(spans: WindowRows, moved: Array, own: Array) -> Array:
    """Constant part of the column that the pose does not follow, over the whole log."""
    return np.asarray(np.sum(own - moved, axis=0) / float(np.sum(spans.length_s)))


def _offset_words(spans: WindowRows, moved: Array, own: Array, places: bool) -> str:
    mean = _constant(spans, moved, own)
    k = int(np.argmax(np.abs(mean)))
    size = format_estimate(float(mean[k]), None, "m/s" if places else "rad/s")
    return f"they hold a constant {size} {'along' if places else 'about'} the {AXES[k]} axis"


def _drifts(spans: WindowRows, moved: Array, own: Array, allowed: float) -> bool:
    """Whether a constant part of the column is larger than the pose may be off by."""
    return bool(np.linalg.norm(_constant(spans, moved, own)) > allowed)


def _allowed(
    spans: WindowRows, moved: Array, sigma: float, places: bool, tolerance: float
) -> float:
    """Constant part [m/s or rad/s] that the poses leave room for.

    They may be off at both ends of every unbroken stretch: by noise, by what the vehicle moves
    while its stamps step, places also by a wrong lever arm.  A gyro may have a bias: LEAST_BIAS
    turns no attitude by more than 0.05 deg in a delay of 0.1 s.
    """
    speed = _size(moved / spans.length_s[:, None])
    stretches = 1 + int(np.sum(spans.first[1:] != spans.last[:-1]))
    ends = (2.0 * ARM_M if places else 0.0) + ERRORS * np.sqrt(2.0) * sigma + SHIFT_S * speed
    allowed = tolerance * speed + stretches * ends / float(np.sum(spans.length_s))
    return float(allowed + (0.0 if places else LEAST_BIAS_RADPS))


def _described(
    moved: Array,
    own: Array,
    body: Array | None,
    units: dict[float, str],
    agreement: tuple[float, float],
) -> Disagreement:
    """The simplest relation that fits: a factor, other axes or signs, body axes; else none.

    Of those that leave little of the motion, one that leaves no disagreement goes first: a reversed
    vertical axis is a small part of the motion of a vehicle that flies level.  agreement: noise of
    the column's integral, tolerance.
    """
    whole = float(np.sum(moved**2))
    near = [r for r in _relations(moved, own, body, units)
            if float(np.sum((moved - r.mapped) ** 2)) < FITS * whole]  # fmt: skip
    exact = [r for r in near if not _differs(moved, r.mapped, *agreement)]
    if near:
        best = (exact or near)[0]
        return Disagreement(best.factor, best.words)
    factor = float(np.sqrt(np.sum(own**2) / max(whole, 1e-300)))
    size = "as large" if abs(factor - 1.0) < _AS_LARGE else f"{to_digits(factor, 3)} times in size"
    return Disagreement(factor, f"{size}, and in another direction")


@dataclass(frozen=True, slots=True)
class _Relation:
    """A way in which a column may relate to the pose's motion; mapped: the column, so mended."""

    mapped: Array
    factor: float
    words: str


def _relations(
    moved: Array, own: Array, body: Array | None, units: dict[float, str]
) -> Iterator[_Relation]:
    """Simplest first."""
    factor = float(np.sqrt(np.sum(own**2) / max(float(np.sum(moved**2)), 1e-300)))
    scale = float(np.sum(moved * own)) / max(float(np.sum(own**2)), 1e-300)
    if scale != 0.0:
        yield _Relation(scale * own, 1.0 / scale, _factor_words(1.0 / scale, units))
    if body is not None:
        yield _Relation(body, factor, "they look like body axes")
    for order in itertools.permutations(range(3)):
        turned = own[:, order]
        signs = np.sign(np.sum(moved * turned, axis=0))
        words = f"axes or signs: {_axes_words(order, signs)}"
        yield _Relation(signs * turned, factor, words)


def _factor_words(factor: float, units: dict[float, str]) -> str:
    words = f"{to_digits(factor, 4)} times what these say"
    for known, name in units.items():
        if abs(abs(factor) / known - 1.0) < 0.03:
            words += f" ({name}?)"
    return words


def _axes_words(order: tuple[int, ...], signs: Array) -> str:
    """`first from -second`: which column, with which sign, is the motion along each axis."""
    parts = [
        f"{AXES[k]} is {'-' if signs[k] < 0 else ''}{AXES[source]}"
        for k, source in enumerate(order)
        if source != k or signs[k] < 0
    ]
    return ", ".join(parts) or "small turns"
