"""The error of a log as it came, before gross faults were undone in it."""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import Measured
from syncline_design.effects.record import Array


def untouched_error(inputs: Measured, data: Data) -> Array | None:
    """Error (n, 3) [m] of the log as it came, on the rows in use; None where they are not in it.

    Undoing a slip leaves out rows and never adds one; rows of one stamp keep their order.
    """
    wanted = _with_places(data.view.log.time_s)
    came = _with_places(inputs.log.time_s)
    order = np.lexsort((came[:, 1], came[:, 0]))
    at = np.searchsorted(came[order, 0], wanted[:, 0]) + wanted[:, 1].astype(np.int64)
    index = order[np.minimum(at, order.shape[0] - 1)]
    if not np.array_equal(came[index], wanted):
        return None
    error = scene(inputs.system, inputs.log, inputs.known).error()[index]
    return np.where(np.isfinite(data.view.log.truth_m), error, 0.0)


def _with_places(time_s: Array) -> Array:
    """(n, 2): stamps, and how many rows of the same stamp come before (rows in order of time)."""
    first = np.searchsorted(time_s, time_s, side="left")
    return np.stack([time_s, np.arange(time_s.shape[0]) - first], axis=1)
