"""What stamps that run away or step make of a sensor's delay.

A clock that stamps a sensor's data and drifts by r puts their stamps r (t - t0) ahead, a step of s
by s from then on: the data are older than their stamps by as much, which is a delay as long as it
acts, though the assumption it breaks first is that of the stamps or of the clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.departing import Departing, amount, of_finding
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.result import Diagnosis, Estimate, Finding
from syncline_design.effects import registry
from syncline_design.machine.quick_dataclass import dataclass

OF_STAMPS: Final = ("timing", "clock")  # promises whose effects move the stamps themselves
LASTING: Final = "latency_s"  # parameter of the effect that is a constant delay


@dataclass(frozen=True, slots=True)
class StampDelay:
    """The largest delay that one finding of stamps made on this log [s]; None: it says no size."""

    finding: Finding
    delay: MeasuredFigure | None


def shifts(one: Assumed, found: Diagnosis) -> list[StampDelay]:
    """Findings that move a sensor's stamps by what is no scatter; of `latency` rows alone."""
    if one.name != "latency":
        return []
    own = [f for f in found.findings if f.stage == one.stage and _moves(f)]
    whose = [f for f in own if one.role in (f.sensor, *(f.also or ()))]
    return [StampDelay(f, _delay(of_finding(f), found.log.duration_s)) for f in whose]


def _moves(finding: Finding) -> bool:
    return finding.kind != "stand_in" and _moves_stamps(finding.effect)


def _moves_stamps(name: str) -> bool:
    effect = registry()[name]
    return effect.breaks in OF_STAMPS and effect.sensitivity is not None  # not jitter: mean zero


def delay_made(one: Assumed, part: Departing, duration_s: float) -> MeasuredFigure | None:
    """The largest delay that a departure of stamps makes of a sensor's on a log; None: none."""
    own = one.name == "latency" and one.stage == part.stage and one.role in part.sensors
    return _delay(part, duration_s) if own and _moves_stamps(part.effect) else None


def delay_turns(one: Assumed, delay: MeasuredFigure, paper: OnPaper) -> bool:
    """Whether a delay of a sensor turns the verdict."""
    constant = next(
        e.name for e in registry().values() if any(p.name == LASTING for p in e.parameters)
    )
    value = delay.value
    return value is not None and paper.turned(constant, one.role, one.stage, {LASTING: value})


def _delay(departing: Departing, duration_s: float) -> MeasuredFigure | None:
    """stamp = true + rate (t - t0), or + step: the data are as much older than their stamps."""
    for name, lasts in (("rate", duration_s), ("step_s", 1.0)):
        part = departing.parameters.get(name)
        if part is not None:
            return _scaled(part, lasts)
    return None


def _scaled(part: Estimate, times: float) -> MeasuredFigure:
    low, high = part.interval95 or (None, None)
    ends = sorted(times * float(end) for end in (low, high) if end is not None)
    return MeasuredFigure(times * float(part.value), *(ends if len(ends) == 2 else (None, None)))


def by_shifts(one: Assumed, moved: Sequence[StampDelay], paper: OnPaper) -> Judgement | None:
    """Broken by a delay that turns the verdict; not shown beside other material faults of stamps.

    None where no stamps were found to run away or step, or that does not matter to the delay.
    """
    said = [j for each in moved if (j := _judged(one, each, paper)) is not None]
    return next((j for j in said if j.status == "broken"), said[0] if said else None)


def _judged(one: Assumed, shift: StampDelay, paper: OnPaper) -> Judgement | None:
    finding, delay = shift.finding, shift.delay
    if delay is not None and delay.value is not None:
        words = (f"{finding.sentence}: on this log that is a delay of up to "
                 f"{amount(delay.value, 's')}")  # fmt: skip
        if delay_turns(one, delay, paper):
            return Judgement("broken", words, delay, finding.from_s, finding.to_s)
        if finding.material:
            words += ", which does not turn the verdict yet; what else may come is not shown"
            return Judgement("not_shown", words, delay)
        return None
    if finding.material:
        words = f"no delay is told apart from what its stamps do: {finding.sentence}"
        return Judgement("not_shown", words)
    return None


def widened(figure: MeasuredFigure, moved: Sequence[StampDelay]) -> MeasuredFigure:
    """An interval of a delay, with what slight drifts and steps of the stamps add to it."""
    ends = [figure.low or 0.0, figure.high or 0.0, *_ends(moved)]
    return MeasuredFigure(figure.value, min(ends), max(ends))


def _ends(moved: Sequence[StampDelay]) -> Iterator[float]:
    for each in moved:
        if each.delay is not None:
            yield from (end for end in (each.delay.value, each.delay.low, each.delay.high)
                        if end is not None)  # fmt: skip
