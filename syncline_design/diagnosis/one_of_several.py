"""A finding that is one of several effects a log cannot tell apart, said as that: never as one."""

from __future__ import annotations

from syncline_design.diagnosis.result import Finding, Other, Rival, UnlikeOthers
from syncline_design.machine.sentences import any_of


def is_one_of_several(one: Finding) -> bool:
    """Whether the log leaves another effect in its place."""
    return bool(one.open_aliases)


def members(one: Finding) -> list[str]:
    """The named effect, then what the log leaves in its place, the likeliest first."""
    rivals = sorted(one.open_aliases, key=lambda rival: -(rival.probability or 0.0))
    return names_of(one, rivals)


def class_words(one: Finding) -> str:
    """`latency (position), latency (ranging), filter lag (position) or one of 2 others`."""
    return any_of(members(one))


def rivals_words(one: Finding) -> str:
    """The same without the named one; empty where it is told."""
    return any_of(members(one)[1:])


def names_of(one: Finding | UnlikeOthers, others: list[Rival] | list[Other]) -> list[str]:
    """An effect and others in words, with their stages where these differ."""
    several = any(other.stage != one.stage for other in others)
    return [_name(each, several=several) for each in (one, *others)]


def _name(one: Finding | UnlikeOthers | Rival | Other, *, several: bool) -> str:
    place = f"{one.sensor}, {one.stage}" if several else one.sensor
    return f"{one.effect.replace('_', ' ')} ({place})"
