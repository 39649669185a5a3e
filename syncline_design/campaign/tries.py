"""As how many independent tries the search over effects counts (Westfall and Young's min-P).

Effects move the same rows, many of them nearly alike, so that the least of their chances is small
less often than of as many independent ones: Bonferroni's charge is too dear.  Under no effect the
score of the logs is s ~ Normal(0, N), N their information; of draws of it the chance of the
likeliest effect by noise, chi-square of s_c' N_cc^-1 s_c, is at most q with the rate allowed, and
    tries = rate / q.
Source: Westfall, Young, Resampling-Based Multiple Testing (1993), 2.3 (single-step min-P).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.random import PCG64

from syncline_design.campaign.column_sizes import column_sizes
from syncline_design.campaign.pool import Pool, Term, inverted
from syncline_design.effects.record import Array
from syncline_design.machine.random_numbers import generator
from syncline_design.model.distributions import chi_square_log_beyond

DRAWS: Final = 4000


def tries_of(pool: Pool, terms: Sequence[Term], rate: float) -> float:
    """Between 1 and the number of effects.  rate: of false names that are allowed."""
    if len(terms) < 2:
        return 1.0
    normal = pool.normal.sum(axis=0)
    scores = generator(0, bits=PCG64).standard_normal((DRAWS, len(normal))) @ _root(normal)
    least = np.min([_log_chances(normal, scores, term) for term in terms], axis=0)
    return float(np.clip(rate / np.exp(np.quantile(least, rate)), 1.0, len(terms)))


def _root(normal: Array) -> Array:
    """Its symmetric root, which no choice of eigenvectors changes."""
    size = column_sizes(np.diag(normal))
    values, vectors = np.linalg.eigh(normal / size[:, None] / size)
    found: Array = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T * size
    return found


def _log_chances(normal: Array, scores: Array, term: Term) -> Array:
    """log of the chance by noise of one effect in every draw, (DRAWS,)."""
    own, moved = normal[np.ix_(term.index, term.index)], scores[:, term.index]
    square = np.einsum("na,ab,nb->n", moved, inverted(own), moved)
    seen = int(np.sum(np.diag(own) > 0.0))
    return np.asarray(chi_square_log_beyond(square, seen)) if seen else np.zeros(len(scores))
