"""Stamps of a file of poses that are set back: all of them, or those of its positions alone.

A file has one clock, but what fills it may have two: a receiver beside an attitude sensor.
"""

from __future__ import annotations

from syncline_design.diagnosis.gross_trials import usual_size
from syncline_design.diagnosis.mending import Reread, unslipped
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.slips import attitude_restamped
from syncline_design.logs.log import Log
from syncline_design.model.system import System


def set_back(system: System, log: Log, seconds: float, whole: Reread) -> Log:
    """The log with the stamps of its positions, or of its whole poses, set back.

    whole: reads it anew with both set back.  Positions are paired with other rows in either trial,
    so that both have the noise of the same interpolation.
    """
    alone = unslipped(log, seconds)
    if alone is log:
        return whole(seconds)
    both = attitude_restamped(alone, seconds)
    if not len(both):
        return whole(seconds)
    sizes = [usual_size(scene(system, one, ()).error()) for one in (alone, both)]
    return alone if sizes[0] < sizes[1] else whole(seconds)
