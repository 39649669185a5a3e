"""What stands in the way of a design, in words."""

from __future__ import annotations

from syncline_design.choice.outcome import ConflictMember, Explanation
from syncline_design.machine.sentences import sentence_list


def requirement_name(member: ConflictMember) -> str:
    """The id of a requirement, or words for the sync limit that no one wrote."""
    if member.id is None or member.mission is None:
        return member.id or member.words
    return f"{member.id} of mission {member.mission}"


def obstacle_sentence(why: Explanation | None) -> str:
    """What stands in the way of a design, in one sentence."""
    lead = ""
    if why is not None and why.missions and not why.missions[1:]:
        lead = f"Mission {why.missions[0]} cannot be met by any payload: "
    elif why is not None and why.missions:
        lead = f"No one payload meets the missions {sentence_list(list(why.missions))} together: "
    conflict = [] if why is None else [requirement_name(m) for m in why.conflict.requirements]
    if conflict:
        listed = sentence_list(conflict)
        ending = "hold together" if conflict[1:] else "be met"
        return f"{lead}{listed[0].upper()}{listed[1:]} cannot {ending}."
    if why is not None and why.missions and why.missions[1:]:
        return f"{lead.removesuffix(': ')}."
    stuck = [] if why is None else [f"{r.stage} {r.role}" for r in why.roles_without_options]
    if stuck:
        return f"{lead}No candidate fits for {sentence_list(stuck)}."
    return "No design was found."
