"""Is anything left that the model does not explain?  A test that needs no dictionary.

Families of regressors: quadratic functions of the covariates along NED and level body axes; the
ways in which any motion-linked error can point (along the antenna's velocity, along the sweep of
the lever, across the heading, along the beam, along the acceleration) times smooth functions of
time, heading, bearing, speed and turn rate; the named effects' own signatures in separate regimes,
as a right effect has the same parameters in all of them; and the span of all signatures of the
dictionary together, since what no one effect explains well two may explain in part.  Their whitened
energy, freed of the effects already in the model, is chi-square when only noise is left; circular
shifts of the whitened error against the regressors show how large it is for this noise anyhow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import Candidate, signatures, slopes
from syncline_design.diagnosis.consequence import rms_m
from syncline_design.diagnosis.fitting import Data, Model, inner, inverse_scaled, thinned
from syncline_design.diagnosis.regimes import covariates, level_axes
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.kinematics import (
    antenna_velocity,
    bearing,
    down_axis_sweep,
    rotate,
    sweep_velocity,
)
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_beyond, normal_beyond

Shifts = NDArray[np.int64]
MOST_ROWS = 6000  # of a longer log, windows
SHIFTS = 60
LOST = 1e-6  # share of a regressor's information below which the model's effects hold it all
# Slow attitude noise follows the geometry, so that shifted against it it is larger than in place:
# a shift is no fair comparison then, and its say is limited.
MOST_INFLATION = 1.3
STRETCHES, FOLDS = 40, 5  # of the log; hands that they are dealt out to
STEPS = 6  # one place in so many of those where steps are looked for
CELLS = 4  # regimes per covariate in which a named effect must have the same parameters


@dataclass(frozen=True, slots=True)
class Remainder:
    """p_regimes, p_motion, p_constant: of the energy on the three families (p_constant 1 when
    nothing is named); p_span: in the dictionary's span; p_peak: of the largest single regressor of
    the first two.  size_m: RMS of the structure, the largest of the families.
    """

    p_regimes: float
    p_motion: float
    p_constant: float
    p_peak: float
    size_m: float = 0.0
    p_span: float = 1.0

    @property
    def p(self) -> float:
        """Of all tests together (Bonferroni)."""
        tests = [self.p_regimes, self.p_motion, self.p_constant, self.p_span, self.p_peak]
        return min(1.0, len(tests) * min(tests))


def remainder(
    data: Data, model: Model, rng: np.random.Generator, dictionary: Sequence[Candidate] = ()
) -> Remainder:
    """Test what a model leaves."""
    data, model = thinned(data, model, MOST_ROWS)
    residual = model.precision.solve(model.error[:, :, None])[:, :, 0]
    n = len(data.view)
    shifts = rng.integers(max(n // 10, 1), max(n * 9 // 10, 2), SHIFTS)
    families = [_regime_columns(data.view), _motion_columns(data.view)]
    tested = [_energy(data, model, family, residual, shifts) for family in families]
    freedom = sum(t.freedom for t in tested)
    peak = max(t.peak for t in tested)
    p_peak = min(1.0, 2.0 * normal_beyond(math.sqrt(peak)) * freedom)
    p_constant = 1.0
    if model.acting:
        tested.append(_energy(data, model, _constancy_columns(data, model), residual, shifts))
        p_constant = tested[-1].p
    p_span, free = 1.0, [one for one in dictionary if one.label not in model.labels]
    if free:
        tested.append(_energy(data, model, _span_columns(data, free), residual, shifts))
        p_span = tested[-1].p
    size_m = min(max(t.size_m for t in tested), rms_m(data, model.error))
    return Remainder(tested[0].p, tested[1].p, p_constant, p_peak, size_m, p_span)


@dataclass(frozen=True, slots=True)
class _Tested:
    p: float
    peak: float
    freedom: int
    size_m: float


def _energy(data: Data, model: Model, family: Array, residual: Array, shifts: Shifts) -> _Tested:
    """Energy of the residual on one family of regressors (n, 3, f).

    It is divided by the median energy under circular shifts over its expectation, within 1 and
    MOST_INFLATION.
    """
    own = np.nan_to_num(slopes(data.view, model.acting))
    columns = np.concatenate([own, family], axis=2)
    weighted = model.precision.solve(columns)
    normal = inner(columns, weighted)
    projector, root, single = _freed(normal, own.shape[2])
    score = projector @ inner(columns, residual[:, :, None])[:, 0]
    seen = root.T @ score
    rolled = np.stack([np.roll(residual, int(shift), axis=0) for shift in shifts], axis=2)
    turned = root.T @ (projector @ inner(columns, rolled))
    freedom = root.shape[1]
    grown = float(np.median(np.sum(turned**2, axis=0))) / max(freedom, 1)
    inflation = float(np.clip(grown, 1.0, MOST_INFLATION))
    peak = float(np.max((score * single) ** 2, initial=0.0)) / inflation
    p = chi_square_beyond(float(seen @ seen) / inflation, max(freedom, 1))
    size_m = _predicted_m(data, model, (columns, weighted), residual, own.shape[2])
    return _Tested(p, peak, freedom, size_m)


def _predicted_m(
    data: Data, model: Model, weighed: tuple[Array, Array], residual: Array, width: int
) -> float:
    """RMS [m] of the structure: by how much the regressors bring down errors they have not seen.

    weighed: the regressors X, and C^-1 X.

    Stretches of the log are dealt out to FOLDS hands, and each hand is predicted from the others,
    the regressors' scores shrunk by what noise has of their energy (James and Stein 1961).
    """
    n = len(data.view)
    hand = (np.arange(n) * STRETCHES // max(n, 1)) % FOLDS
    columns, weighted = weighed
    normals = [inner(columns[hand == k], weighted[hand == k]) for k in range(FOLDS)]
    scores = [
        inner(columns[hand == k], residual[hand == k][:, :, None])[:, 0] for k in range(FOLDS)
    ]
    visible = np.isfinite(data.view.log.truth_m)
    lowered = 0.0
    for k in range(FOLDS):
        projector, root, _ = _freed(sum(normals) - normals[k], width)
        seen = root.T @ (projector @ (sum(scores) - scores[k]))
        energy, freedom = float(seen @ seen), root.shape[1]
        share = max(1.0 - freedom / max(energy, 1e-300), 0.0)
        held = hand == k
        shape = columns[held] @ (projector.T @ (root @ (share * seen)))
        error = model.error[held]
        lowered += float(np.sum((error**2 - (error - shape) ** 2) * visible[held]))
    return float(np.sqrt(max(lowered, 0.0) / max(n, 1)))


def _regime_columns(view: Scene) -> Array:
    """1, c_i, c_i c_j of the covariates along north, east, down, level forward and right."""
    base = _standardised(view)
    i, j = np.triu_indices(base.shape[1])
    features = base[:, i] * base[:, j]
    return _products(level_axes(view), features)


def _motion_columns(view: Scene) -> Array:
    """Directions of motion-linked errors times 1, c_i and the square of time."""
    base = _standardised(view)
    time_s = view.log.time_s - np.mean(view.log.time_s)
    square = (time_s / max(float(np.std(time_s)), 1e-9)) ** 2
    features = np.concatenate([base, square[:, None]], axis=1)
    vectors = []
    for rows in view.rows:
        vectors += [antenna_velocity(rows), rotate(rows.rotation, rows.acceleration_mps2)]
        if view.log.kind == "georeference":
            beam = rotate(rows.rotation, bearing(rows.azimuth_rad, rows.elevation_rad))
            vectors += [sweep_velocity(rows), down_axis_sweep(rows), beam]
    return _products(np.stack(vectors, axis=-1), features)


def _constancy_columns(data: Data, model: Model) -> Array:
    """Each named effect's fitted signature in each regime of each covariate."""
    own = np.nan_to_num(slopes(data.view, model.acting))
    at, parts = 0, []
    for one in model.acting:
        names = [p.name for p in one.effect.slopes()]
        values = np.array([one.values[name] for name in names])
        shape = own[:, :, at : at + len(names)] @ values
        at += len(names)
        for covariate in covariates(data.view):
            edges = np.quantile(covariate.values, np.linspace(0.0, 1.0, CELLS + 1)[1:-1])
            cell = np.searchsorted(edges, covariate.values)
            parts += [shape * (cell == k)[:, None] for k in range(CELLS)]
    return np.stack(parts, axis=-1)


