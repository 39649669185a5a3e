"""What a diagnosis has but a word for: what changed once, and what adds to a broken row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.departing import amount, of_finding
from syncline_design.comparison.in_doubt import Suspicion, widened_by
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.diagnosis.knocks import after_a_knock, words_for
from syncline_design.diagnosis.result import Diagnosis, Finding
from syncline_design.effects import registry


def shapes(found: Diagnosis) -> tuple[Finding, ...]:
    """Material findings that are the best word for something that has no name."""
    return words_for(found.findings)


def once_changed(found: Diagnosis) -> Diagnosis:
    """The diagnosis, where all that has no name is what a knock changed: explained."""
    settled = found.sound and not found.remaining.beyond_noise
    if found.verdict != "unexplained" or not settled:
        return found
    causes = after_a_knock(found.findings)
    if causes is None:
        return found
    left = replace(found.remaining, unexplained=False, material=False)
    return replace(found, verdict="explained", findings=causes, remaining=left)


def beside_shapes(one: Assumed, said: Judgement, log: LogEvidence, *, signed: bool) -> Judgement:
    """What is broken, with an interval that holds what a word for something else adds to it.

    A delay that grows and then stays may be told as a drift and a delay on top: neither is the
    whole of it.  Its figure is then the largest that acted; sizes of several components add to no
    one figure.
    """
    adding = [f for f in shapes(log.found) if _adds(one, f, log)]
    if said.status != "broken" or not adding:
        return said
    figures = [Suspicion(((None, log.figure(one, of_finding(f))),)) for f in adding]
    words = f"{said.words}; on top of what is not its name: {_sentences(adding)}"
    whole = widened_by(said.measured, figures, signed)
    if signed and whole is not None:
        beside = [log.figure(one, of_finding(f)) for f in adding if _meets(said, f)]
        whole = _largest(whole, [f.value for f in beside if f is not None and f.value is not None])
        words += f": in all up to {amount(whole.value or 0.0, one.unit)}"
    return replace(said, words=words, measured=whole)


def _meets(said: Judgement, finding: Finding) -> bool:
    """Whether some of it acts while that does which the row is broken by; all of a log at once."""
    first, last = -math.inf, math.inf
    return max(said.from_s or first, finding.from_s or first) <= min(
        said.to_s or last, finding.to_s or last
    )


def _largest(figure: MeasuredFigure, beside: Sequence[float]) -> MeasuredFigure:
    """The largest value that acted at one time, of what is broken and what acts beside it."""
    own = figure.value or 0.0
    value = max((own, own + sum(beside), *beside), key=abs)
    if figure.low is None or figure.high is None:
        return MeasuredFigure(value)
    return MeasuredFigure(value, min(figure.low, value), max(figure.high, value))


def _adds(one: Assumed, finding: Finding, log: LogEvidence) -> bool:
    """Whether it would be of the same row, were it the name."""
    return finding.effect in registry() and log.breaks(one, of_finding(finding))


def _sentences(found: Sequence[Finding]) -> str:
    return "; ".join(f.sentence for f in found)
