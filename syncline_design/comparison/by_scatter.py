"""What delays that differ from row to row make of the figures of a sensor's stamps and delay.

A standard deviation of stamps is no bound of them: the bound is the largest that acted on this log,
and the interval of a delay that differs from row to row, or along the log, holds it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.departing import amount, with_room
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.swaying import LargestDelay
from syncline_design.effects import plain_delay, registry
from syncline_design.model.normal import NORMAL_95


def as_bound(
    one: Assumed, said: Judgement, breaking: Sequence[Finding], log: LogEvidence
) -> Judgement:
    """A row of stamps that scatter, by the largest that acted; no figure where none is known."""
    scatters = [f for f in breaking if registry()[f.effect].bounded_by_k]
    if one.name != "timing" or not scatters or len(scatters) < len(breaking):
        return said
    largest = _largest(one, log)
    if largest is None:
        return replace(said, measured=None)
    words = f"{said.words}, and in the worst row by {amount(largest.value_s, 's')}"
    figure = MeasuredFigure(largest.value_s, largest.low_s, largest.high_s)
    return replace(said, words=words, measured=figure)


def with_scatter(one: Assumed, said: Judgement, log: LogEvidence) -> Judgement:
    """A delay that is broken, in an interval that holds what rows differ by."""
    room = max(_rooms(one, log), default=0.0)
    figure = said.measured
    if one.name != "latency" or not room > 0.0 or figure is None or figure.value is None:
        return said
    words = f"{said.words}; it is a mean, and differs from row to row by up to {amount(room, 's')}"
    return replace(said, words=words, measured=with_room(figure, figure.value, room))


def _rooms(one: Assumed, log: LogEvidence) -> Iterator[float]:
    """By how much delays of a sensor differ from their mean [s]."""
    largest = _largest(one, log)
    if largest is not None:
        yield largest.high_s
    for f in log.found.findings:
        own = f.effect == plain_delay().name and f.stage == one.stage and f.sensor == one.role
        if own and f.varying_std is not None:
            yield NORMAL_95 * float(f.varying_std.value)


def _largest(one: Assumed, log: LogEvidence) -> LargestDelay | None:
    return None if log.sight is None else log.sight.largest.get(f"{one.stage}/{one.role}")
