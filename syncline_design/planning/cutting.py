"""A drive of one leg cut to what is asked: of each shape of swing the shortest that is enough.

A library holds legs of a few lengths; what is asked needs just so much.  Each shape is tried
shorter than the best drive so far, judged whole; where that is enough, the least time of it that
still is enough is found by halving.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.drives import World
from syncline_design.planning.legs import transition
from syncline_design.planning.placing import LegTold, lasting_s
from syncline_design.planning.swings import SHAPES, SwingShape, swing_within

SAVES: Final = 0.95  # of a drive's time: one that takes more saves nothing that matters
TRIED: Final = (SAVES, 0.75)  # of it: a longer swing is faster, and wider about
HALVINGS: Final = 4
LONGEST_S: Final = 240.0  # of a drive that one swing may do for
NOTHING: Final = np.zeros((4, 1, 1))  # told so far: it is judged whole
Judged = Callable[[LegTold], bool]


@dataclass(frozen=True, eq=False)
class Cutting:
    """Swings cut to what is asked; enough: whether one is, judged whole."""

    world: World
    stages: tuple[int, ...]
    enough: Judged

    def shorter(self, than_s: float) -> LegTold | None:
        """The shortest swing that is enough and saves time that matters."""
        found, best_s = None, min(than_s, LONGEST_S)
        for stage, shape in self._every():
            tries = (self._enough(stage, shape, share * best_s) for share in TRIED)
            one = next((told for told in tries if told is not None), None)
            if one is not None:
                found = self._cut(stage, shape, one)
                best_s = lasting_s([found])
        return found

    def _every(self) -> Iterator[tuple[int, SwingShape]]:
        return ((stage, shape) for stage in self.stages for shape in SHAPES)

    def _cut(self, stage: int, shape: SwingShape, known: LegTold) -> LegTold:
        """The shortest of a shape that is enough; known: one that is."""
        short_s = 0.0
        for _ in range(HALVINGS):
            middle_s = 0.5 * (short_s + lasting_s([known]))
            one = self._enough(stage, shape, middle_s)
            known, short_s = (known, middle_s) if one is None else (one, short_s)
        return known

    def _enough(self, stage: int, shape: SwingShape, most_s: float) -> LegTold | None:
        """The longest of a shape within a time, the run up to it counted, where it is enough."""
        vehicle = self.world.vehicles[stage]
        begun_s = transition(vehicle, 0.0).duration_s
        leg = swing_within(vehicle, stage, shape, most_s - begun_s)
        if leg is None:
            return None
        told = self.world.placeable(leg, NOTHING, NOTHING, NOTHING)
        return told if self.enough(told) else None
