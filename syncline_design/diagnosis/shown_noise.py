"""Slow noise as far as a log's own courses show it, once effects have taken what they can.

Noise that is slower than the log looks like a constant or a drift, and the likelihood of a log
without effects takes such effects for it.  Here the slow courses of every channel are sized on what
the dictionary's effects cannot make (restricted maximum likelihood): a constant moves no course, so
it is no witness of slow noise.  What a channel's courses show limits how large the mean of its
noise over the log may be; noise that is quick against the log has no such mean and stays free.
Source: Patterson and Thompson, Biometrika 58 (1971).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.fitting import Data, data_of
from syncline_design.diagnosis.noise import Slow, as_specified
from syncline_design.diagnosis.slow_sizes import Channel
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.diagnosis.survey import with_shown_survey

COURSES = 1.0  # variance of the mean over that of the first course
MEAN_LEAST = 1e-3  # of the spec's variance: smaller means do not matter


def with_shown_noise(data: Data, found: Sequence[Signature]) -> Data:
    """The data with slow noise and survey errors no larger than the log shows."""
    fixed = [np.nan_to_num(s.columns) for s in found]
    explained = np.concatenate(fixed, axis=2) if fixed else None
    data = replace(data, explained=explained)
    shown = slow_states(data).sizes(as_specified(data.structure), data.error(()))
    slow = tuple(_limited(part, shown) for part in data.structure.slow)
    limited = data_of(data.view, replace(data.structure, slow=slow))
    return replace(with_shown_survey(limited, found), explained=explained)


def _limited(part: Slow, shown: dict[Channel, float]) -> Slow:
    """Slow noise whose mean over the log is as large as its courses show at most."""
    own = [shown.get((part.sensor, k)) for k in range(part.columns)]
    return replace(part, means=tuple(_most(size2) for size2 in own))


def _most(size2: float | None) -> float:
    return max(COURSES * (size2 or 0.0), MEAN_LEAST)
