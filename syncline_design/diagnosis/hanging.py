"""What a log says of a device that hangs: from when to when, how old its reading is, how far off.

The rows are told as they are; whatever an effect of the dictionary makes of them is a word for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Final

import numpy as np

from syncline_design.diagnosis.frozen import Frozen, frozen
from syncline_design.diagnosis.frozen_channels import frozen_channels
from syncline_design.diagnosis.result import Check
from syncline_design.diagnosis.scene import Scene
from syncline_design.model.figure_text import format_estimate

MOST: Final = 3  # times that are told of a device


def hanging_checks(view: Scene) -> Iterator[Check]:
    """One check of every device, or reading of it, that repeats itself while the vehicle moves."""
    whole = frozen(view)
    found = sorted((*whole, *frozen_channels(view, whole)), key=_whose)
    for (index, sensor, reading), each in groupby(found, key=_whose):
        runs = sorted(each, key=lambda one: -float(np.max(one.off_m)))
        stage = view.system.stages[index].name
        rows = sum(one.last - one.first + 1 for one in runs)
        what = f"{reading} of {sensor}" if reading else sensor
        more = f", and {len(runs) - MOST} more times" if len(runs) > MOST else ""
        told = ", ".join(_told(view, one) for one in runs[:MOST])
        message = f"{what} ({stage}) hangs: one reading over and over {told}{more}"
        age_s = max(one.age_s for one in runs)
        yield Check("frozen_readings", stage, "caution", message, age_s, 0.0, "s", rows / len(view))


def _whose(one: Frozen) -> tuple[int, str, str]:
    return one.stage, one.sensor, one.reading


def _told(view: Scene, one: Frozen) -> str:
    first, last = (float(view.log.time_s[k]) for k in (one.first - 1, one.last))
    ends = " to ".join(format_estimate(at, None, "s") for at in (first, last))
    off = format_estimate(float(np.max(one.off_m)), None, "m")
    age = format_estimate(one.age_s, None, "s")
    return f"from {ends}, at last {age} old and {off} off"
