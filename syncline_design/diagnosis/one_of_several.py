"""A finding that is one of several effects a log cannot tell apart, said as that: never as one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from syncline_design.machine.sentences import any_of


class Placed(Protocol):
    """An effect and where it acts."""

    @property
    def effect(self) -> str: ...
    @property
    def sensor(self) -> str: ...
    @property
    def stage(self) -> str: ...


class LeftOpen(Placed, Protocol):
    """What the log leaves in a named one's place, with the chance that it is that."""

    @property
    def probability(self) -> float | None: ...


class OfClass(Placed, Protocol):
    """A finding as far as it is one of a class."""

    @property
    def open_aliases(self) -> Sequence[LeftOpen]: ...


def is_one_of_several(one: OfClass) -> bool:
    """Whether the log leaves another effect in its place."""
    return bool(one.open_aliases)


def members(one: OfClass) -> list[str]:
    """The named effect, then what the log leaves in its place, the likeliest first."""
    rivals = sorted(one.open_aliases, key=lambda rival: -(rival.probability or 0.0))
    return names_of(one, rivals)


def class_words(one: OfClass) -> str:
    """`latency (position), latency (ranging), filter lag (position) or one of 2 others`."""
    return any_of(members(one))


def note_of(one: OfClass) -> str:
    """What a spec that lists the named one says beside it; nothing where it is told."""
    if not is_one_of_several(one):
        return ""
    count = len(members(one))
    return f"one of {count} effects that the data cannot tell apart: {class_words(one)}"


def rivals_words(one: OfClass) -> str:
    """The same without the named one; empty where it is told."""
    return any_of(members(one)[1:])


def names_of(one: Placed, others: Sequence[Placed]) -> list[str]:
    """An effect and others in words, with their stages where these differ."""
    several = any(other.stage != one.stage for other in others)
    return [_name(each, several=several) for each in (one, *others)]


def _name(one: Placed, *, several: bool) -> str:
    place = f"{one.sensor}, {one.stage}" if several else one.sensor
    return f"{one.effect.replace('_', ' ')} ({place})"
