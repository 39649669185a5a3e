"""The last few results of a costly function, by what it was asked."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import field

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


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
