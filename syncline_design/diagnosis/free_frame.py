"""The constant shift and turn between two frames that only the log itself laid onto each other.

Where nothing relates the frames, shift and turn were fitted to the very error that is judged, and
what is constant in it may be theirs: an effect that looks like it (a lever arm down on a vehicle
that never tilts, an offset of the datum) has no witness.  They are held free as constants common to
all rows, with a standard deviation far beyond the noise, which is a flat prior for all that counts.
Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), ch. 2.7.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.consequence import expected_rms_m
from syncline_design.diagnosis.fitting import Data, data_of
from syncline_design.effects.record import Array
from syncline_design.logs.frame_fit import FREE

WIDE: Final = 1e3  # times what the noise expects: flat, and far from rounding


def with_free_frame(data: Data) -> Data:
    """The data with shift and turn free where the log was laid by them; else as they are."""
    if data.view.log.laid is None:
        return data
    own = _columns(data) * WIDE * expected_rms_m(data)
    shown = data.structure.survey
    whole = own if shown is None else np.concatenate([shown, own], axis=2)
    freed = data_of(data.view, replace(data.structure, survey=whole))
    return replace(freed, explained=data.explained)


def _columns(data: Data) -> Array:
    """Slopes (n, 3, q) of the error by shift and turn, each of root mean square about 1."""
    log = data.view.log
    assert log.laid is not None
    axes = np.eye(3)
    shifts = np.broadcast_to(axes[:, list(data.axes)], (len(log), 3, len(data.axes)))
    known = np.isfinite(log.truth_m)
    truth = np.where(known, log.truth_m, 0.0)  # an axis may be untold: a mean of nothing warns
    middle = truth.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    about = np.where(known, truth - middle, 0.0)
    turned = [np.cross(axes[k], about) for k in range(3 - FREE[log.laid], 3)]
    sized = [t / max(float(np.sqrt(np.mean(t**2))), 1e-12) for t in turned]
    return np.concatenate([shifts, *(t[:, :, None] for t in sized)], axis=2)
