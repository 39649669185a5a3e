"""Gross faults first: frames, units, signs, whole-second slips.

They are discrete, so each is tried on the whole log by re-simulation; it is taken when the usual
size of the error falls to a third or less and was far from noise before.  Beside the usual ones all
axes, units, zeros and shifts of stamps are searched (`conventions`, `slips`); such a one has to
bring the error down to a tenth, or to a third where nothing but noise is left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.borne_out import borne_out
from syncline_design.diagnosis.conventions import is_of_unit
from syncline_design.diagnosis.gross_trials import (
    ROWS,
    SHORT_SLIP,
    GrossTrial,
    convention_acting,
    expected_size,
    listed_trials,
    searched_trials,
    shift_trials,
    usual_size,
)
from syncline_design.diagnosis.mending import Reread, restamps, value_of
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.velocity_alike import with_velocity_alike
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Effect
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System

FALLS_TO = 1.0 / 3.0
FAR_FROM_NOISE = 4.0  # times the expected size
MOST = 3  # gross faults at once
HUGE = 40.0  # times the expected size, from which two faults at once are looked for
NO_WORSE = 1.1  # times the error, that the first of them may leave
BEAM = 8  # first faults behind which another one is looked for
WHOLE_S = 0.002  # a latency this near to whole seconds is a slip between time scales
SEARCHED_TO = 0.1  # what is searched so widely has to help so much
FAR_BETTER = 0.5  # of the error of the best fault of the list
MEMORY_SHARES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0)  # time constants over the shift of stamps
NEARLY_FREE = 2.0  # times the expected size: what nearly nothing but noise leaves
SAME = 1.0 + 1e-9  # times the least error: as little
NEARLY_NOISE = 1.05  # times the expected size: what is left after a short slip has to be so little


@dataclass(frozen=True, slots=True)
class Gross:
    """A gross fault found: the acting effect, and the log with it undone where it is a column's."""

    acting: Acting
    falls_by: float  # usual size of the error before over after
    spread: float | None = None  # standard uncertainty of its parameter
    readings: str = ""  # of the sensor's, those that it acts on alone
    sentence: str = ""  # for people, where the effect's own says it worse
    velocity_alike: bool = False  # the velocity columns followed it as well
    witness: str = ""  # what of the log's motion bears it out, where its error alone could not


def gross_faults(
    system: System,
    log: Log,
    known: Sequence[Acting],
    exclude: Sequence[str] = (),
    reread: Reread | None = None,
) -> tuple[tuple[Gross, ...], Log]:
    """Gross faults of a log, and the log with them undone.

    reread: gives the log anew with the positions' stamps set back by so many seconds; None where
    one file holds it.
    """
    look = _Looking(system, known, exclude, reread)
    found, left, over = look.down(log)
    if over > FAR_FROM_NOISE and look.over(log) > HUGE:
        return look.pair(log) or (found, left)
    return found, left


