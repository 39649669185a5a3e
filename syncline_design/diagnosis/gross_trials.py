"""What is tried as a gross fault: each with the error of the log once it is undone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from syncline_design.diagnosis.convention import Convention
from syncline_design.diagnosis.conventions import best_conventions
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.mending import Reread, mended, restamped, restamps, undone
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.slips import StampShift, attitude_restamped, best_shifts
from syncline_design.effects import plain_delay, registry
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import ActsOn, Array, Effect
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System

ROWS = 3000
SHORT_SLIP = 2  # a slip this short may be a latency of no whole number of seconds
SHORT_SHIFT_S = 0.5  # a shorter shift of stamps is a latency, to be fitted
MOST_DELAY_S = 0.25  # that a slip may have beside it


@dataclass(frozen=True, slots=True)
class GrossTrial:
    """A gross fault to be tried: the error of the log with it undone, and how to undo it."""

    acting: Acting
    error: Callable[[], Array]
    mend: Callable[[Log], Log]
    sentence: str = ""


def expected_size(view: Scene) -> float:
    """Usual length of the error vector [m] that the spec's noise makes on the log as it is.

    A range in millimetres makes the noise of its bearing a thousand times as large.
    """
    structure = structure_of(view)
    variance = sum(np.einsum("nii->ni", w.covariance) for w in structure.white)
    visible = np.isfinite(view.log.truth_m)
    return float(np.sqrt(np.median(np.sum(variance * visible, axis=1))))


def listed_trials(
    system: System,
    log: Log,
    base: Scene,
    taken: Sequence[tuple[str, str, int]],
    exclude: Sequence[str],
    reread: Reread | None,
) -> list[GrossTrial]:
    """Every listed gross fault with a function that re-simulates the log under it."""
    faults = [e for e in registry().values() if e.undoing is not None and e.name not in exclude]
    return [
        GrossTrial(one, _resimulated(system, base, one), partial(mended, one=one, reread=reread))
        for effect in faults
        for one in _tried(system, log, effect)
        if one.label not in taken
    ]


def searched_trials(
    system: System, log: Log, base: Scene, exclude: Sequence[str]
) -> list[GrossTrial]:
    """The best of all conventions, to be re-simulated."""
    found = []
    effect = _undone_by(by_mending=True)
    for one in best_conventions(system, base.log) if effect.name not in exclude else []:
        acting = convention_acting(one)
        error = partial(error_mended, system, log, base, one.mend)
        found.append(GrossTrial(acting, error, one.mend, one.sentence))
    return found


def convention_acting(one: Convention) -> Acting:
    """A convention that columns follow, as the effect that it is."""
    effect = _undone_by(by_mending=True)
    return Acting(effect, one.sensor, 0, {"convention": one.convention})  # type: ignore[dict-item]


def error_mended(system: System, log: Log, base: Scene, mend: Callable[[Log], Log]) -> Array:
    """The error of a log once mended."""
    left = mend(log)
    thin = left.rows(slice(None, None, max(1, len(left) // ROWS)))
    return scene(system, thin, base.known).error()


def shift_trials(
    system: System, log: Log, base: Scene, exclude: Sequence[str], reread: Reread | None
) -> list[GrossTrial]:
    """The best shifts of stamps."""
    found = []
    for shift in best_shifts(system, log):
        acting = _shift_named(shift)
        if acting.effect.name not in exclude and abs(shift.seconds) > SHORT_SHIFT_S:
            seconds = float(next(iter(acting.values.values())))
            mend = partial(_shifted, sensor=shift.sensor, seconds=seconds, reread=reread)
            found.append(GrossTrial(acting, partial(error_mended, system, log, base, mend), mend))
    return found


def _shift_named(shift: StampShift) -> Acting:
    """Whole seconds are a slip where a sensor can have one, a delay beside it; else a delay."""
    whole = float(round(shift.seconds))
    slip = _undone_by(by_mending=False)
    beside = abs(shift.seconds - whole) <= MOST_DELAY_S and abs(whole) > SHORT_SLIP
    slipped = shift.sensor in slip.sensors and (shift.whole or beside)
    effect = slip if slipped else plain_delay()
    seconds = whole if slipped or shift.whole else shift.seconds
    return Acting(effect, shift.sensor, 0, {effect.parameters[0].name: seconds})


def _undone_by(*, by_mending: bool) -> Effect:
    """The one discrete effect that a log is freed of by mending columns, or by pairing anew."""
    return next(
        one for one in registry().values()
        if one.undoing is not None and (one.undoing.mend is not None) == by_mending
    )  # fmt: skip


def _shifted(log: Log, sensor: ActsOn, seconds: float, reread: Reread | None) -> Log:
    if sensor == "attitude":
        return attitude_restamped(log, seconds)
    return restamped(log, seconds, reread)


def _tried(system: System, log: Log, effect: Effect) -> Iterator[Acting]:
    """A discrete effect with every value, at every sensor that a log of this kind holds."""
    assert effect.undoing is not None
    name = effect.parameters[0].name
    for k, stage in enumerate(system.stages):
        for sensor, values in effect.undoing.tried.items():
            held = log.kind != "position" or sensor != "ranging"
            if held and effect.applies(stage, sensor):
                # a convention's value is its name
                yield from (Acting(effect, sensor, k, {name: v}) for v in values)  # type: ignore[dict-item]


def _resimulated(system: System, base: Scene, one: Acting) -> Callable[[], Array]:
    if restamps(one):
        return lambda: base.error((one,))
    return lambda: scene(system, undone(base.log, one), base.known).error()


def usual_size(error: Array) -> float:
    """Median length of the error vector [m]; components without a truth count as zero."""
    length = np.sqrt(np.nansum(error**2, axis=1))
    return float(np.median(length))
