"""A log without the rows in which a device hangs.

An ever older reading is no noise and no one value of anything: whatever a fit makes of it is wrong,
and what it makes of the rows beside it as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.frozen import Frozen, summed
from syncline_design.diagnosis.frozen_channels import euler_rates
from syncline_design.diagnosis.gross import gross_faults
from syncline_design.diagnosis.hanging import hanging, hanging_checks, what_hangs
from syncline_design.diagnosis.mending import without_rows
from syncline_design.diagnosis.result import Check
from syncline_design.diagnosis.system import Measured
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass

MOST_LEFT_OUT: Final = 0.6  # of the rows
_HARDLY: Final = 0.1  # of what turn rates say


@dataclass(frozen=True, slots=True)
class Hanging:
    """Where devices of a log hang, and what is said of it.

    left_out: whether the log is without these rows; not where they are nearly all of it.
    size_m: RMS that these readings are off, over the whole log.
    """

    found: tuple[Frozen, ...] = ()
    checks: tuple[Check, ...] = ()
    left_out: bool = False
    size_m: float = 0.0


def without_hanging(inputs: Measured, exclude: Sequence[str] = ()) -> tuple[Measured, Hanging]:
    """The log without the rows in which a device hangs, counted among those that are left out.

    exclude: effects that no fault is laid on.
    """
    found = _hanging(inputs, exclude)
    if not found:
        return inputs, Hanging()
    log = _without(inputs, found)
    left_out = len(log) < len(inputs.log)
    checks = tuple(hanging_checks(inputs, found, left_out=left_out))
    if not left_out:
        return inputs, Hanging(found, checks)
    read = inputs.reread

    def reread(seconds: float) -> Log:
        assert read is not None
        again = replace(inputs, log=read(seconds))
        return _without(again, _hanging(again, exclude))

    less = replace(inputs, log=log, reread=None if read is None else reread)
    squares = sum(float(np.sum(one.off_m**2)) for one in found)
    return less, Hanging(found, checks, left_out, math.sqrt(squares / len(inputs.log)))


def _hanging(inputs: Measured, exclude: Sequence[str]) -> tuple[Frozen, ...]:
    """Runs in which a device hangs whatever is grossly wrong with all of the log.

    Columns in a unit in which they hardly move (radians for degrees) rest all of the time, and one
    of them that hangs does not stand out; in their own they follow the course, and what hangs does
    not.
    """
    found = hanging(inputs)
    if not found and not _hardly_turns(inputs):
        return ()
    faults, log = gross_faults(inputs.system, inputs.log, inputs.known, exclude, inputs.reread)
    if not faults:
        return found
    undone = hanging(replace(inputs, log=log))
    seen = [_rows_of(one, log, inputs.log) for one in undone]
    kept = tuple(one for one in found if any(_meets(one, other) for other in seen))
    return (*kept, *(new for new in seen if not any(_meets(one, new) for one in kept)))


def _hardly_turns(inputs: Measured) -> bool:
    """Whether an angle goes over a small part of what its turn rates say."""
    for logged in inputs.log.stages:
        told = np.ptp(np.unwrap(logged.euler_rad, axis=0), axis=0)
        asked = np.ptp(summed(inputs.log.time_s, euler_rates(logged)), axis=0)
        if bool(np.any(told < _HARDLY * asked)):
            return True
    return False


def _rows_of(one: Frozen, own: Log, log: Log) -> Frozen:
    """The same run in the rows of a log that is stamped or sampled otherwise."""
    at = np.arange(one.first, one.last + 1)
    if len(own) == len(log):
        return one
    first, last = np.searchsorted(log.time_s, own.time_s[[one.first, one.last]])
    last = min(max(int(last), int(first)), len(log) - 1)
    rows = np.arange(min(int(first), last), last + 1)
    off_m = np.interp(log.time_s[rows], own.time_s[at], one.off_m)
    return replace(one, first=int(rows[0]), last=last, off_m=off_m)


def _meets(one: Frozen, other: Frozen) -> bool:
    within = one.first <= other.last and other.first <= one.last
    return (one.stage, one.sensor) == (other.stage, other.sensor) and within


def _without(inputs: Measured, found: Sequence[Frozen]) -> Log:
    """The log as it is where hardly anything else is left."""
    log = inputs.log
    hangs, rejected = np.zeros(len(log), bool), dict(log.rejected)
    for one in found:
        rows = np.arange(one.first, one.last + 1)
        reason = f"{what_hangs(one)} of {inputs.system.stages[one.stage].name} hangs"
        new = int(np.sum(~hangs[rows]))
        rejected |= {reason: rejected.get(reason, 0) + new} if new else {}
        hangs[rows] = True
    if np.sum(hangs) > MOST_LEFT_OUT * len(log):
        return log
    return replace(without_rows(log, hangs), rejected=rejected)
