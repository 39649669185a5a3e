"""What figures of a diagnosis need: plain lists, thinned to what a plot can show."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from syncline_design.diagnose.fitting import Data
from syncline_design.diagnose.noise import marginal_variance
from syncline_design.diagnose.regimes import Cell
from syncline_design.diagnose.result import Json
from syncline_design.diagnose.search import SearchResult
from syncline_design.effects.base import Array

MOST_POINTS = 600
DIGITS = 6


@dataclass(frozen=True, slots=True)
class Likelihoods:
    """Negative log likelihood of all rows [nat]."""

    nll_before: float
    nll_after: float


def figures_data(data: Data, result: SearchResult, cells: tuple[Cell, ...]) -> Json:
    """Residuals before and after with the named effects' signature, the map, coverage."""
    before, after = data.error(()), result.model.error
    index = np.unique(np.linspace(0, len(data.view) - 1, MOST_POINTS).astype(int))
    sigma = np.sqrt(marginal_variance(data.structure, result.model.level))
    return {
        "time_s": _listed(data.view.log.time_s[index]),
        "axes": ["north", "east", "down"],
        "before_m": [_listed(before[index, k]) for k in range(3)],
        "after_m": [_listed(after[index, k]) for k in range(3)],
        "signature_m": [_listed((before - after)[index, k]) for k in range(3)],
        "expected_std_m": [_listed(sigma[index, k]) for k in range(3)],
        "map": [asdict(cell) for cell in cells],
        "coverage": _coverage(data, after / sigma),
    }


def _listed(values: Array) -> list[float]:
    return [float(f"{v:.{DIGITS}g}") for v in values]


def _coverage(data: Data, scaled: Array) -> Json:
    """Share of components inside k expected standard deviations, against the normal share."""
    from scipy.stats import norm

    visible = np.isfinite(data.view.log.truth_m)
    levels = np.linspace(0.1, 3.0, 30)
    size = np.abs(scaled[visible])
    return {
        "k": _listed(levels),
        "measured": [float(np.mean(size < k)) for k in levels],
        "normal": [float(2.0 * norm.cdf(k) - 1.0) for k in levels],
    }
