"""Why no design meets a spec: what cannot hold together, and which changes would help."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.choice.outcome import (
    NO_SINGLE_CHANGE,
    Conflict,
    Explanation,
    Fix,
    Members,
    cut_short_words,
)
from syncline_design.report.document import (
    Heading,
    Items,
    Node,
    Span,
    Text,
    given,
    muted,
    strong,
)
from syncline_design.verdict.obstacle import requirement_name

_PROVEN = muted(" (solved again to prove it)")


def infeasibility_nodes(why: Explanation) -> list[Node]:
    """The reasons, then the changes that were solved again, then what the time limit left open."""
    nodes: list[Node] = [Text(why.about)] if why.about else []
    gaps = tuple(gap.text for gap in why.roles_without_options)
    nodes += [Heading("Roles without any option"), Items(gaps)] if gaps else []
    nodes += _conflict(why.conflict)
    for members in why.further_conflicts:
        ending = " cannot hold together." if len(members) > 1 else " cannot be met either."
        nodes.append(Text(("Apart from that: ", *_members(members), ending)))
    together = tuple(_joint(fixes) for fixes in why.joint_fixes)
    if together:
        nodes += [Heading("What would make it feasible together"), Items(together)]
    alone = tuple((given(fix.text), *([_PROVEN] if fix.proven else [])) for fix in why.fixes)
    if alone:
        nodes += [Heading("What would make it feasible, each alone"), Items(alone)]
    elif not why.cut_short and nodes:
        nodes.append(Text(NO_SINGLE_CHANGE))
    if why.cut_short:
        nodes.append(Text(cut_short_words(why)))
    return nodes


def _conflict(conflict: Conflict) -> list[Node]:
    if not conflict.requirements:
        return []
    several = len(conflict.requirements) > 1
    title = "Requirements that cannot hold together" if several else (
        "Requirement that no candidate meets"
    )  # fmt: skip
    proven = " Proven minimal: without any one of them the rest can be met."
    minimal = proven if conflict.minimal and several else ""
    return [Heading(title), Text((*_members(conflict.requirements), f".{minimal}"))]


def _members(members: Members) -> list[str | Span]:
    """`ACC-1 (line 15), COST-1 (line 17)`, the names strong."""
    found: list[str | Span] = []
    for entry in members:
        line = f" (line {entry.line})" if entry.line else ""
        comma = ", " if found else ""
        found += [comma, strong(requirement_name(entry)), line]
    return found


def _joint(fixes: Sequence[Fix]) -> tuple[str | Span, ...]:
    told: list[str | Span] = []
    for fix in fixes:
        told += [" and " if told else "", given(fix.text)]
    return (*told, _PROVEN)