def _span_columns(data: Data, free: Sequence[Candidate]) -> Array:
    """Signatures of all effects that the model does not hold, steps at a few places."""
    every = signatures(data.view, free)
    found, steps = [s for s in every if not s.at], [s for s in every if s.at]
    return np.concatenate([np.nan_to_num(s.columns) for s in (*found, *steps[::STEPS])], axis=2)


def _products(vectors: Array, features: Array) -> Array:
    """(n, 3, a) times (n, f): (n, 3, a f)."""
    products: Array = vectors[:, :, :, None] * features[:, None, None, :]
    return products.reshape(*vectors.shape[:2], -1)


def _standardised(view: Scene) -> Array:
    """1 and the covariates (n, f): angles as sine and cosine, the rest centred and scaled."""
    parts = [np.ones(len(view))]
    for covariate in covariates(view):
        if covariate.unit == "deg":
            angle = np.radians(covariate.values)
            parts += [np.sin(angle), np.cos(angle)]
        else:
            spread = float(np.std(covariate.values))
            if spread > 1e-9:
                parts.append((covariate.values - np.mean(covariate.values)) / spread)
    return np.stack(parts, axis=1)


def _freed(normal: Array, width: int) -> tuple[Array, Array, Array]:
    """Projector of scores onto what the model's own effects leave, and two whitenings of it.

    Scores s of all columns become P s with covariance M; root' P s is standard normal, and so is
    every component of P s times `single`.
    """
    count = normal.shape[0] - width
    projector = np.concatenate([np.zeros((count, width)), np.eye(count)], axis=1)
    rest = normal[width:, width:]
    whole = np.diag(rest).copy()
    if width:
        cross = normal[width:, :width] @ inverse_scaled(normal[:width, :width])
        projector[:, :width] = -cross
        rest = rest - cross @ normal[:width, width:]
    kept = np.diag(rest) > LOST * np.maximum(whole, 1e-300)
    single = np.where(kept, 1.0 / np.sqrt(np.where(kept, np.diag(rest), 1.0)), 0.0)
    values, vectors = np.linalg.eigh(rest * single[:, None] * single)
    usable = values > 1e-4 * max(float(values[-1]), 1e-300)
    root = single[:, None] * vectors[:, usable] / np.sqrt(values[usable])
    return projector, root, single
