"""Two causes that undo each other: neither is shown to be there.

An arm that is 5 m too high and targets that are 5 m too low leave nothing of each other on a level
vehicle.  Such a pair stands for what it does beside that, not for itself, unless the log knows each
of its figures far better than their difference asks for.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from syncline_design.diagnosis.candidates import slopes
from syncline_design.diagnosis.consequence import rms_m
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.identity import Label
from syncline_design.effects.record import Array

LEFT_OVER = 0.1  # of the smaller one, that the two leave together
FAR = 3.0  # times what the spec's noise makes, from which their size is no chance
KNOWN = 10.0  # standard uncertainties from which a figure is known for itself


def cancelling(
    data: Data, model: Model, spreads: Mapping[Label, Array], spec_m: float
) -> dict[Label, Label]:
    """Effects of a model that another one undoes, with that other one."""
    columns = np.nan_to_num(slopes(data.view, model.acting))
    figures: list[tuple[Label, Array]] = []
    at = 0
    for one in model.acting:
        for k, p in enumerate(one.effect.slopes()):
            value, spread = float(one.values[p.name]), float(spreads[one.label][k])
            if abs(value) < KNOWN * spread < np.inf:
                figures.append((one.label, value * columns[:, :, at + k]))
        at += len(one.effect.slopes())
    large = [(label, made) for label, made in figures if rms_m(data, made) > FAR * spec_m]
    found: dict[Label, Label] = {}
    for (first, made), (second, other) in itertools.combinations(large, 2):
        smaller = min(rms_m(data, made), rms_m(data, other))
        if first != second and rms_m(data, made + other) < LEFT_OVER * smaller:
            found |= {first: second, second: first}
    return found
