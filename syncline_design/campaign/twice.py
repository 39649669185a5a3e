"""Whether two runs are one: the same rows in another format, rounded otherwise, or less a few."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.model.distributions import chi_square_limit

AS_GOOD_AS_ONE: Final = 1e-9  # chance with which two runs, each with its own noise, are as alike
SEEN: Final = 1e-6  # of the largest information: what both tell less of is rounding


def is_same(one: Sufficient, other: Sufficient) -> bool:
    """Whether the scores of two runs are nearer to each other than noise lets them be.

    Scores s ~ Normal(N theta, N): of two runs with one theta, D = (s1 - s2)' (N1 + N2)^-1 (s1 - s2)
    is chi-square of as many degrees of freedom as both tell of, and more where they differ.
    """
    if one.labels != other.labels:
        return False
    if np.array_equal(one.normal, other.normal) and np.array_equal(one.score, other.score):
        return True
    total, apart = one.normal + other.normal, one.score - other.score
    size = np.sqrt(np.maximum(np.diag(total), 0.0))
    told = size > 0.0
    if not np.any(told):
        return False
    size = size[told]
    values, vectors = np.linalg.eigh(total[np.ix_(told, told)] / size[:, None] / size)
    kept = values > SEEN * values[-1]
    turned = (vectors.T @ (apart[told] / size))[kept]
    far = float(np.sum(turned**2 / values[kept]))
    return far < float(chi_square_limit(1.0 - AS_GOOD_AS_ONE, float(np.sum(kept))))
