"""Where a log disagrees: whitened scores by regime and axis, and a test of what remains."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from syncline_design.diagnose.candidates import slopes
from syncline_design.diagnose.covariance import Precision
from syncline_design.diagnose.fitting import Data, Model, inner, inverse_scaled
from syncline_design.diagnose.simulation import Scene
from syncline_design.effects.base import Array
from syncline_design.effects.kinematics import rotate

BINS = 6
SHIFTS = 60
STRONG = 4.0  # a cell's score that is worth showing
AXES = ("north", "east", "down", "along", "across", "forward", "right", "body_down")
WINDOWS = 40  # of time, for the first disagreement


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of the map: mean error in the regime along an axis over its standard error."""

    covariate: str
    low: float
    high: float
    unit: str
    axis: str
    score: float
    mean_m: float
    rows: int


@dataclass(frozen=True, slots=True)
class Covariate:
    name: str
    unit: str
    values: Array


def covariates(view: Scene) -> tuple[Covariate, ...]:
    """What a regime is told by: last stage's motion and bearing, and time."""
    rows = view.rows[-1]
    horizontal = np.hypot(*rotate(rows.rotation, rows.velocity_mps)[:, :2].T)
    found = [
        Covariate("speed", "m/s", horizontal),
        Covariate("turn_rate", "deg/s", np.degrees(rows.rate_radps[:, 2])),
        Covariate("heading", "deg", np.degrees(np.angle(np.exp(1j * rows.euler_rad[:, 2])))),
        Covariate("time", "s", view.log.time_s),
    ]
    if view.log.kind == "georeference":
        azimuth = np.degrees(np.angle(np.exp(1j * rows.azimuth_rad)))
        found += [Covariate("range", "m", rows.range_m), Covariate("azimuth", "deg", azimuth)]
    return tuple(found)


def axis_vectors(view: Scene) -> Array:
    """Unit vectors (n, 3, 8) of AXES in NED."""
    rows = view.rows[-1]
    n = len(view)
    ned = np.broadcast_to(np.eye(3), (n, 3, 3))
    velocity = rotate(rows.rotation, rows.velocity_mps)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = speed > 0.05
    scale = np.where(moving, 1.0 / np.where(moving, speed, 1.0), 0.0)
    along = np.stack([velocity[:, 0] * scale, velocity[:, 1] * scale, np.zeros(n)], axis=-1)
    across = np.stack([-along[:, 1], along[:, 0], np.zeros(n)], axis=-1)
    return np.concatenate([ned, along[:, :, None], across[:, :, None], rows.rotation], axis=2)


def where_map(view: Scene, error: Array, known: Precision) -> tuple[Cell, ...]:
    """All cells; the score takes the noise's correlation into account."""
    weighted = known.solve(np.nan_to_num(error)[:, :, None])[:, :, 0]
    axes = axis_vectors(view)
    numerator = np.einsum("nij,ni->nj", axes, weighted)
    plain = np.einsum("nij,ni->nj", axes, np.nan_to_num(error))
    cells: list[Cell] = []
    for covariate in covariates(view):
        edges = np.quantile(covariate.values, np.linspace(0.0, 1.0, BINS + 1))
        for low, high in itertools.pairwise(edges):
            last = high == edges[-1]
            inside = (covariate.values >= low) & (
                (covariate.values <= high) if last else (covariate.values < high)
            )
            if not np.any(inside):
                continue
            columns = axes * inside[:, None, None]
            own = np.einsum("nij,nij->j", columns, known.solve(columns))
            for k, axis in enumerate(AXES):
                if own[k] > 0.0:
                    score = float(np.sum(numerator[inside, k]) / np.sqrt(own[k]))
                    mean = float(np.mean(plain[inside, k]))
                    cells.append(
                        Cell(
                            covariate.name,
                            float(low),
                            float(high),
                            covariate.unit,
                            axis,
                            score,
                            mean,
                            int(np.sum(inside)),
                        )
                    )
    return tuple(cells)


def strongest(cells: tuple[Cell, ...], count: int = 8) -> tuple[Cell, ...]:
    """The cells that disagree most, one per covariate and axis."""
    best: dict[tuple[str, str], Cell] = {}
    for cell in cells:
        key = cell.covariate, cell.axis
        if abs(cell.score) > STRONG and (key not in best or abs(cell.score) > abs(best[key].score)):
            best[key] = cell
    return tuple(sorted(best.values(), key=lambda c: -abs(c.score))[:count])


