"""What values cost that an effect can have and hardly ever has.

A value beyond what is usual is met once in a hundred or so: log 100 is UNUSUAL_NATS, about.  One
that is known to a standard uncertainty s only may as well be a usual one, z = (|x| - usual) / s
uncertainties off, which costs z^2 / 2 of likelihood; the cheaper of the two is charged.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.effects.record import Array, Effect

UNUSUAL_NATS: Final = 5.0


def unusual_nats(effect: Effect, values: Array, spreads: Array) -> float:
    """Of the slopes' values (..., p) with their standard uncertainties [nat]."""
    usual = np.array([p.usual for p in effect.slopes()])
    beyond = np.maximum(np.abs(values) - usual, 0.0)
    known = np.where(spreads > 0.0, spreads, np.inf)
    moved = 0.5 * np.square(beyond / known)
    return float(min(UNUSUAL_NATS, np.max(moved, initial=0.0)))
