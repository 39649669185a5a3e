"""The diagnosis of a built system: the log in whole, in stretches, and what it leaves open.

What stands out in a stretch is taken out, and the rest is diagnosed anew: a second of faulty rows
would be noise of all of them.  Rows that repeat a reading are taken out before: their delay grows
with every one of them, which no constant fits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.diagnosis.changed_instead import changed_instead
from syncline_design.diagnosis.checks import MEAN_S
from syncline_design.diagnosis.consequence import expected_rms_m
from syncline_design.diagnosis.episodes import without_episodes
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.instead import InItsPlace, in_place
from syncline_design.diagnosis.late_at_random import late_at_random
from syncline_design.diagnosis.late_rows import Late
from syncline_design.diagnosis.late_runs import late_by_turns, late_runs
from syncline_design.diagnosis.limits import Beyond, beyond_limits
from syncline_design.diagnosis.looked_up import Mask
from syncline_design.diagnosis.mending import without_rows
from syncline_design.diagnosis.motion_columns import with_slopes
from syncline_design.diagnosis.noise_split import NoiseFactors, factors, stated_m
from syncline_design.diagnosis.one_course import OneCourse
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.run import told
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.searched import SearchedLog, examined
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.diagnosis.spans import span_of
from syncline_design.diagnosis.stretch_ends import MARGIN_ROWS
from syncline_design.diagnosis.stretches import (
    OtherFit,
    Stands,
    Stretches,
    in_stretches,
    is_inside,
    left_as_one,
    stretches,
)
from syncline_design.diagnosis.swaying import LargestDelay, largest_delays, swaying
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.diagnosis.undone import LeftOpen, left_open
from syncline_design.effects import plain_delay, registry
from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case

ROUNDS: Final = 3  # of taking out what stands out
MOST_TAKEN: Final = 0.6  # of the rows
NO_SCATTER: Final = 0.9  # of the square of rows that one value makes up


@dataclass(frozen=True, slots=True)
class Sighted:
    """A log's diagnosis, less what stands out in stretches, and what else it says.

    taken: the stretches that the diagnosis is without.  factors: noise by `stage/sensor`.
    instead: what several departures together explain as well as one that was found.
    beyond: how far speed and turn rate are beyond their limits, by code and stage.
    ends_s: stamps of the log's first and last row; None: not known.  course: what is left, where
    that is one course that begins and ends.  left_out: share of the rows that it is without.
    stated_m: RMS that the spec's noise of every sensor makes, by `stage/sensor`.
    largest: of sensors whose stamps scatter, the largest delay of a row, by `stage/sensor`.
    """

    found: Diagnosis
    stretches: Stretches = field(default_factory=Stretches)
    open: tuple[LeftOpen, ...] = ()
    factors: Mapping[str, NoiseFactors] = field(default_factory=dict)
    beyond: Mapping[tuple[str, str], Beyond] = field(default_factory=dict)
    taken: tuple[Stands, ...] = ()
    instead: tuple[InItsPlace, ...] = ()
    ends_s: tuple[float, float] | None = None
    course: OneCourse | None = None
    left_out: float = 0.0
    sways: Mapping[str, float] = field(default_factory=dict)
    stated_m: Mapping[str, float] = field(default_factory=dict)
    largest: Mapping[str, LargestDelay] = field(default_factory=dict)

    @property
    def left_in(self) -> tuple[Stands, ...]:
        """What stands out beyond doubt in what was diagnosed: it was too much to be left out."""
        return tuple(s for s in self.stretches.stands if s.sure and s not in self.taken)


def sighted(case: Case, paths: Sequence[Path], settings: DiagnosisSettings) -> Sighted:
    """Raises BadInput for a spec or log that cannot be used."""
    in_force().doing("reading the log")
    with one_thread():
        inputs = measured(case, paths)
        turns, rest = _without_turns(inputs)
        one = examined(rest, settings)
        first = one
        hung, late = _hung(rest, one), _late(rest, one)
        taken = list(_as_stands(inputs, one.data, turns))
        if one.hanging.left_out:
            taken, hung = [*hung, *taken], ()
        held = (*hung, *late)
        seen = Stretches(held) if held else _seen(one)
        for _ in range(ROUNDS + bool(held)):
            sure = [s for s in seen.stands if s.sure]
            less = _less(one.inputs, sure, (1.0 - MOST_TAKEN) * len(inputs.log))
            if less is None:
                break
            taken += sure
            in_force().doing("diagnosing the log without what stands out")
            one = examined(less, settings)
            seen = _seen(one)
        model = one.result.model
        left = left_open(one.data, model, one.search.signatures)
        stands = _apart((*taken, *seen.stands))
        return Sighted(
            told(one, case),
            replace(seen, stands=stands),
            left,
            factors(one.data, model, one.search.unlike or ()),
            beyond_limits(_moving(inputs, first, one, taken)),
            tuple(taken),
            in_place(one.data, model, one.search.signatures),
            inputs.log.ends_s,
            left_as_one(one.data, model, one.search.signatures),
            1.0 - len(one.inputs.log) / len(inputs.log),
            swaying(one.data, model, one.search.signatures, one.search.unlike or ()),
            stated_m(one.data),
            largest_delays(one.data, model),
        )


def _without_turns(inputs: Measured) -> tuple[list[tuple[Late, ...]], Measured]:
    """Rows that are late by turns with the others, or at random, and the log without them: half of
    a log's rows pass for noise and for waves of all sorts, which a search would take long to lay on
    each other.
    """
    view = scene(inputs.system, inputs.log, inputs.known)
    held = np.zeros(len(view), bool)
    found = late_by_turns(view, held) or late_at_random(view, held)
    if not found:
        return [], inputs
    rows = np.isin(np.arange(len(view)), found[0].rows)
    return [found], replace(inputs, log=without_rows(inputs.log, rows), reread=None)


def _moving(
    inputs: Measured, first: SearchedLog, last: SearchedLog, taken: Sequence[Stands]
) -> Scene:
    """The log by whose motion its limits are judged.

    Columns of motion that contradict the poses for what was taken out alone are borne out by the
    rest.  Slopes of poses are none of the vehicle's beside rows that are no poses of that time: a
    receiver that hung jumps on its return.
    """
    if first.faults or not taken:
        return first.data.view
    log = with_slopes(inputs.log, last.replaced)
    derived = any(s.follows_position or s.follows_reference for s in log.stages)
    if derived or last.replaced:
        over_s = max(MEAN_S.values())
        wide = [replace(one, margin_s=one.margin_s + over_s) for one in taken]
        out = _rows_of(log.time_s, wide)
        log = without_rows(log, out) if any(one.stamps_s for one in taken) else log.rows(~out)
    return scene(inputs.system, log, inputs.known)


def _late(inputs: Measured, one: SearchedLog) -> tuple[Stands, ...]:
    """Rows that are late by more than their motion can be carried on, beside those that hang."""
    if one.faults:  # what is grossly wrong with all rows is undone in none of these
        return ()
    view = scene(inputs.system, inputs.log, inputs.known)
    held = np.zeros(len(view), bool)
    for each in one.hanging.found:
        held[each.first : each.last + 1] = True
    return tuple(_as_stands(inputs, one.data, late_runs(view, held)))


def _as_stands(inputs: Measured, data: Data, late: Sequence[tuple[Late, ...]]) -> Iterator[Stands]:
    """Delays for a while that readings of other rows show, with what is the same delay."""
    time_s, delay = inputs.log.time_s, plain_delay()
    usual_m = max(expected_rms_m(data), 1e-300)
    stage, names = inputs.system.stages[0].name, (delay.parameters[0].name,)
    for first, *others in late:
        fits = tuple(
            OtherFit((delay.name, each.sensor, 0), stage, names, (each.delay_s,), (each.spread_s,))
            for each in others
        )
        share = math.sqrt(float(np.sum(first.off_m**2)) / len(time_s)) / usual_m
        stamps_s = time_s[first.rows]
        yield Stands(
            (delay.name, first.sensor, 0), stage, float(stamps_s[0]), float(stamps_s[-1]), names,
            (first.delay_s,), (first.spread_s,), -math.inf, True, fits,
            inside=is_inside(float(stamps_s[0]), float(stamps_s[-1]), inputs.log.ends_s),
            margin_s=0.0 if first.single else MARGIN_ROWS * inputs.log.interval_s, share=share,
            explained=1.0, ends=first.ends_s,
            stamps_s=tuple(map(float, stamps_s)) if first.single else (), of_log=first.of_log,
        )  # fmt: skip


def _hung(inputs: Measured, one: SearchedLog) -> tuple[Stands, ...]:
    """Rows of a log that repeat a reading while the vehicle moves on, as delays by their age."""
    time_s, delay = inputs.log.time_s, plain_delay()
    usual_m = max(expected_rms_m(one.data), 1e-300)
    return tuple(
        Stands(
            (delay.name, each.sensor, each.stage), inputs.system.stages[each.stage].name,
            float(time_s[each.first]), float(time_s[each.last]), (delay.parameters[0].name,),
            (each.age_s,), (0.0,), -math.inf, True, inside=True, frozen=True, reading=each.reading,
            share=math.sqrt(float(np.sum(each.off_m**2)) / len(time_s)) / usual_m,
        )
        for each in one.hanging.found
    )  # fmt: skip


def _seen(one: SearchedLog) -> Stretches:
    in_force().doing("looking at stretches of the log")
    lasting = _built_in_undone(one)
    rivals = in_stretches(one.search.proposals.signatures)
    undone = changed_instead(one.data, lasting, rivals)
    model = undone.model
    free = one.search.proposals.free_signatures(model)
    seed = one.search.settings.seed
    found = stretches(one.data, model, free, seed, undone.hits, rivals)
    spans = [(each.from_s, each.to_s) for each in one.search.episodes or ()]
    if not spans:
        return found
    usual = without_episodes(one.data)
    as_usual = stretches(usual, model, free, seed, rivals=rivals).stands
    loud = [s for s in as_usual if _is_one_value(s) and any(_meet(s, *span) for span in spans)]
    rest = [s for s in found.stands if not any(_meet(s, each.from_s, each.to_s) for each in loud)]
    return replace(found, stands=(*loud, *rest))


def _apart(stands: tuple[Stands, ...]) -> tuple[Stands, ...]:
    """All but what is built in and lies within a while in which something came and went.

    Where a window of a delay looked like a turn, and was left out, the rest of it is that delay.
    """
    goes = [s for s in stands if s.sure and registry()[s.label[0]].passing and not s.stamps_s]
    return tuple(
        s for s in stands
        if s in goes or not s.inside
        or not any(each.from_s <= s.from_s and s.to_s <= each.to_s for each in goes)
    )  # fmt: skip


def _is_one_value(s: Stands) -> bool:
    """Whether one value of what comes and goes makes up what an episode of noise was named for.

    Rows that scatter are no multiple of what a delay does to them.
    """
    passing = registry()[s.label[0]].passing
    return s.sure and passing and not s.others and not s.noise_of and s.explained > NO_SCATTER


def _meet(s: Stands, from_s: float, to_s: float) -> bool:
    return s.from_s <= to_s and from_s <= s.to_s


def _built_in_undone(one: SearchedLog) -> Model:
    """The model without what is built in and acts in a part of the log, by the search.

    It is one stretch there, and may span two of them and what lies between.
    """
    model = one.result.model
    kept = tuple(a for a in model.acting if span_of(a.effect) is None or a.effect.passing)
    if len(kept) == len(model.acting):
        return model
    return replace(model, acting=kept, error=one.data.error(kept))


def _less(inputs: Measured, taken: Sequence[Stands], least: float) -> Measured | None:
    """The log without some stretches; None where that is nothing, or leaves too few rows."""
    inside = _rows_of(inputs.log.time_s, taken)
    if not np.any(inside) or np.sum(~inside) < least:
        return None
    return replace(inputs, log=without_rows(inputs.log, inside), reread=None)


def _rows_of(time_s: Array, taken: Sequence[Stands]) -> Mask:
    """Rows in which something stands out, and those by which its ends may be off."""
    inside = np.zeros(len(time_s), bool)
    for one in taken:
        within = (time_s >= one.from_s - one.margin_s) & (time_s <= one.to_s + one.margin_s)
        inside |= np.isin(time_s, one.stamps_s) if one.stamps_s else within
    return inside
