"""Does scatter grow with the motion?  Jitter of stamps does; noise of its own does not.

The likelihood of one factor a sensor and normal noise prefers jitter to anything that scatters more
along the motion than across it: an axis that is quieter than the spec says, tails.  So jitter has
to stand up where every channel of every sensor has a variance of its own and squares far out are
cut: in
    E[s_j^2] = sum_c f_c (b_j . l_c)^2 + size^2 (b_j . d)^2,
s_j the whitened error along b_j, the first of them along the motion d, l_c what a channel's
standard deviation does, the size must be positive beyond the scatter between blocks of the log
(weighted least squares, delete-a-block jackknife).
"""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import loadings, white_covariance, with_size
from syncline_design.effects.record import Array
from syncline_design.model.distributions import student_limit

BLOCKS = 16
ROUNDS = 5  # of weights from the last fit
FAR2 = 9.0  # variances beyond which a square is cut
LEAST_VARIANCE = 0.25  # of a whitened component: what is quieter weighs no more
TOLD_APART = 1e-3  # share of the motion's squares that no channel's variance makes up
MANY_STAMPS = 20.0
CHANCE = 1e-3  # that scatter without jitter passes


def in_blocks(
    columns: Array, squares: Array, known: Array
) -> tuple[Array, Array, list[tuple[Array, Array]]]:
    """Normal equations of the variances of parts: the whole of them, and those of each block.

    squares: of the error over its white noise, (n,); columns: what a unit of each part's variance
    adds to them, (n, parts); known: what does so beside them, (n,).
    """
    variance = np.ones_like(squares)
    for _ in range(ROUNDS):
        cut = np.minimum(squares, FAR2 * variance) - known
        found = variances_of(*normal_equations(columns, cut, variance))
        variance = np.maximum(columns @ found + known, LEAST_VARIANCE)
    parts = [
        normal_equations(columns[b], cut[b], variance[b])
        for b in np.array_split(np.arange(columns.shape[0]), BLOCKS)
    ]
    return np.sum([n for n, _ in parts], axis=0), np.sum([r for _, r in parts], axis=0), parts


def grows_with_motion(data: Data, model: Model, directed: int) -> bool:
    """Whether the error scatters more the faster the motion is, as one directed part says."""
    columns, squares, known = _variances(data, model, directed)
    normal, right, parts = in_blocks(columns, squares, known)
    if not own_share(normal) > TOLD_APART:
        return False
    value = variances_of(normal, right)[-1]
    left = np.array([variances_of(normal - n, right - r)[-1] for n, r in parts])
    spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((left - left.mean()) ** 2))
    return bool(value > student_limit(CHANCE, BLOCKS - 1) * spread)


def _variances(data: Data, model: Model, directed: int) -> tuple[Array, Array, Array]:
    """Per row and component: what each variance adds (the last by the motion), squares, known."""
    axes, structure = list(data.axes), data.structure
    level = with_size(model.level, directed, 0.0)
    white = white_covariance(structure, level)[:, axes][:, :, axes]
    lower = np.linalg.cholesky(white)
    error = np.linalg.solve(lower, (model.error - lasting(data, model))[:, axes, None])
    motion = np.linalg.solve(lower, structure.directed[directed].direction[:, axes])
    basis = _along_and_across(motion[:, :, 0])

    def squared(loading: Array) -> Array:
        return (basis @ np.linalg.solve(lower, loading[:, axes])) ** 2

    free = [squared(loading) for _, loading in channels(data.view)]
    free += [
        squared(other.direction)
        for k, (other, size) in enumerate(zip(structure.directed, level.size, strict=True))
        if k != directed and size > 0.0
    ]
    free.append(np.sum((basis @ motion) ** 2, axis=2, keepdims=True))
    known = np.zeros(error.shape[:2])
    if structure.stamped is not None:
        known = np.sum(squared(structure.stamped), axis=2)
    columns = np.concatenate(free, axis=2).reshape(known.size, -1)
    return columns, ((basis @ error) ** 2).ravel(), known.ravel()


def lasting(data: Data, model: Model) -> Array:
    """What the slow noise that outlasts many stamps makes of the error [m], (n, 3).

    Slow noise of a few stamps is as good as white, and a smoother's remainder of it is neither.
    """
    known = model.precision
    _, time_s = loadings(data.structure, model.level)
    stamps = np.unique(data.structure.time_s)
    usual_s = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
    kept = np.zeros(known.loading.shape[2], dtype=bool)
    kept[: time_s.shape[0]] = time_s > MANY_STAMPS * usual_s
    if not np.any(kept):
        return np.zeros_like(model.error)
    states = known.states(known.white_inverse @ model.error[:, :, None])
    lasting: Array = (known.loading[:, :, kept] @ states[:, kept])[:, :, 0]
    return lasting


def _along_and_across(direction: Array) -> Array:
    """Rows of an orthonormal basis (n, a, a), the first along `direction` (n, a) (Householder)."""
    size = np.linalg.norm(direction, axis=1, keepdims=True)
    first = np.eye(direction.shape[1])[0]
    unit = np.where(size > 0.0, direction / np.maximum(size, np.finfo(float).tiny), first)
    sign = np.where(unit[:, :1] < 0.0, -1.0, 1.0)
    mirror = unit + sign * first
    outer = mirror[:, :, None] * mirror[:, None, :]
    length2 = np.sum(mirror**2, axis=1)[:, None, None]
    basis: Array = -sign[:, :, None] * (np.eye(direction.shape[1]) - 2.0 * outer / length2)
    return basis


def normal_equations(columns: Array, squares: Array, variance: Array) -> tuple[Array, Array]:
    """Normal matrix and right side of least squares; a square scatters as its variance squared."""
    weighted = columns / variance[:, None] ** 2
    return weighted.T @ columns, weighted.T @ squares


def _solved(normal: Array, right: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    scaled = normal / scale[:, None] / scale
    found: Array = np.asarray(np.linalg.lstsq(scaled, right / scale, rcond=1e-10)[0]) / scale
    return found


def variances_of(normal: Array, right: Array) -> Array:
    """Least squares with no variance below zero, which the normal equations are enough for.

    With N = F F', |A x - y|^2 is |F' x - F^-1 r|^2 but for a constant.
    """
    from scipy.optimize import nnls

    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    value, vector = np.linalg.eigh(normal / scale[:, None] / scale)
    kept = value > 1e-10 * value[-1]
    root = np.sqrt(value[kept])
    rows = root[:, None] * vector[:, kept].T
    wanted = (vector[:, kept].T @ (right / scale)) / root
    found: Array = np.asarray(nnls(rows, wanted)[0]) / scale
    return found


def own_share(normal: Array) -> float:
    """Share of the last column's squares that the others cannot make up."""
    own = float(normal[-1, -1])
    if not own > 0.0:
        return 0.0
    others = normal[:-1, -1]
    return 1.0 - float(others @ _solved(normal[:-1, :-1], others)) / own
