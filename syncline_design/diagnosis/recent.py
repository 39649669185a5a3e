"""The last few results of a costly function, by what it was asked."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import field
from typing import Generic, TypeVar

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

Made = TypeVar("Made")


@dataclass(slots=True)
class Recent:
    """A re-simulation moves one parameter at a time, so most of what it asks was asked before.

    What is given back is shared: it must not be written to.
    """

    most: int
    kept: OrderedDict[Hashable, Array] = field(default_factory=OrderedDict)

    def of(self, asked: Hashable, make: Callable[[], Array]) -> Array:
        """The result for what is asked, made only where it is not among the last ones."""
        if asked in self.kept:
            self.kept.move_to_end(asked)
            return self.kept[asked]
        found = make()
        found.setflags(write=False)
        self.kept[asked] = found
        if len(self.kept) > self.most:
            self.kept.popitem(last=False)
        return found


class LastMade(Generic[Made]):
    """The last few things made of the very objects given; what is merely equal is made anew."""

    def __init__(self, most: int = 2) -> None:
        self.most = most
        self.kept: list[tuple[tuple[object, ...], Made]] = []

    def of(self, given: tuple[object, ...], make: Callable[[], Made]) -> Made:
        """What is made of these objects, made only where it is not among the last ones."""
        for known, made in self.kept:
            if all(a is b for a, b in zip(known, given, strict=True)):
                return made
        made = make()
        self.kept = [*self.kept, (given, made)][-self.most :]
        return made
