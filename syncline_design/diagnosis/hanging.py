"""What a log says of a device that hangs: from when to when, how old its reading is, how far off.

The rows are told as they are; whatever an effect of the dictionary makes of them is a word for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

import numpy as np

from syncline_design.diagnosis.frozen import Frozen, LogOfSystem, frozen
from syncline_design.diagnosis.frozen_channels import frozen_channels
from syncline_design.diagnosis.result import Check
from syncline_design.model.figure_text import format_estimate

MOST: Final = 3  # times that are told of a device


def hanging(view: LogOfSystem) -> tuple[Frozen, ...]:
    """All runs of rows in which a device, or one reading of it, repeats itself in motion."""
    whole = frozen(view)
    return (*whole, *frozen_channels(view, whole))


def hanging_checks(
    view: LogOfSystem, found: Sequence[Frozen], *, left_out: bool = False
) -> Iterator[Check]:
    """One check of every device, or reading of it, that hangs; left_out: whether its rows are."""
    for (index, _, _), each in groupby(sorted(found, key=_whose), key=_whose):
        runs = sorted(each, key=lambda one: -float(np.max(one.off_m)))
        stage = view.system.stages[index].name
        rows = sum(one.last - one.first + 1 for one in runs)
        more = f", and {len(runs) - MOST} more times" if len(runs) > MOST else ""
        told = ", ".join(_told(view, one) for one in runs[:MOST])
        message = f"{what_hangs(runs[0])} ({stage}) hangs: one reading over and over {told}{more}"
        message += f"; the {rows} rows in which it does are left out" if left_out else ""
        age_s = max(one.age_s for one in runs)
        yield Check(
            "frozen_readings", stage, "caution", message, age_s, 0.0, "s", rows / len(view.log)
        )


def what_hangs(one: Frozen) -> str:
    """`position`, or `yaw of attitude` where the sensor's other readings go on."""
    return f"{one.reading} of {one.sensor}" if one.reading else one.sensor


def _whose(one: Frozen) -> tuple[int, str, str]:
    return one.stage, one.sensor, one.reading


def _told(view: LogOfSystem, one: Frozen) -> str:
    first, last = (float(view.log.time_s[k]) for k in (one.first - 1, one.last))
    ends = " to ".join(format_estimate(at, None, "s") for at in (first, last))
    off = format_estimate(float(np.max(one.off_m)), None, "m")
    age = format_estimate(one.age_s, None, "s")
    return f"from {ends}, at last {age} old and {off} off"
