"""Evidence of a measured log: what its diagnosis says of each assumption."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.judgement import Judgement
from syncline_design.diagnosis.result import Check, Diagnosis, Estimate, Finding
from syncline_design.effects import registry
from syncline_design.machine.sentences import sentence_list

MOVED: Final = 0.1  # of a limit: a log that stays below it does not show that the limit is kept
_MOTION: Final = {"speed": ("speed", 1.0), "rate": ("turn_rate", math.pi / 180.0)}
_CODES: Final = {"speed": "speed", "rate": "turn_rate"}


def by_log(one: Assumed, found: Diagnosis, *, last_stage: str, has_clock: bool) -> Judgement:
    """What the diagnosis says of one assumption.

    has_clock: whether the stage's clock is an assumption of its own; else what drifts breaks the
    timing of the sensor.
    """
    if one.name in _CODES:
        return _of_platform(one, found, last_stage)
    own = [f for f in found.findings if _is_of(f.effect, f.sensor, f.stage, one, has_clock)]
    breaking = [f for f in own if f.material and f.kind != "stand_in"]
    if breaking:
        return _broken(one, breaking)
    doubt = _doubt(one, found, has_clock)
    if doubt:
        return Judgement("not_shown", doubt)
    if own:
        return _immaterial(one, own)
    return _nothing_found(one, found, has_clock)


def _is_of(effect: str, sensor: str, stage: str, one: Assumed, has_clock: bool) -> bool:
    """Whether an effect of a stage's sensor would break this assumption."""
    if stage != one.stage:
        return False
    breaks = registry()[effect].breaks
    if breaks == "clock":
        return one.name == "clock" if has_clock else (one.name, one.role) == ("timing", sensor)
    return (breaks, sensor) == (one.name, one.role)


def _broken(one: Assumed, breaking: Sequence[Finding]) -> Judgement:
    """By the largest departure; all of them are said, with what the log cannot tell them from."""
    first = max(breaking, key=lambda f: f.size_m or 0.0)
    words = "; ".join(_said(f) for f in breaking)
    return Judgement("broken", words, _figure(one, first))


def _said(finding: Finding) -> str:
    others = [f"{a.effect} ({a.sensor})" for a in finding.aliases]
    rivals = f" (or {' or '.join(others)}: this log cannot tell)" if others else ""
    return finding.sentence + rivals


def _immaterial(one: Assumed, own: Sequence[Finding]) -> Judgement:
    first = max(own, key=lambda f: f.size_m or 0.0)
    words = "; ".join(f.sentence for f in own)
    return Judgement("holds", f"immaterial: {words}", _figure(one, first))


def _figure(one: Assumed, finding: Finding) -> MeasuredFigure | None:
    """A finding's size with its interval; of several components, of their root sum of squares.

    None where the parameters are not in the assumption's unit.
    """
    parts = [p for p in finding.parameters.values() if _fits(p, one.unit)]
    values = [float(p.value) for p in parts]
    if not parts or len(parts) < len(finding.parameters):
        return None
    if len(values) == 1:
        low, high = parts[0].interval95 or (None, None)
        return MeasuredFigure(values[0], low, high)
    ends = [p.interval95 for p in parts]
    if any(end is None for end in ends):
        return MeasuredFigure(math.hypot(*values))
    spans = [end for end in ends if end is not None]
    least = math.hypot(*(0.0 if a <= 0.0 <= b else min(abs(a), abs(b)) for a, b in spans))
    most = math.hypot(*(max(abs(a), abs(b)) for a, b in spans))
    return MeasuredFigure(math.hypot(*values), least, most)


def _fits(part: Estimate, unit: str) -> bool:
    return not isinstance(part.value, str) and part.unit == ("" if unit == "1" else unit)


def _doubt(one: Assumed, found: Diagnosis, has_clock: bool) -> str:
    """Why the absence of a finding says nothing here; "" where it does."""
    if not found.sound:
        first = next(c for c in found.checks if c.severity == "contradiction")
        return f"the log contradicts itself or the spec: {first.message}"
    if found.verdict == "unexplained":
        return "the log disagrees with the spec and the cause has no name: nothing is shown"
    for finding in found.findings:
        rivals = [a for a in finding.aliases if _is_of(a.effect, a.sensor, a.stage, one, has_clock)]
        if finding.material and rivals:
            return f"this log cannot tell it from what was found: {finding.sentence}"
    return ""


def _nothing_found(one: Assumed, found: Diagnosis, has_clock: bool) -> Judgement:
    """Holds where the log would have shown whatever turns the verdict."""
    if one.name in ("timing", "clock"):
        return Judgement("not_shown", "a log of places alone does not show a bound of stamps")
    blind = [
        b for b in found.informative.blind_to if _is_of(b.effect, b.sensor, b.stage, one, has_clock)
    ]
    if blind:
        names = sentence_list(sorted({b.effect for b in blind}))
        return Judgement("not_shown", f"this log could hide what turns the verdict: {names}")
    if one.name == "noise":
        return _noise(one, found)
    seen = list(_seen(one, found, has_clock))
    if not seen:
        return Judgement("not_shown", "this log cannot show it")
    most = max(seen)
    return Judgement("holds", "not found, and this log would have shown what turns the verdict",
                     MeasuredFigure(0.0, -most, most))  # fmt: skip


def _seen(one: Assumed, found: Diagnosis, has_clock: bool) -> Iterator[float]:
    """Smallest sizes that the log would have shown, of parameters in the assumption's unit."""
    for shown in found.smallest_seen:
        if not _is_of(shown.effect, shown.sensor, shown.stage, one, has_clock):
            continue
        units = {p.name: p.unit for p in registry()[shown.effect].parameters}
        if shown.value is not None and units[shown.parameter] == one.unit:
            yield shown.value


def _noise(one: Assumed, found: Diagnosis) -> Judgement:
    """The standard deviation that was found, white and slow together, over the spec's."""
    key = f"{one.stage}/{one.role}"
    white = found.noise.white_factor.get(key)
    if white is None:
        return Judgement("not_shown", "this log does not show this sensor's noise")
    slow = found.noise.slow.get(key)
    share = max(slow.variance_over_spec) if slow is not None else 0.0
    factor = math.sqrt(white**2 + share)
    return Judgement("holds", f"{factor:.3g} times the spec's figure, nothing material beyond it",
                     MeasuredFigure(factor))  # fmt: skip


def _of_platform(one: Assumed, found: Diagnosis, last_stage: str) -> Judgement:
    """Speed or turn rate: a contradiction or caution of the log's checks breaks it."""
    beyond = _check(found.checks, _CODES[one.name], one.stage)
    if beyond is not None:
        return Judgement("broken", beyond.message, MeasuredFigure(beyond.value))
    name, unit = _MOTION[one.name]
    motion = found.log.motion.get(name)
    if motion is None or one.stage != last_stage or one.value is None:
        return Judgement("not_shown", "the log does not tell of it")
    reached = max(abs(motion.low), abs(motion.high)) * unit
    most = reached if motion.most is None else motion.most * unit
    if reached < MOVED * one.value:
        return Judgement("not_shown", "the log stays far below the limit", MeasuredFigure(most))
    if most > one.value:
        words = "the log goes beyond the limit for moments, or its readings scatter that far"
        return Judgement("not_shown", words, MeasuredFigure(most))
    return Judgement("holds", "the most that the log reaches", MeasuredFigure(most))


def _check(checks: Iterable[Check], code: str, stage: str) -> Check | None:
    return next((c for c in checks if (c.code, c.stage) == (code, stage)), None)
