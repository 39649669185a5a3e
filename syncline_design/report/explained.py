"""Requirements worked out step by step, for people who check by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from syncline_design.report import numbers
from syncline_design.report.document import Heading, Inline, Items, Node, Text, code, given, strong

if TYPE_CHECKING:
    from syncline_design.verdict.named import ExplainedRequirement, ExplainedStep
    from syncline_design.verdict.tree import Verdict

LEAD = (
    "Plain arithmetic in SI units (m, s, rad, kg, W); a name in it is an earlier line's value. The "
    "last line of each requirement is the value that is held against its limit."
)


def explained(verdict: Verdict) -> list[Node]:
    """What was asked to be worked out, requirement by requirement."""
    found = verdict.explained or ()
    nodes: list[Node] = [Text(LEAD)] if found else []
    for one in found:
        nodes.append(Heading(f"{one.id}, limit {numbers.limit(one)}"))
        *before, last = one.steps
        shown = numbers.held(last.value, one, 6)  # in the unit of the limit that it is held against
        nodes.append(Items((*map(_line, before), _line(last, shown))))
        nodes += _sources(one)
    return nodes


def _line(step: ExplainedStep, shown: str = "") -> Inline:
    """`sigma_p_uav = sqrt(0.01**2 + ...) = 17.32 mm: |(s_north, s_east, s_down)|`."""
    value = shown or _value(step)
    put_in = (code(step.numbers), " = ") if step.numbers != repr(step.value) else ()
    return (code(step.name), " = ", *put_in, strong(value), ": ", given(step.formula))


def _value(step: ExplainedStep) -> str:
    """Lengths, times, amounts in their usual units; what else there is in SI, as it is added up."""
    if not step.unit.startswith(("m/", "m^", "rad")):
        return numbers.in_unit(step.value, step.unit, 6)
    return f"{numbers.number(step.value, 6)}\N{NO-BREAK SPACE}{step.unit}"


def _sources(one: ExplainedRequirement) -> list[Node]:
    """Where the figures of the steps come from, each source once."""
    told = dict.fromkeys(part for step in one.steps for part in step.source.splitlines() if part)
    entries = tuple((given(source),) for source in told)
    return [Text("From:", quiet=True), Items(entries)] if entries else []
