"""A drive of one leg cut to what is asked: of every shape of swing the shortest that is enough.

A library holds legs of a few lengths; what is asked needs just so much.  A longer swing is faster,
and wider about, so that what is enough at one length need not be at a longer one: lengths are tried
over a ladder, and over others down from the best drive so far until none of them is enough; then in
finer steps where that is nearly as short as the shortest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.drives import World
from syncline_design.planning.legs import Leg, transition
from syncline_design.planning.swings import SHAPES, SwingShape, swing_within

SAVES: Final = 0.95  # of a drive's time: one that takes more saves nothing that matters
LONGEST_S: Final = 240.0  # of a drive that one swing may do for
LADDER: Final = (1.0, 0.85, 0.72, 0.61, 0.52)  # of a time
MOST_LADDERS: Final = 6
FINER: Final = ((1.5, (0.95, 0.9, 0.85, 0.8)), (1.15, (0.98, 0.96, 0.94)))
"""Of the shortest: how long a shape may take to be tried at finer steps, and these."""
Sifted = Callable[[Sequence[Leg]], Sequence[Leg]]
OfStage = tuple[int, SwingShape]


@dataclass(frozen=True, slots=True)
class Cut:
    """A drive of one swing that is enough; lasts_s: with the run up to it."""

    of: OfStage
    leg: Leg
    lasts_s: float


@dataclass(frozen=True, eq=False)
class Cutting:
    """Swings cut to what is asked; enough: those drives of one leg that are, judged whole."""

    world: World
    stages: tuple[int, ...]
    enough: Sifted

    def shorter(self, than_s: float) -> list[Leg]:
        """Swings that are enough and save time that matters, the shortest first."""
        most_s = min(SAVES * than_s, LONGEST_S)
        every = [(stage, shape) for stage in self.stages for shape in SHAPES]
        found = self._down(every, most_s)
        for near, shares in FINER:
            if not found:
                break
            best_s = min(cut.lasts_s for cut in found)
            close = dict.fromkeys(cut.of for cut in found if cut.lasts_s <= near * best_s)
            found += self._tried(close, [share * best_s for share in shares])
        return [cut.leg for cut in sorted(found, key=lambda cut: cut.lasts_s)]

    def _down(self, shapes: Sequence[OfStage], most_s: float) -> list[Cut]:
        """What is enough on a ladder of times, and on others down from the shortest that is."""
        found: list[Cut] = []
        for _ in range(MOST_LADDERS):
            below = self._tried(shapes, [share * most_s for share in LADDER])
            if not below:
                break
            found += below
            most_s = SAVES * min(cut.lasts_s for cut in below)
        return found

    def _tried(self, shapes: Iterable[OfStage], times_s: Sequence[float]) -> list[Cut]:
        """Of each shape and time the longest swing within it, where it is enough."""
        every = [cut for of in shapes for s in times_s if (cut := self._within(of, s)) is not None]
        enough = set(map(id, self.enough([cut.leg for cut in every])))
        return [cut for cut in every if id(cut.leg) in enough]

    def _within(self, of: OfStage, most_s: float) -> Cut | None:
        stage, shape = of
        vehicle = self.world.vehicles[stage]
        begun_s = transition(vehicle, 0.0).duration_s  # the same at whatever speed
        leg = swing_within(vehicle, stage, shape, most_s - begun_s)
        return None if leg is None else Cut(of, leg, begun_s + leg.duration_s)
