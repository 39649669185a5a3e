"""Two trajectories of one rigid body: places and attitudes compared at points on the body.

A point at a lever u on the body stands at p + R u by either trajectory.  The reference's is the
truth, the tested one's is computed as if a perfect ranging sensor had seen the point at u: an error
of place shows at every point, an error of attitude at those across it.  The points change from row
to row, so that every turn is seen, along every axis and its opposite.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from typing import Final

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotate
from syncline_design.effects.record import Array
from syncline_design.logs.columns import RANGING, REFERENCE, REFERENCE_ATTITUDE, TARGET
from syncline_design.model.figure_text import to_places
from syncline_design.model.system import Sensor

SHORTEST_M, LONGEST_M = 1.0, 100.0
AXES: Final = np.array(
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0],
     [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
)  # fmt: skip


def lever_m(position: Sensor | None, attitude: Sensor | None) -> float | None:
    """The lever at which both sensors' noise is worth the same [m]; None without both."""
    if position is None or attitude is None:
        return None
    place, angle = max(position.sigma), max(attitude.sigma)
    lever = place / angle if angle > 0.0 else LONGEST_M
    return float(np.clip(lever, SHORTEST_M, LONGEST_M))


def with_points(columns: MutableMapping[str, Array], prefix: str, lever: float) -> str:
    """Add range, bearing and true place of a point a row; what was done, for people."""
    count = columns[REFERENCE[0]].shape[0]
    points = lever * AXES[np.arange(count) % AXES.shape[0]]
    reference = np.stack([columns[n] for n in REFERENCE], axis=1)
    turn = euler_to_rotation(np.stack([columns[n] for n in REFERENCE_ATTITUDE], axis=1))
    truth = reference + rotate(turn, points)
    columns.update({name: truth[:, k] for k, name in enumerate(TARGET)})
    columns[prefix + RANGING[0]] = np.full(count, lever)
    columns[prefix + RANGING[1]] = np.arctan2(points[:, 1], points[:, 0])
    columns[prefix + RANGING[2]] = -np.arcsin(np.clip(points[:, 2] / lever, -1.0, 1.0))
    return (
        f"places and attitudes were compared at points {to_places(lever, 2)} m from the "
        f"reference point, "
        "along each axis of the body in turn"
    )
