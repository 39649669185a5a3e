"""What figures of a diagnosis need: plain lists, thinned to what a plot can show."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.noise import marginal_variance
from syncline_design.diagnosis.regimes import Cell
from syncline_design.diagnosis.result import Json
from syncline_design.diagnosis.search import SearchResult
from syncline_design.effects.record import Array

MOST_POINTS = 800
NOMINAL = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
NED = ("north", "east", "down")
DIGITS = 6


@dataclass(frozen=True, slots=True)
class Likelihoods:
    """Negative log likelihood of all rows [nat]."""

    nll_before: float
    nll_after: float


def plots(data: Data, result: SearchResult, cells: tuple[Cell, ...]) -> Json:
    """Residuals before and after with the named effects' signature, the map, coverage."""
    before, after = data.error(()), result.model.error
    index = np.unique(np.linspace(0, len(data.view) - 1, MOST_POINTS).astype(int))
    sigma = np.sqrt(marginal_variance(data.structure, result.model.level))
    axes = {
        axis: {
            "before": _listed(before[index, k]),
            "after": _listed(after[index, k]),
            "signature": _listed((before - after)[index, k]),
            "expected_std": _listed(sigma[index, k]),
        }
        for k, axis in enumerate(NED)
    }
    return {
        "residuals": {"time_s": _listed(data.view.log.time_s[index]), "axes": axes},
        "where_map": _map(cells),
        "coverage": _coverage(data, before / sigma, after / sigma),
    }


def _map(cells: tuple[Cell, ...]) -> list[Json]:
    """Per covariate its regimes, each with the axis that disagrees most."""
    found: dict[str, dict[tuple[float, float], Cell]] = {}
    for cell in cells:
        own = found.setdefault(cell.covariate, {})
        key = cell.low, cell.high
        if key not in own or abs(cell.score) > abs(own[key].score):
            own[key] = cell
    return [
        {
            "covariate": name,
            "unit": next(iter(own.values())).unit,
            "cells": [
                {k: v for k, v in asdict(c).items() if k not in ("covariate", "unit")}
                for c in own.values()
            ],
        }
        for name, own in found.items()
    ]


def _listed(values: Array) -> list[float]:
    return [float(f"{v:.{DIGITS}g}") for v in values]


def _coverage(data: Data, before: Array, after: Array) -> list[Json]:
    """Share of components inside the expected interval, against the nominal share."""
    from scipy.stats import norm

    visible = np.isfinite(data.view.log.truth_m)
    rows = []
    for nominal in NOMINAL:
        k = float(norm.isf(0.5 * (1.0 - nominal)))
        shares = [float(np.mean(np.abs(scaled[visible]) < k)) for scaled in (before, after)]
        rows.append({"nominal": nominal, "before": shares[0], "after": shares[1]})
    return rows
