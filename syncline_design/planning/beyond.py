"""Two effects beyond first order, where the size of one is known.

To first order a filter lag is a latency, whatever is driven; at 100 ms the two differ in every
turn.  With the first effect at the size d that was found, e(d) its exact error, and r(t) that of
the second, the columns
    q = e(d) - r(t0),   S = dr/dt at t0
(less what the time before the log may have left in a memory, which a fit of the second takes out)
tell by how much the first beats the second refitted: q' C^-1 q less what S explains of it.  t0 is
the value at which the second comes nearest to the first on the legs together (Gauss-Newton); on
any drive it is refitted about there to first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import slopes_of, zero_values
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.information import Unknown, columns, drift_columns
from syncline_design.planning.wanted import PairGoal

STEPS: Final = 4  # of Gauss-Newton: from a fit of first order


@dataclass(frozen=True, slots=True)
class BeyondFirst:
    """The first effect at its size, and the second where it comes nearest to it."""

    first: Acting
    second: Acting

    @property
    def width(self) -> int:
        """Number of columns."""
        return 1 + len(self.second.effect.slopes())

    def columns(self, view: Scene) -> Array:
        """q and S [m], (n, 3, width); zero where nothing is known."""

        def apart(taken: Sequence[Acting]) -> Array:
            return view.mistaken(self.first, taken[0])

        own = (self.second,)
        both = np.concatenate([apart(own)[:, :, None], slopes_of(apart, own)], axis=2)
        found: Array = np.nan_to_num(both)
        return found


def beyond_first(view: Scene, every: Sequence[Unknown], pair: PairGoal) -> BeyondFirst | None:
    """A pair of known size beyond first order; None where its effects happen at a time.

    Then they depend on when along the drive they are, and first order has to do.
    """
    own = [every[k] for k in (*pair.first, *pair.second)]
    effects = [own[0].candidate.effect, own[-1].candidate.effect]
    located = any(p.located for effect in effects for p in effect.parameters)
    if not pair.known or located or np.any(drift_columns(view, own, columns(view, own))):
        return None
    names = [every[k].parameter.name for k in pair.first]
    sizes = dict(zip(names, map(float, pair.sizes), strict=True))
    one, other = own[0].candidate, own[-1].candidate
    first = one.acting(zero_values(one.effect) | sizes)
    second = other.acting(zero_values(other.effect))
    for _ in range(STEPS):
        second = _nearer(view, BeyondFirst(first, second))
    return BeyondFirst(first, second)


def _nearer(view: Scene, now: BeyondFirst) -> Acting:
    """The second effect refitted to the first, each parameter within what it can be."""
    found = now.columns(view)
    flat = found.reshape(-1, found.shape[2])
    step = np.linalg.lstsq(flat[:, 1:], flat[:, 0], rcond=1e-9)[0]
    values = dict(now.second.values)
    for p, by in zip(now.second.effect.slopes(), step, strict=True):
        low = -p.high if p.signed else 0.0
        values[p.name] = float(np.clip(values[p.name] + by, low, p.high))
    return Acting(now.second.effect, now.second.sensor, now.second.stage, values)