def first_disagreement_s(view: Scene, error: Array, known: Precision) -> float | None:
    """Start of the first window of time whose mean error is out of noise; None if none is.

    A change point's place: windows are a fortieth of the log, the limit holds for all of them
    together at 1 %.
    """
    weighted = known.solve(np.nan_to_num(error)[:, :, None])[:, :, 0]
    limit = chi2.isf(0.01 / WINDOWS, 3)
    edges = np.linspace(0, len(view), WINDOWS + 1).astype(int)
    for a, b in itertools.pairwise(edges):
        if b - a < 2:
            continue
        columns = np.zeros((len(view), 3, 3))
        columns[a:b] = np.eye(3)
        normal = inner(columns, known.solve(columns))
        score = weighted[a:b].sum(axis=0)
        if float(score @ inverse_scaled(normal) @ score) > limit:
            return float(view.log.time_s[a])
    return None


@dataclass(frozen=True, slots=True)
class Remainder:
    """Test of what is left: energy on quadratic functions of the covariates.

    p_energy: of the energy on all of them; p_peak: of the largest single one, for all together;
    shifted: median energy under circular shifts over its expectation (1 when the noise model is
    right), by which the energy is divided when it is larger.
    """

    p_energy: float
    p_peak: float
    shifted: float
    freedom: int

    @property
    def p(self) -> float:
        """Of the two together (Bonferroni)."""
        return min(1.0, 2.0 * min(self.p_energy, self.p_peak))


def remainder(data: Data, model: Model, rng: np.random.Generator) -> Remainder:
    """Is there anything left that depends on the regime?

    Regressors: 1, c_i and c_i c_j of the standardised covariates, along body and NED axes; freed
    of the effects already in the model.  Their scores against C^-1 e are chi-square when nothing
    is left.  Circular shifts of the whitened error show how large they are for this noise anyhow.
    """
    features = _quadratic(data.view)
    axes = axis_vectors(data.view)[:, :, [0, 1, 2, 5, 6, 7]]
    own = np.nan_to_num(slopes(data.view, model.acting))
    columns = (axes[:, :, :, None] * features[:, None, None, :]).reshape(len(data.view), 3, -1)
    columns = np.concatenate([own, columns], axis=2)
    weighted = model.precision.solve(columns)
    normal = inner(columns, weighted)
    residual = model.precision.solve(model.error[:, :, None])[:, :, 0]
    projector, root = _freed(normal, own.shape[2])
    seen = root.T @ (projector @ inner(columns, residual[:, :, None])[:, 0])
    energies, peaks = [], []
    for shift in rng.integers(len(data.view) // 10, max(len(data.view) * 9 // 10, 2), SHIFTS):
        rolled = np.roll(residual, int(shift), axis=0)
        turned = root.T @ (projector @ inner(columns, rolled[:, :, None])[:, 0])
        energies.append(float(turned @ turned))
        peaks.append(float(np.max(turned**2)))
    freedom = root.shape[1]
    inflation = max(1.0, float(np.median(energies)) / freedom)
    energy = float(seen @ seen) / inflation
    peak = float(np.max(seen**2)) / inflation
    p_peak = min(1.0, float(2.0 * norm.sf(np.sqrt(peak))) * freedom)
    return Remainder(float(chi2.sf(energy, freedom)), p_peak, inflation, freedom)


def _quadratic(view: Scene) -> Array:
    """1, c_i, c_i c_j (n, f) of standardised covariates; angles enter as sine and cosine."""
    parts = [np.ones(len(view))]
    for covariate in covariates(view):
        if covariate.unit == "deg":
            angle = np.radians(covariate.values)
            parts += [np.sin(angle), np.cos(angle)]
        else:
            spread = float(np.std(covariate.values))
            if spread > 1e-9:
                parts.append((covariate.values - np.mean(covariate.values)) / spread)
    base = np.stack(parts, axis=1)
    i, j = np.triu_indices(base.shape[1])
    products: Array = base[:, i] * base[:, j]
    return products


def _freed(normal: Array, width: int) -> tuple[Array, Array]:
    """Projector of scores onto what the model's own effects leave, and a root of their precision.

    Scores s of all columns become P s, with covariance M; root' P s is then standard normal.
    """
    count = normal.shape[0] - width
    projector = np.concatenate([np.zeros((count, width)), np.eye(count)], axis=1)
    rest = normal[width:, width:]
    if width:
        cross = normal[width:, :width] @ inverse_scaled(normal[:width, :width])
        projector[:, :width] = -cross
        rest = rest - cross @ normal[:width, width:]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(rest), 1e-300))
    values, vectors = np.linalg.eigh(rest * scale[:, None] * scale)
    kept = values > 1e-6 * values[-1]
    root = scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
    return projector, root
