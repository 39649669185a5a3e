"""The sensors whose slow noise does in a stretch what stands out there as a constant.

The stretch is the one, of all places of its length, in which the log looks most like a constant:
a constant pays for them (Bonferroni) before it is told from noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.noise_course import CourseRows, over_noise
from syncline_design.diagnosis.stretch_windows import PLACES
from syncline_design.effects.record import Array

# Within these a constant is not told from noise, nor one noise from another.
AS_GOOD_NATS: Final = 4.5


def noise_instead(
    data: Data,
    whitened: tuple[Array, Array],
    asked: Sequence[Signature],
    stretch: tuple[float, float],
    scale2: float,
) -> tuple[str, ...]:
    """Whose noise explains a stretch as well as any of the effects asked; none where none does.

    whitened: root of W (n, 3, 3), and the remainder that it made (n, 3).  scale2: variance of the
    noise at that length, over W's.
    """
    root, left = whitened
    parts = data.structure.slow
    size = math.sqrt(max(scale2, 1.0))
    rows = CourseRows(
        data.view.log.time_s,
        left / size,
        tuple(root @ one.loading / size for one in parts),
        tuple(root @ np.nan_to_num(s.columns) / size for s in asked),
    )
    found = over_noise(rows, *stretch)
    time_s, (from_s, to_s) = rows.time_s, stretch
    places = PLACES * (time_s[-1] - time_s[0]) / max(to_s - from_s, 1e-9)
    if found.gain > AS_GOOD_NATS + math.log(max(places, 1.0)):
        return ()
    near = zip(parts, found.behind, strict=True)
    return tuple(one.sensor[1] for one, behind in near if behind < AS_GOOD_NATS)
