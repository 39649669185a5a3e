"""What the page of a diagnosis draws, as data."""

from __future__ import annotations

from collections.abc import Mapping

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional


@dataclass(frozen=True, slots=True)
class AxisResiduals(Record):
    """Residuals of one axis [m]; None where the log knows no truth along it."""

    before: tuple[float | None, ...]
    after: tuple[float | None, ...]
    signature: tuple[float | None, ...]
    expected_std: tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class Residuals(Record):
    """Residuals over time, by axis."""

    time_s: tuple[float, ...]
    axes: Mapping[str, AxisResiduals]


@dataclass(frozen=True, slots=True)
class MapCell(Record):
    """One regime of a covariate, and the axis that disagrees most in it."""

    low: float
    high: float
    axis: str
    score: float
    mean_m: float
    rows: int


@dataclass(frozen=True, slots=True)
class CovariateMap(Record):
    """Disagreement over one covariate."""

    covariate: str
    unit: str
    cells: tuple[MapCell, ...]


@dataclass(frozen=True, slots=True)
class Coverage(Record):
    """Share of components inside the interval of a nominal share."""

    nominal: float
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class Arrow(Record):
    """Mean residual of a stretch of the way, at its middle, before and after [m]."""

    north_m: float
    east_m: float
    before_north_m: float
    before_east_m: float
    after_north_m: float
    after_east_m: float


@dataclass(frozen=True, slots=True)
class PlottedTrack(Record):
    """The way of the last stage's reference point, with the residuals along it."""

    north_m: tuple[float, ...]
    east_m: tuple[float, ...]
    arrows: tuple[Arrow, ...]


@dataclass(frozen=True, slots=True)
class Spectrum(Record):
    """Power of the whitened remainder over frequency: 1 for white noise, seldom above most."""

    frequency_hz: tuple[float, ...]
    power: tuple[float, ...]
    most: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class NormalPlot(Record):
    """Quantiles of the standard normal and of the whitened remainder."""

    normal: tuple[float, ...]
    remainder: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Plots(Record):
    """What figures need, thinned to what a plot can show; motion: covariates at `residuals`."""

    residuals: Residuals
    where_map: tuple[CovariateMap, ...]
    coverage: tuple[Coverage, ...]
    track: PlottedTrack | None = optional()
    motion: Mapping[str, tuple[float, ...]] | None = optional()
    spectrum: Spectrum | None = optional()
    normal: NormalPlot | None = optional()