@dataclass(frozen=True, slots=True)
class _Looking:
    """What gross faults are looked for with; see `gross_faults`."""

    system: System
    known: Sequence[Acting]
    exclude: Sequence[str]
    reread: Reread | None

    def base(self, log: Log) -> Scene:
        """The log on some of its rows beside the system."""
        thin = log.rows(slice(None, None, max(1, len(log) // ROWS)))
        return scene(self.system, thin, self.known)

    def over(self, log: Log) -> float:
        """The usual error of a log over what the spec's noise makes."""
        base = self.base(log)
        return usual_size(base.error()) / max(expected_size(base), 1e-300)

    def down(self, log: Log, first: Sequence[Gross] = ()) -> tuple[tuple[Gross, ...], Log, float]:
        """The best fault, one after the other; the log without them, its error over its noise."""
        found = list(first)
        while True:
            base = self.base(log)
            size, expected_m = usual_size(base.error()), expected_size(base)
            best, taken = None, [g.acting for g in found]
            if len(found) < MOST and size > FAR_FROM_NOISE * expected_m:
                best = self._best_of(log, base, (size, expected_m), taken)
            if len(found) < MOST and best is None:
                best = self._borne_out(log, base, taken)
            if best is None:
                return tuple(found), log, size / max(expected_m, 1e-300)
            one, log = _undo(log, best, size)
            found.append(one)

    def _best_of(
        self,
        log: Log,
        base: Scene,
        sizes_m: tuple[float, float],
        taken: Sequence[Acting],
    ) -> _Tried | None:
        """The fault that helps most, if one helps enough; sizes of the error and of its noise."""
        size, expected_m = sizes_m
        listed = _best(self._listed(log, base, [one.label for one in taken]))
        if not _clear(listed, size, expected_m):
            listed = None
        searched = searched_trials(self.system, log, base, self.exclude)
        wide = _best([t for t in searched if not _again(t.acting, taken)])
        shift = _best(shift_trials(self.system, log, base, self.exclude, self.reread))
        if wide is not None and not _far_down(wide.size_m, size, expected_m):
            wide = None
        if not _clear(shift, size, expected_m):
            shift = None
        listed, shift = (_unless_smoothed(one, base, self.exclude) for one in (listed, shift))
        best = _preferred(_preferred(listed, shift), wide)
        return None if best is None or NO_WORSE * _arm_leaves(base) < best.size_m else best

    def _borne_out(self, log: Log, base: Scene, taken: Sequence[Acting]) -> _Tried | None:
        """What is too small beside the noise to be searched for, but shows in the motion too."""
        found = borne_out(self.system, log, base)
        if found is None:
            return None
        one = found.convention
        acting = convention_acting(one)
        if acting.effect.name in self.exclude or _again(acting, taken):
            return None
        return _Tried(acting, one.mend, found.size_m, one.sentence, found.witness)

    def _listed(
        self, log: Log, base: Scene, taken: Sequence[tuple[str, str, int]]
    ) -> list[GrossTrial]:
        return listed_trials(self.system, log, base, taken, self.exclude, self.reread)

    def pair(self, log: Log) -> tuple[tuple[Gross, ...], Log] | None:
        """Faults of which the first helps little alone, where all together leave nothing but noise.

        What leaves least alone is undone, and what is best then is looked for behind it.
        """
        base = self.base(log)
        if _arm_leaves(base) < NEARLY_FREE * expected_size(base):
            return None
        size = usual_size(base.error())
        trials = [
            *self._listed(log, base, ()),
            *searched_trials(self.system, log, base, self.exclude),
        ]
        tried = sorted((_tried_out(t) for t in trials), key=lambda one: one.size_m)
        for one in [t for t in tried[:BEAM] if t.size_m < NO_WORSE * size]:
            first, rest = _undo(log, one, size)
            found, left, over = self.down(rest, (first,))
            if len(found) > 1 and over < NEARLY_FREE:
                return found, left
        return None


def _arm_leaves(base: Scene) -> float:
    """The usual error of a position log [m] with the best arm; of others none is tried."""
    rotation, error = base.rows[0].rotation, base.error()
    known = np.all(np.isfinite(error), axis=1)
    if base.log.kind != "position" or not np.any(known):
        return math.inf
    arm_m = np.median(rotate(np.swapaxes(rotation[known], 1, 2), error[known]), axis=0)
    return usual_size(error - rotate(rotation, arm_m))


def _unless_smoothed(tried: _Tried | None, base: Scene, exclude: Sequence[str]) -> _Tried | None:
    """A shift of the positions' stamps, unless a memory of about as long fits far better.

    Positions that a filter of some seconds smooths are late by as much, and by more than that.
    """
    if tried is None or tried.acting.sensor != "position" or not _is_shift(tried.acting):
        return tried
    around_s = abs(float(value_of(tried.acting)))
    sizes = [
        usual_size(base.error((Acting(effect, "position", 0, {effect.memory: share * around_s}),)))
        for effect in registry().values()
        if effect.memory and effect.name not in exclude and "position" in effect.sensors
        for share in MEMORY_SHARES
        if effect.parameters[0].holds(share * around_s)
    ]
    return None if sizes and min(sizes) < FAR_BETTER * tried.size_m else tried


def _is_shift(one: Acting) -> bool:
    """Whether it moves stamps, by whole seconds or not."""
    return restamps(one) or one.effect.undoing is None


def _far_down(left_m: float, size_m: float, expected_m: float) -> bool:
    """Whether one of so many conventions helps enough: to a tenth, or to a third and noise."""
    return left_m < SEARCHED_TO * size_m or left_m < min(
        FALLS_TO * size_m, NEARLY_FREE * expected_m
    )


def _preferred(listed: _Tried | None, wide: _Tried | None) -> _Tried | None:
    """A fault of the list, unless the wide search has found a far better one."""
    if listed is None or wide is None:
        return listed or wide
    return wide if wide.size_m < FAR_BETTER * listed.size_m else listed


def _clear(best: _Tried | None, size_m: float, expected_m: float) -> bool:
    if best is None or not best.size_m < FALLS_TO * size_m:
        return False
    if restamps(best.acting):
        return not _is_short_slip(best.acting) or best.size_m < NEARLY_NOISE * expected_m
    short = best.acting.effect.undoing is None and abs(float(value_of(best.acting))) <= SHORT_SLIP
    return not short or best.size_m < NEARLY_FREE * expected_m


def _best(trials: Sequence[GrossTrial]) -> _Tried | None:
    """The trial of least error, the first of equals: some differ by rounding alone."""
    tried = [_tried_out(t) for t in trials]
    least = min((one.size_m for one in tried), default=0.0)
    return next((one for one in tried if one.size_m <= SAME * least), None)


def _again(one: Acting, taken: Sequence[Acting]) -> bool:
    """Whether a convention was undone already, or another unit of the same column."""
    value = str(value_of(one))
    before = [str(value_of(other)) for other in taken if other.label == one.label]
    return value in before or (is_of_unit(value) and any(map(is_of_unit, before)))


def _tried_out(trial: GrossTrial) -> _Tried:
    return _Tried(trial.acting, trial.mend, usual_size(trial.error()), trial.sentence)


def _is_short_slip(one: Acting) -> bool:
    return restamps(one) and abs(float(value_of(one))) <= SHORT_SLIP


def whole_seconds(found: Acting, uncertainty: float) -> Acting | None:
    """The slip that a position latency of whole seconds is: two time scales, in practice."""
    slip = _instead_of(found)
    if slip is None:
        return None
    value = float(value_of(found))
    whole = float(round(value))
    if not whole or not abs(value - whole) < max(3.0 * uncertainty, WHOLE_S):
        return None
    return Acting(slip, found.sensor, found.stage, {slip.parameters[0].name: whole})


def _instead_of(found: Acting) -> Effect | None:
    """The discrete effect that a fitted one is at some of its values."""
    for effect in registry().values():
        undoing = effect.undoing
        named = undoing is not None and undoing.instead_of == found.effect.name
        if undoing is not None and named and found.sensor in undoing.tried:
            return effect
    return None


@dataclass(frozen=True, slots=True)
class _Tried:
    """A trial made: the usual error of the log with the fault undone."""

    acting: Acting
    mend: Callable[[Log], Log]
    size_m: float
    sentence: str = ""
    witness: str = ""


def _undo(log: Log, best: _Tried, size_m: float) -> tuple[Gross, Log]:
    """A fault of a log with so large a usual error, and the log without it."""
    falls_by = size_m / max(best.size_m, 1e-300)
    left = best.mend(log)
    alike = with_velocity_alike(log, left)
    found = Gross(best.acting, falls_by, sentence=best.sentence, witness=best.witness)
    return replace(found, velocity_alike=alike is not None), alike or left
