"""Whether what begins somewhere in a log has the form that its name claims: a step is no ramp,
and before it there is none of it.

Beside a step and a constant the same shape, growing with time all along the log, has to be
nothing: what drifts looks like a step in the middle, and a step's size alone does not tell.
Judged beside the slow states, so that noise which is larger or slower than the spec's does not
refute a step; stretches left out in turn have no say, as only a few at the ends tell a ramp from a
step.  The rows before a step have to speak against its having been there from the start, and
to pay for its place: a delay that may not be named passes for a step as early as one is looked for.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import slopes
from syncline_design.diagnosis.charges import place_nats
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.identity import Label
from syncline_design.diagnosis.parts import NATS
from syncline_design.diagnosis.slow_states import States
from syncline_design.diagnosis.trials import refitted
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array

REFUTED = math.log(1e-4)  # log p of a ramp beside a step


def refuted_steps(states: States, model: Model) -> frozenset[Label]:
    """The model's steps beside which the data want a ramp of the same shape, and those that would
    do as well from the start on."""
    steps = [one for one in model.acting if any(p.located for p in one.effect.parameters)]
    if not steps:
        return frozenset()
    view = states.data.view
    always = [np.nan_to_num(slopes(view, (_always(one),))) for one in steps]
    ramps = [_ramp(states, shape) for shape in always]
    own = np.concatenate([np.nan_to_num(slopes(view, model.acting)), *always], axis=2)
    judged = states.beside(*ramps).judged(model, ramps, own)
    return frozenset(
        one.label for one, beside in zip(steps, judged, strict=True)
        if beside.model_log_p < REFUTED or _always_as_well(states.data, model, one)
    )  # fmt: skip


def _always_as_well(data: Data, model: Model, one: Acting) -> bool:
    """Whether the step, in all of the log and fitted again, loses less than its place costs."""
    rest = (_always(each) if each.label == one.label else each for each in model.acting)
    lost = refitted(data, tuple(rest), model).nll - model.nll
    return lost < NATS + place_nats(data, model, one.label)


def _always(one: Acting) -> Acting:
    located = {p.name: -math.inf for p in one.effect.parameters if p.located}
    return replace(one, values={**one.values, **located})


def _ramp(states: States, always: Array) -> Array:
    """The shape (n, 3, p) that an effect has in all of the log, times the time from its middle."""
    time_s = states.data.view.log.time_s
    since = time_s - 0.5 * (time_s[0] + time_s[-1])
    ramp: Array = always * (since / max(float(np.ptp(since)), 1e-9))[:, None, None]
    return ramp
