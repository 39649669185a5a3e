"""What stands in the way of a design, in words."""

from __future__ import annotations

from syncline_design.choice.outcome import ConflictMember, Explanation, Members
from syncline_design.machine.sentences import sentence_list


def requirement_name(member: ConflictMember) -> str:
    """The id of a requirement, or words for the sync limit that no one wrote."""
    if member.id is None or member.mission is None:
        return member.id or member.words
    return f"{member.id} of mission {member.mission}"


def obstacle_sentence(why: Explanation | None) -> str:
    """What stands in the way of a design: all of it, in a sentence or two."""
    lead = ""
    if why is not None and why.missions and not why.missions[1:]:
        lead = f"Mission {why.missions[0]} cannot be met by any payload: "
    elif why is not None and why.missions:
        lead = f"No one payload meets the missions {sentence_list(list(why.missions))} together: "
    if why is not None and why.conflict.requirements:
        return lead + _unmet_sentences(why)
    if why is not None and why.missions and why.missions[1:]:
        return f"{lead.removesuffix(': ')}."
    stuck = [] if why is None else [f"{r.stage} {r.role}" for r in why.roles_without_options]
    if stuck:
        return f"{lead}No candidate fits for {sentence_list(stuck)}."
    return "No design was found."


def _unmet_sentences(why: Explanation) -> str:
    """`ACC-1 and COST-1 cannot hold together. Apart from that MASS-1 cannot be met.`"""
    alone = [requirement_name(one[0]) for one in why.conflicts if not one[1:]]
    several = [one for one in why.conflicts if one[1:]]
    said = [_together(one, one is not why.conflict.requirements or why.conflict.minimal)
            for one in several]  # fmt: skip
    if alone[1:]:
        said.append(f"{sentence_list(alone)} cannot be met, each for itself")
    elif alone:
        said.append(f"{alone[0]} cannot be met")
    first, *further = said
    return ". Apart from that ".join([f"{first[0].upper()}{first[1:]}", *further]) + "."


def _together(members: Members, minimal: bool) -> str:
    listed = sentence_list([requirement_name(member) for member in members])
    if minimal:
        return f"{listed} cannot hold together"
    return f"{listed} cannot all hold together (a smaller set was not ruled out in time)"


def remedies_sentence(why: Explanation | None) -> str:
    """Which changes would help, each alone, else together; empty where none is known."""
    if why is None:
        return ""
    alone = [fix.text for fix in why.fixes]
    if alone:
        leads = {1: "This", 2: "Either of these"}
        return f"{leads.get(len(alone), 'Any one of these')} would do: {'; '.join(alone)}."
    sets = [" and ".join(fix.text for fix in fixes) for fixes in why.joint_fixes]
    return f"Together these would do: {'; or '.join(sets)}." if sets else ""
