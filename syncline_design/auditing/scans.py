"""Where in a scan its stamp lies, as the times of its points tell."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import Series, seconds
from syncline_design.logs.readers.stream import PointTimes
from syncline_design.model.figure_text import signed, to_digits

_WHOLE_SCANS: Final = 1.25  # how far from its stamp a point of a scan may lie, in scans


def scan(series: Series, points: PointTimes | None, interval_s: float) -> StampFault | None:
    """Where in a scan its stamp lies, as the times of its points tell.

    interval_s: between two scans [s].
    """
    if points is None or points.last_s - points.first_s <= 0.0:
        return None
    length = points.last_s - points.first_s
    parameters: dict[str, float | str] = {"first_s": points.first_s, "last_s": points.last_s}
    far = _beyond(points, max(length, interval_s), parameters)
    if far is not None:
        return far
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


def _beyond(
    points: PointTimes, scan_s: float, parameters: dict[str, float | str]
) -> StampFault | None:
    """A stamp that lies outside its own scan: one of start, middle or end has all within scan_s.

    Cut-outs of a scan have fewer points, none of them farther off.
    """
    before, after = -points.first_s, points.last_s
    if max(before, after) <= _WHOLE_SCANS * scan_s:
        return None
    name: Literal["end_of_scan", "start_of_scan"] = (
        "end_of_scan" if before > after else "start_of_scan"
    )
    return StampFault(
        name, {**parameters, "kind": "contradicted"}, None, None,
        f"points were measured from {signed(points.first_s * 1e3, 4)} to "
        f"{signed(points.last_s * 1e3, 4)} ms about the stamp, but a scan takes "
        f"{to_digits(scan_s * 1e3, 4)} ms: at its start, its middle or its end, "
        "none of its points lies farther off than that",
    )  # fmt: skip


def _too_early(series: Series, points: PointTimes) -> bool:
    """Whether most messages come before their last point was measured."""
    if series.receive is None or not series.good.any():
        return False
    late = seconds((series.receive - series.stamp)[series.good])
    return -0.5 < float(np.median(late)) < 0.9 * points.last_s
