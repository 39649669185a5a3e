"""Errors of the targets' survey: as large as the log itself shows, and no larger than they matter.

A target's error is in all of its rows, so that rows are no independent witnesses of an effect.  Its
size is the standard deviation of one random constant a target and axis beside slow noise of every
sensor, by expectation and maximisation, once everything that the dictionary's effects could make of
the error is taken out (restricted maximum likelihood): what an effect explains is no survey error.
Source: Patterson and Thompson, Biometrika 58 (1971).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.consequence import LEFT_SHARE, expected_rms_m
from syncline_design.diagnosis.fitting import Data, data_of, inner, inverse_scaled
from syncline_design.diagnosis.noise import as_specified, precision
from syncline_design.diagnosis.slow_states import SURVEY, few_targets, slow_states
from syncline_design.effects.record import Array

SHOWN = 0.1  # of the most it may be: smaller survey errors do not matter


def with_shown_survey(data: Data, found: Sequence[Signature]) -> Data:
    """The data with a random survey error of every target, where targets are few and it shows.

    It may be as large as is not material: a third of what the spec's own noise expects.
    """
    target = few_targets(data)
    if target is None:
        return data
    most_m = LEFT_SHARE * expected_rms_m(data) / math.sqrt(len(data.axes))
    unit = _indicators(data, target, most_m)
    share = math.sqrt(_size2(data_of(data.view, replace(data.structure, survey=unit)), found))
    if share < SHOWN:
        return data
    return data_of(data.view, replace(data.structure, survey=share * unit))


def survey_m(data: Data) -> float | None:
    """Standard deviation [m] of one coordinate of a target."""
    survey = data.structure.survey
    return None if survey is None or data.view.log.laid is not None else float(np.max(survey))


def _indicators(data: Data, target: NDArray[np.int64], size_m: float) -> Array:
    """One column (n, 3, q) [m] for each target and axis compared."""
    own = (target[:, None] == np.arange(int(target.max()) + 1)).astype(float)
    columns: Array = own[:, None, :, None] * size_m * np.eye(3)[:, None, list(data.axes)]
    flat: Array = columns.reshape(len(data.view), 3, -1)
    return flat


def _size2(data: Data, found: Sequence[Signature]) -> float:
    """Variance of the survey's errors over the unit's, beside all effects and slow noise."""
    states, level = slow_states(data), as_specified(data.structure)
    known = precision(replace(data.structure, survey=None), level)
    fixed = [np.nan_to_num(s.columns) for s in found]
    error = data.error(())
    if fixed:
        columns = np.concatenate(fixed, axis=2)
        weighted = known.solve(columns)
        inverse = inverse_scaled(inner(columns, weighted))
        both = np.concatenate([states.courses, error[:, :, None]], axis=2)
        both = both - columns @ (inverse @ inner(weighted, both))
        states, error = replace(states, courses=both[:, :, :-1]), both[:, :, -1]
    return states.sizes(level, error)[SURVEY, 0]
