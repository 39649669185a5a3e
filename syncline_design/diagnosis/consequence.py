"""What a finding is worth: its share of the log's error, and what it does to the requirements.

A finding is material where its own RMS is at least a fifth of the RMS that the spec's noise makes
(in squares it then adds 4 %, to the RMS 2 %), where it turns a requirement, or where it raises the
total error by more than 5 %.  What is left is material above a third of that RMS, or where it turns
a requirement.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.effect_tables import design_budget
from syncline_design.choice.problem import build_problem, sole_design
from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.noise import as_specified, marginal_variance
from syncline_design.effects import registry
from syncline_design.effects.acting import known_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.budget import budget
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import System
from syncline_design.spec.case import Case

IMPLIED_SYNC = 1.0  # tau stays below tau_crit where no requirement says otherwise
SHARE = 0.2  # of the spec's RMS, from which a finding is material
RAISED = 0.05  # of the total error
LEFT_SHARE = 1.0 / 3.0  # of the spec's RMS, from which what is left is material
HALVINGS = 40


@dataclass(frozen=True, slots=True)
class SpecPromise:
    """What a spec promises: its system, the limits on the total error [m], on the sync ratio."""

    system: System
    limits_m: tuple[float, ...]
    ratios: tuple[float, ...]
    per_sensor: bool

    def total_m(self, entries: Sequence[EffectEntry] = ()) -> float:
        """The total error with effects added; infinite where no budget can hold them."""
        return self._figures(entries)[0]

    def turned(self, entries: Sequence[EffectEntry], more_m: float = 0.0) -> bool:
        """Whether a requirement that is kept without the effects and the addition is not with."""
        return self._broken((), 0.0) < self._broken(entries, more_m)

    def turned_by(self, entries: Sequence[EffectEntry], more_m: float) -> bool:
        """Whether an addition to the total turns a requirement that the effects leave kept."""
        return self._broken(entries, 0.0) < self._broken(entries, more_m)

    def _broken(self, entries: Sequence[EffectEntry], more_m: float) -> int:
        total, ratio = self._figures(entries)
        over = [total + more_m > limit for limit in self.limits_m]
        return sum([*over, *(ratio > limit for limit in self.ratios)])

    def _figures(self, entries: Sequence[EffectEntry]) -> tuple[float, float]:
        if any(registry()[e.effect].unbudgeted(dict(e.parameters)) for e in entries):  # type: ignore[arg-type]
            return np.inf, np.inf
        system = replace(self.system, effects=(*self.system.effects, *entries))
        found = budget(system, known_of(system))
        return (found.total_per_sensor_m if self.per_sensor else found.total_m), found.sync_ratio

    def turns_at(self, entry: EffectEntry, name: str, most: float) -> float:
        """Least value of one parameter, up to `most`, that turns a requirement.

        A root of how far a requirement that is kept without is passed; halved where `most` has no
        error that is finite.
        """
        from scipy.optimize import brentq

        total, ratio = self._figures(())
        limits = [limit if total <= limit else np.inf for limit in self.limits_m]
        ratios = [limit if ratio <= limit else np.inf for limit in self.ratios]

        def past(value: float) -> float:
            total, ratio = self._figures([_with(entry, name, value)])
            return max([total / x - 1.0 for x in limits] + [ratio / x - 1.0 for x in ratios])

        finest = most * 2.0**-HALVINGS
        if math.isfinite(past(most)):
            root, _ = brentq(past, 0.0, most, xtol=0.25 * finest, full_output=True, disp=False)
            return min(float(root) + 0.5 * finest, most)
        low, high = 0.0, most
        while high - low > finest:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if past(middle) > 0.0 else (middle, high)
        return high


def _with(entry: EffectEntry, name: str, value: float) -> EffectEntry:
    values = tuple((key, value if key == name else old) for key, old in entry.parameters)
    return replace(entry, parameters=values)


def promise_of(case: Case) -> SpecPromise | None:
    """The promise of a spec that leaves nothing open."""
    found = sole_design(build_problem(case))
    if found is None:
        return None
    problem, design = found
    design_budget(case, problem, design)
    accuracy, sync = _limits(case, "accuracy"), _limits(case, "sync") or (IMPLIED_SYNC,)
    per_sensor = case.spec.sync_model == "per_sensor"
    return SpecPromise(system_of(case, problem, design), accuracy, sync, per_sensor)


def _limits(case: Case, kind: str) -> tuple[float, ...]:
    return tuple(float(r.limit) for r in case.spec.requirements if r.kind == kind)


def expected_rms_m(data: Data) -> float:
    """RMS of the 3-D error [m] that the spec's own noise makes on the components compared."""
    variance = marginal_variance(data.structure, as_specified(data.structure))
    return float(np.sqrt(np.mean(np.sum(variance * compared(data), axis=1))))


def rms_m(data: Data, error: Array) -> float:
    """RMS of a 3-D error [m] on the components compared."""
    return float(np.sqrt(np.mean(np.sum(np.square(error) * compared(data), axis=1))))


def compared(data: Data) -> Array:
    """Which components (n, 3) of the error the log tells."""
    return np.isfinite(data.view.log.truth_m)


@dataclass(frozen=True, slots=True)
class Weights:
    """Judges what is material on one log."""

    spec_m: float
    promise: SpecPromise | None = None

    def material(self, size_m: float, entry: EffectEntry) -> bool:
        """Whether a finding of this RMS is."""
        if size_m >= SHARE * self.spec_m or self.promise is None or entry.effect not in registry():
            return size_m >= SHARE * self.spec_m
        raised = self.promise.total_m([entry]) > (1.0 + RAISED) * self.promise.total_m()
        return raised or self.promise.turned([entry])

    def left(self, size_m: float, causes: Sequence[EffectEntry]) -> bool:
        """Whether what is left beside the causes is."""
        if size_m > LEFT_SHARE * self.spec_m:
            return True
        return self.promise is not None and self.promise.turned_by(causes, size_m)


def weighed(promise: SpecPromise | None, data: Data) -> Weights:
    """The weights of one log."""
    return Weights(expected_rms_m(data), promise)


def blind_spots(
    promise: SpecPromise | None, seen: Sequence[tuple[EffectEntry, str, float, float]]
) -> Iterator[tuple[EffectEntry, str, float, float]]:
    """(entry, parameter, smallest seen, where it turns a requirement) of what a log may hide.

    seen: entries of zeros, a parameter, the smallest value that the log would have shown, and the
    largest that the effect can have.
    """
    for entry, name, smallest, most in seen if promise else ():
        assert promise is not None
        hidden = min(smallest, most)
        if promise.turned([_with(entry, name, hidden)]):
            yield entry, name, smallest, promise.turns_at(entry, name, hidden)
