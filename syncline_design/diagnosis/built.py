"""The diagnosis of a built system: the log in whole, in stretches, and what it leaves open.

What stands out in a stretch is taken out, and the rest is diagnosed anew: a second of faulty rows
would be noise of all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.diagnosis.instead import InItsPlace, in_place
from syncline_design.diagnosis.limits import Beyond, beyond_limits
from syncline_design.diagnosis.noise_split import NoiseFactors, factors
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.run import SearchedLog, examined, told
from syncline_design.diagnosis.search import DiagnosisSettings
from syncline_design.diagnosis.stretches import Stands, Stretches, stretches
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.diagnosis.undone import LeftOpen, left_open
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case

ROUNDS: Final = 3  # of taking out what stands out
MOST_TAKEN: Final = 0.3  # of the rows
MARGIN, MARGIN_ROWS = 0.25, 2.0  # of a stretch, and rows, by which its ends may be off


@dataclass(frozen=True, slots=True)
class Sighted:
    """A log's diagnosis, less what stands out in stretches, and what else it says.

    taken: the stretches that the diagnosis is without.  factors: noise by `stage/sensor`.
    instead: what several departures together explain as well as one that was found.
    beyond: how far speed and turn rate are beyond their limits, by code and stage.
    ends_s: stamps of the log's first and last row; None: not known.
    """

    found: Diagnosis
    stretches: Stretches = field(default_factory=Stretches)
    open: tuple[LeftOpen, ...] = ()
    factors: Mapping[str, NoiseFactors] = field(default_factory=dict)
    beyond: Mapping[tuple[str, str], Beyond] = field(default_factory=dict)
    taken: tuple[Stands, ...] = ()
    instead: tuple[InItsPlace, ...] = ()
    ends_s: tuple[float, float] | None = None


def sighted(case: Case, paths: Sequence[Path], settings: DiagnosisSettings) -> Sighted:
    """Raises BadInput for a spec or log that cannot be used."""
    in_force().doing("reading the log")
    with one_thread():
        inputs = measured(case, paths)
        one = examined(inputs, settings)
        beyond = beyond_limits(one.data.view)
        seen, taken = _seen(one), []
        for _ in range(ROUNDS):
            sure = [s for s in seen.stands if s.sure]
            less = _less(one.inputs, sure)
            if less is None:
                break
            taken += sure
            in_force().doing("diagnosing the log without what stands out")
            one = examined(less, settings)
            seen = _seen(one)
        model = one.result.model
        left = left_open(one.data, model, one.search.signatures)
        stands = (*taken, *seen.stands)
        return Sighted(
            told(one, case),
            replace(seen, stands=stands),
            left,
            factors(one.data, model, one.search.unlike or ()),
            beyond,
            tuple(taken),
            in_place(one.data, model, one.search.signatures),
            inputs.log.ends_s,
        )


def _seen(one: SearchedLog) -> Stretches:
    in_force().doing("looking at stretches of the log")
    model = one.result.model
    free = one.search.free_signatures(model)
    return stretches(one.data, model, free, one.search.settings.seed)


def _less(inputs: Measured, taken: Sequence[Stands]) -> Measured | None:
    """The log without some stretches; None where that is nothing, or too much of it."""
    time_s = inputs.log.time_s
    step_s = float(np.median(np.diff(np.unique(time_s)))) if len(time_s) > 1 else 0.0
    inside = np.zeros(len(time_s), bool)
    for one in taken:
        margin_s = MARGIN_ROWS * step_s + MARGIN * (one.to_s - one.from_s)
        inside |= (time_s >= one.from_s - margin_s) & (time_s <= one.to_s + margin_s)
    if not np.any(inside) or np.mean(inside) > MOST_TAKEN:
        return None
    return replace(inputs, log=inputs.log.rows(np.flatnonzero(~inside)), reread=None)
