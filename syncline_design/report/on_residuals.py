"""The residuals of a diagnosis in figures, each with a sentence on what to see in it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Final

from syncline_design.diagnosis.plotted import (
    NormalPlot,
    Plots,
    PlottedTrack,
    Spectrum,
)
from syncline_design.report import charts_diagnosis as drawings
from syncline_design.report import charts_residuals as of_residuals
from syncline_design.report import numbers
from syncline_design.report.document import Chart, Node

EVEN: Final = 1.5  # RMS over a covariate: largest over smallest up to which it is called even
TAILS: Final = 1.15  # of the normal's outermost quantile, beyond which tails are called heavy


def residual_nodes(plots: Plots) -> list[Node]:
    """All figures that the log has data for."""
    return [*_over_time(plots), *_more(plots)]


def _over_time(plots: Plots) -> list[Node]:
    found = plots.residuals
    if len(found.time_s) < 2:
        return []
    axes = [
        drawings.ResidualAxis(name, _floats(one.before), _floats(one.after), _floats(one.signature))
        for name, one in found.axes.items()
    ]
    caption = (
        "Measured minus simulated position, before and after the named effects were added, with "
        "their own signature."
    )
    return [Chart("residuals", partial(drawings.residuals, found.time_s, axes), caption)]


def _more(plots: Plots) -> Iterator[Node]:
    """In an order that fills two columns to about the same height."""
    if plots.track is not None and plots.track.arrows:
        draw = partial(of_residuals.track_map, plots.track)
        yield Chart("track", draw, _track_words(plots.track))
    if plots.spectrum is not None:
        draw = partial(of_residuals.spectrum, plots.spectrum)
        yield Chart("spectrum", draw, _spectrum_words(plots.spectrum))
    rows = {"time": plots.residuals.time_s, **(plots.motion or {})}
    rows = {name: values for name, values in rows.items() if len(set(values)) > 1}
    before, after = _sizes(plots)
    if plots.motion and rows and len(before) >= of_residuals.BINS:
        draw = partial(of_residuals.against, rows, before, after)
        yield Chart("against", draw, _against_words(rows, before, after))
    if plots.normal is not None:
        draw = partial(of_residuals.normal, plots.normal)
        yield Chart("normal", draw, _normal_words(plots.normal))


def _floats(values: Sequence[float | None]) -> tuple[float, ...]:
    return tuple(math.nan if v is None else v for v in values)


def _sizes(plots: Plots) -> tuple[list[float], list[float]]:
    """Length of the residual at every point [m], before and after."""
    axes = plots.residuals.axes.values()
    return tuple(  # type: ignore[return-value]  # two lists
        [
            math.sqrt(sum((v or 0.0) ** 2 for v in point))
            for point in zip(*(getattr(axis, which) for axis in axes), strict=True)
        ]
        for which in ("before", "after")
    )


def _track_words(track: PlottedTrack) -> str:
    first, last = of_residuals.longest_m(track)
    larger = numbers.number(of_residuals.drawn_larger(track), 2)
    words = (
        f"The way from above; arrows are the mean residual of {len(track.arrows)} stretches, drawn "
        f"{larger} times larger than the map: at most {numbers.length(first, 3)} before and "
        f"{numbers.length(last, 3)} after."
    )
    if last < 0.5 * first:
        return f"{words} What pointed one way with heading or place is gone."
    return f"{words} Arrows that turn with the heading are the vehicle's, others the map's."


def _against_words(
    rows: Mapping[str, Sequence[float]], before: Sequence[float], after: Sequence[float]
) -> str:
    """Over what the residuals changed most, and whether they still do."""
    spread = {name: _unevenness(values, before) for name, values in rows.items()}
    most = max(spread, key=lambda name: spread[name])
    left = _unevenness(rows[most], after)
    name = most.replace("_", " ")
    words = (
        "RMS of the residuals over time and motion, before and after. Before, it changes most with "
        f"the {name}, by {numbers.number(spread[most], 2)} times"
    )
    if spread[most] <= EVEN:
        return f"{words}: it is even. After, by {numbers.number(left, 2)} times."
    still = "it is even" if left <= EVEN else "it still does"
    return f"{words}; after, {still} (by {numbers.number(left, 2)} times)."


def _unevenness(values: Sequence[float], sizes: Sequence[float]) -> float:
    found = [size for _, size in of_residuals.binned(values, sizes)]
    return max(found) / max(min(found), 1e-300)


def _spectrum_words(found: Spectrum) -> str:
    over = [k for k, power in enumerate(found.power) if power > found.most[k]]
    words = (
        "Spectrum of what the named effects and slow noise leave, 1 being white noise; dashed: "
        "what white noise seldom exceeds."
    )
    if not over:
        return f"{words} Nothing stands out: no wave and no course is left."
    worst = max(over, key=lambda k: found.power[k] / found.most[k])
    period = numbers.si_quantity(1.0 / found.frequency_hz[worst], "s", 3)
    return f"{words} It stands out most at a period of {period}: something swings or drifts there."


def _normal_words(found: NormalPlot) -> str:
    ends = (found.remainder[0] / found.normal[0], found.remainder[-1] / found.normal[-1])
    words = "Quantiles of the same against the normal's; on the dashed line it is normal."
    if max(ends) > TAILS:
        times = numbers.number(max(ends), 2)
        return (
            f"{words} Its ends are {times} times as far out as they would be: tails, or outliers."
        )
    if max(ends) < 1.0 / TAILS:
        return f"{words} Its ends are nearer than the normal's: the noise is smaller than fitted."
    return f"{words} It keeps to it out to its ends."
