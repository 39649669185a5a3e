"""The largest delay of a sensor on a log, of a constant one, what its stamps do, and what is late
for a while or in some rows, together.

    delay(t) = L + r t + s [t >= t*] + sum_k d_k [a_k <= t <= b_k],   t from the log's start,
is linear between its steps, so that the largest is at the start, at the end or beside a step.  An
interval holds the sum of the ends of its parts' intervals, however these vary together.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_shift import LASTING, delay_turns, shifts
from syncline_design.comparison.departing import amount
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.result import Diagnosis, Estimate, Finding
from syncline_design.effects import plain_delay
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Passing:
    """A delay that acts from one time from the log's start to another, or in some rows between."""

    delay: Estimate
    from_s: float
    to_s: float


@dataclass(frozen=True, slots=True)
class _Part:
    """A figure, how it counts with the time from the start, and from when on and until it does."""

    figure: Estimate
    grows: bool = False
    from_s: float = 0.0
    to_s: float = math.inf

    def at(self, time_s: float) -> tuple[float, float | None, float | None]:
        """Value and ends of its interval after so much time."""
        times = time_s if self.grows else 1.0
        low, high = self.figure.interval95 or (None, None)
        ends = sorted(times * float(end) for end in (low, high) if end is not None)
        return times * float(self.figure.value), *(ends if len(ends) == 2 else (None, None))


def with_all_delays(
    one: Assumed,
    said: Judgement | None,
    found: Diagnosis,
    paper: OnPaper,
    passing: Sequence[Passing] = (),
) -> Judgement | None:
    """What is said of a delay, of the largest that a constant, its stamps and what passes make
    together.

    It is broken where these together turn the verdict.
    """
    figure = whole_delay(one, found, passing)
    if figure is None or figure.value is None or not delay_turns(one, figure, paper):
        return said
    whole = f"in all a delay of up to {amount(figure.value, 's')} on this log"
    if said is None or said.status != "broken":
        return Judgement(
            "broken", f"{'; '.join(f.sentence for f in delaying(one, found))}: {whole}", figure
        )
    return replace(said, words=f"{said.words}; {whole}", measured=figure)


def whole_delay(
    one: Assumed, found: Diagnosis, passing: Sequence[Passing] = ()
) -> MeasuredFigure | None:
    """The largest; None where at most one makes it, or none of them moves the stamps or passes."""
    lasting = list(_parts(one, found))
    parts = lasting + [_Part(p.delay, False, p.from_s, p.to_s) for p in passing]
    moves = any(part.grows or part.from_s > 0.0 for part in lasting)
    if not lasting or len(parts) < 2 or not (moves or passing):
        return None
    duration_s = found.log.duration_s
    edges = (edge for p in parts for edge in (p.from_s, p.to_s))
    steps_s = [edge for edge in edges if 0.0 < edge < duration_s]
    sums = [_sum(parts, time_s) for time_s in (0.0, duration_s, *steps_s)]
    sums += [_sum([p for p in parts if p.from_s < time_s], time_s) for time_s in steps_s]
    return max(sums, key=lambda figure: abs(figure.value or 0.0))


def _sum(parts: list[_Part], time_s: float) -> MeasuredFigure:
    told = [p.at(time_s) for p in parts if p.from_s <= time_s <= p.to_s]
    lows, highs = [low for _, low, _ in told], [high for *_, high in told]
    value = sum(v for v, *_ in told)
    if None in lows or None in highs:
        return MeasuredFigure(value)
    return MeasuredFigure(value, sum(x for x in lows if x is not None),
                          sum(x for x in highs if x is not None))  # fmt: skip


def _parts(one: Assumed, found: Diagnosis) -> Iterator[_Part]:
    for finding in delaying(one, found):
        own = finding.parameters
        if finding.effect == plain_delay().name and LASTING in own:
            yield _Part(own[LASTING])
        elif "rate" in own:
            yield _Part(own["rate"], grows=True)
        elif "step_s" in own and "time_s" in own:
            yield _Part(own["step_s"], from_s=float(own["time_s"].value))


def delaying(one: Assumed, found: Diagnosis) -> list[Finding]:
    """All that delays a sensor in all of the log, or moves its stamps."""
    moved = [each.finding for each in shifts(one, found)]
    constant = [
        f for f in found.findings
        if f.effect == plain_delay().name and f.stage == one.stage and f.kind != "stand_in"
        and one.role in (f.sensor, *(f.also or ())) and f.from_s is None
    ]  # fmt: skip
    return [*constant, *moved] if one.name == "latency" else []
