"""What figures of a diagnosis need: plain lists, thinned to what a plot can show."""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.gap_result import Regime
from syncline_design.diagnosis.noise import marginal_variance
from syncline_design.diagnosis.plotted import (
    AxisResiduals,
    CovariateMap,
    Coverage,
    MapCell,
    Plots,
    Residuals,
)
from syncline_design.diagnosis.remainder_plots import (
    listed,
    motion_of,
    normal_of,
    spectrum_of,
    track_of,
)
from syncline_design.diagnosis.search import SearchResult
from syncline_design.effects.record import Array
from syncline_design.model.distributions import normal_limit

MOST_POINTS = 800
NOMINAL = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
NED = ("north", "east", "down")


def plots(data: Data, result: SearchResult, cells: tuple[Regime, ...]) -> Plots:
    """Residuals before and after with the named effects' signature, the map, coverage."""
    before, after = data.error(()), result.model.error
    index = np.unique(np.linspace(0, len(data.view) - 1, MOST_POINTS).astype(int))
    sigma = np.sqrt(marginal_variance(data.structure, result.model.level))
    axes = {
        axis: AxisResiduals(
            before=listed(before[index, k]),
            after=listed(after[index, k]),
            signature=listed((before - after)[index, k]),
            expected_std=listed(sigma[index, k]),
        )
        for k, axis in enumerate(NED)
    }
    residuals = Residuals(listed(data.view.log.time_s[index]), axes)
    return Plots(
        residuals,
        _map(cells),
        _coverage(data, before / sigma, after / sigma),
        track=track_of(data, before, after, index),
        motion=motion_of(data, index),
        spectrum=spectrum_of(data, result),
        normal=normal_of(data, result),
    )


def _map(cells: tuple[Regime, ...]) -> tuple[CovariateMap, ...]:
    """Per covariate its regimes, each with the axis that disagrees most."""
    found: dict[tuple[str, str], dict[tuple[float, float], Regime]] = {}
    for cell in cells:
        own = found.setdefault((cell.covariate, cell.unit), {})
        key = cell.low, cell.high
        if key not in own or abs(cell.score) > abs(own[key].score):
            own[key] = cell
    return tuple(
        CovariateMap(
            name,
            unit,
            tuple(MapCell(c.low, c.high, c.axis, c.score, c.mean_m, c.rows) for c in own.values()),
        )
        for (name, unit), own in found.items()
    )


def _coverage(data: Data, before: Array, after: Array) -> tuple[Coverage, ...]:
    """Share of components inside the expected interval, against the nominal share."""
    visible = np.isfinite(data.view.log.truth_m)
    rows = []
    for nominal in NOMINAL:
        k = float(normal_limit(0.5 * (1.0 - nominal)))
        shares = [float(np.mean(np.abs(scaled[visible]) < k)) for scaled in (before, after)]
        rows.append(Coverage(nominal, shares[0], shares[1]))
    return tuple(rows)
