"""Columns of information matrices scaled alike, so that parameters of any unit compare."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.record import Array


def column_sizes(diagonal: Array) -> Array:
    """Square roots of the diagonals (..., P) of information matrices; 1 for what is not seen."""
    return np.asarray(np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)))
