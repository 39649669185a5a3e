"""Stamps that say when a message came instead of when it was measured; stamps of the future."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.cadence import Cadence, about_rhythm
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import Array, Series, in_words, seconds, spread
from syncline_design.logs.readers.stream import PointTimes
from syncline_design.model.figure_text import signed, to_digits

_TIGHT: Final = 0.2  # scatter of receipt minus stamp against that of the stamps' rhythm
_LEAST_JITTER_S: Final = 5e-6
_SKEWED: Final = 0.2  # how much further the late half of the rhythm's scatter reaches


def stamped_on_arrival(series: Series, pace: Cadence) -> StampFault | None:
    """Stamps that scatter as arrivals do while receipts follow them closely.

    A sensor that stamps itself keeps an even rhythm, and receipts scatter by transport.  Here the
    rhythm has transport's scatter, one-sided (nothing comes before it was sent), and hardly any is
    left between stamp and receipt.  Irregular sensors have no rhythm to show it.
    """
    if series.receive is None or pace.places.size < 40:
        return None
    late = seconds((series.receive - series.stamp)[pace.places])
    about = about_rhythm(seconds(series.stamp[pace.places] - series.stamp[pace.places[0]]))
    if not late.any():
        if copied(about):
            return None
        return StampFault("stamped_on_arrival", {}, None, None,
                          "every stamp equals its receipt")  # fmt: skip
    if about is None:
        return None
    own, transport = spread(about), _width(late)
    if own < _LEAST_JITTER_S or transport > _TIGHT * own or not _one_sided(about):
        return None
    return StampFault(
        "stamped_on_arrival", {"seconds": own}, None, None,
        f"stamps scatter by {in_words(own)} about the sensor's rhythm, late rather than early, "
        f"while receipts follow within {in_words(transport)}: they say when messages came",
    )  # fmt: skip


def copied(about: Array | None) -> bool:
    """Whether times that are alike keep a rhythm that no arrivals keep: receipts made of stamps."""
    return about is not None and float(np.ptp(np.percentile(about, [1.0, 99.0]))) < _LEAST_JITTER_S


def _width(late: Array) -> float:
    """Interquartile range, blind to slow changes of the level."""
    return float(min(spread(late), spread(np.diff(late))))


def _one_sided(about: Array) -> bool:
    """Whether the late half of a scatter reaches further than the early one."""
    low, middle, high = np.percentile(about, [5, 50, 95])
    reach = high - low
    return bool(reach > 0.0 and (high - middle) - (middle - low) > _SKEWED * reach)


def ahead(series: Series, known_s: float, resolution_s: float) -> StampFault | None:
    """Messages whose stamp lies after their receipt: two clocks that do not agree.

    known_s: a constant offset that already has a name; resolution_s: of either time.
    """
    if series.receive is None:
        return None
    places = series.places()
    late = seconds((series.receive - series.stamp)[places]) + known_s
    before = late < -(1e-6 + resolution_s)
    count = int(before.sum())
    if count < max(3, 0.002 * late.size):
        return None
    largest = -float(late.min())
    whole = count > 0.9 * late.size
    times = series.seconds[places[before]]
    return StampFault(
        "ahead_of_receipt", {"seconds": largest, "count": float(count)},
        None if whole else float(times[0]), None if whole else float(times[-1]),
        f"{count} of {late.size} stamps lie after their receipt, by up to {in_words(largest)}: "
        "no message comes before it was measured",
    )  # fmt: skip


def scan(series: Series, points: PointTimes | None) -> StampFault | None:
    """Where in a scan its stamp lies, as the times of its points tell."""
    if points is None or points.last_s - points.first_s <= 0.0:
        return None
    length = points.last_s - points.first_s
    parameters: dict[str, float | str] = {"first_s": points.first_s, "last_s": points.last_s}
    at_start = abs(points.first_s) < 0.25 * length
    at_end = abs(points.last_s) < 0.25 * length
    declared = "start_of_scan" if at_start else "end_of_scan" if at_end else None
    if declared == "start_of_scan" and _too_early(series, points):
        return StampFault(
            "end_of_scan", {**parameters, "kind": "contradicted"}, None, None,
            f"points reach {to_digits(points.last_s * 1e3, 4)} ms beyond the stamp, but "
            f"messages come sooner "
            "than that: the stamp is of the scan's end",
        )  # fmt: skip
    if declared is None:
        return None
    words = "start" if declared == "start_of_scan" else "end"
    name = "start_of_scan" if declared == "start_of_scan" else "end_of_scan"
    return StampFault(
        name, {**parameters, "kind": "declared"}, None, None,  # type: ignore[arg-type]
        f"stamps are of the scan's {words}: points from {signed(points.first_s * 1e3, 4)} to "
        f"{signed(points.last_s * 1e3, 4)} ms", counts=False,
    )  # fmt: skip


def _too_early(series: Series, points: PointTimes) -> bool:
    """Whether most messages come before their last point was measured."""
    if series.receive is None or not series.good.any():
        return False
    late = seconds((series.receive - series.stamp)[series.good])
    return -0.5 < float(np.median(late)) < 0.9 * points.last_s
