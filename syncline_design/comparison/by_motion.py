"""Evidence of a measured log on the limits of its vehicle: speed and turn rate."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.judgement import Judgement
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.limits import Beyond
from syncline_design.diagnosis.result import Check, Diagnosis, MotionQuantiles
from syncline_design.model.figure_text import format_duration, percent, rounded

READ: Final = 0.01  # of a limit that readings may lie beyond it
MOVED: Final = 0.1  # of a limit: a log that stays below it does not show that the limit is kept
_MOTION: Final = {"speed": ("speed", 1.0), "rate": ("turn_rate", math.pi / 180.0)}
CODES: Final = {"speed": "speed", "rate": "turn_rate"}


def by_motion(one: Assumed, found: Diagnosis, sight: Sighted | None, last_stage: str) -> Judgement:
    """Speed or turn rate: a contradiction or caution of the log's checks breaks it, and so does a
    mean over seconds that lies beyond the limit whatever the readings' noise."""
    code = CODES[one.name]
    name, unit = _MOTION[one.name]
    motion = found.log.motion.get(name)
    mean = sight.beyond.get((code, one.stage)) if sight is not None else None
    beyond = _check(found.checks, code, one.stage)
    if beyond is not None:
        if mean is None:
            return Judgement("broken", beyond.message, MeasuredFigure(beyond.value))
        words = f"{beyond.message}; the figure is the largest mean over {_lasting(mean)}"
        return Judgement("broken", words, _of_means(mean))
    if mean is not None and one.value is not None and mean.least > (1.0 + READ) * one.value:
        return _over(one, mean)
    own = motion if one.stage == last_stage else None
    if one.value is None or (own is None and mean is None):
        return Judgement("not_shown", "the log does not tell of it")
    reached, most, figure = _reached(own, mean, unit)
    if reached < MOVED * one.value:
        return Judgement("not_shown", "the log stays far below the limit", figure)
    if most > (1.0 + READ) * one.value:
        words = "the log goes beyond the limit for moments, or its readings scatter that far"
        return Judgement("not_shown", words, figure)
    by_means = "" if mean is None else f", as a mean over {_lasting(mean)}"
    return Judgement("holds", f"the most that the log reaches{by_means}", figure)


def _lasting(mean: Beyond) -> str:
    return format_duration(rounded(mean.over_s, 2))


def _of_means(mean: Beyond) -> MeasuredFigure:
    return MeasuredFigure(mean.most, mean.low, mean.high)


def _reached(
    motion: MotionQuantiles | None, mean: Beyond | None, unit: float
) -> tuple[float, float, MeasuredFigure]:
    """What 95 % of a log stay below, the most of its readings, and the figure with its interval.

    The figure is the largest mean over seconds where there is one: of an earlier stage all three.
    """
    if motion is None:
        assert mean is not None
        return float(np.quantile(mean.means, 0.95)), mean.most, _of_means(mean)
    reached = max(abs(motion.low), abs(motion.high)) * unit
    most = reached if motion.most is None else motion.most * unit
    return reached, most, MeasuredFigure(most) if mean is None else _of_means(mean)


def _over(one: Assumed, mean: Beyond) -> Judgement:
    share = mean.share((1.0 + READ) * (one.value or 0.0))
    words = (f"beyond the limit in {percent(share, 2)} of the log, by means over "
             f"{_lasting(mean)} and more than the readings' noise can do")  # fmt: skip
    return Judgement("broken", words, _of_means(mean))


def _check(checks: Iterable[Check], code: str, stage: str) -> Check | None:
    return next((c for c in checks if (c.code, c.stage) == (code, stage)), None)
