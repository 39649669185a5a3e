"""Sums over runs with some of their parameters free, and with changes beside all (`changes`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.campaign.column_sizes import column_sizes
from syncline_design.campaign.hermitian import pseudo_inverses
from syncline_design.campaign.pool import Pool, inverted
from syncline_design.campaign.run_records import Change, Freed, Runs, SameSize
from syncline_design.campaign.trends import shapes
from syncline_design.effects.record import Array


def freed_by_trends(runs: Runs, groups: Sequence[SameSize]) -> Freed:
    """N and s of every course and effect, what runs have in common free."""
    over = shapes(len(runs.normal))
    summed = np.tensordot(over, runs.normal, axes=1)
    cross = summed @ runs.inverse
    scores = over @ runs.score - cross @ runs.score.sum(axis=0)
    normals = []
    for g in groups:
        own = np.tensordot(np.square(over), runs.normal[:, *g.blocks], axes=1)
        normals.append(own - cross[:, g.index] @ np.swapaxes(summed[:, g.index], -1, -2))
    return Freed(tuple(normals), tuple(scores[:, g.index] for g in groups))


def with_own_free(runs: Runs, groups: Sequence[SameSize], found: Freed) -> Freed:
    """The same where every effect may have any value besides what it is another by.

    A constant that is held near 0, since the mean of a drift hid it, would else speak for another
    effect.  With P the prior information of effect c, X = J S^-1[:, c] and
    W = (P^-1 - S^-1[c, c])^-1,
        N - X W X',   s - X W S^-1[c, :] g.
    """
    over = shapes(len(runs.normal))
    cross = np.tensordot(over, runs.normal, axes=1) @ runs.inverse
    prior = runs.total - runs.normal.sum(axis=0)
    fit = runs.inverse @ runs.score.sum(axis=0)
    normals, scores = [], []
    for g, normal, score in zip(groups, found.normals, found.scores, strict=True):
        held = prior[g.blocks]
        across = cross[:, *g.blocks]
        # (P^-1 - V)^-1 = P (1 - V P)^-1, which is 0 where nothing is held
        own = held @ np.linalg.pinv(np.eye(held.shape[-1]) - runs.inverse[g.blocks] @ held)
        moved = across @ own
        normals.append(normal - moved @ np.swapaxes(across, -1, -2))
        scores.append(score - np.einsum("kgab,gb->kga", moved, fit[g.index]))
    return Freed(tuple(normals), tuple(scores))


def with_beside(pool: Pool, look: int, beside: Sequence[Change]) -> tuple[Array, Array]:
    """Information and score of the first runs, what is beside as parameters after all others: of a
    change of course h they have h times the columns of its effect."""
    normal, score = pool.normal[:look], pool.score[:look]
    if not beside:
        return normal, score
    index = np.concatenate([np.arange(score.shape[1]), *(one.term.index for one in beside)])
    over = [np.repeat(one.trend.over(look)[:, None], one.term.size, axis=1) for one in beside]
    grown: Array = np.concatenate([np.ones_like(score), *over], axis=1)
    squares = grown[:, :, None] * grown[:, None, :]
    return normal[:, index[:, None], index] * squares, score[:, index] * grown


def marginal(total: Array, score: Array, size: int) -> tuple[Array, Array]:
    """The first so many parameters, the others free."""
    if len(total) == size:
        return total, score
    across = total[:size, size:] @ inverted(total[size:, size:])
    left: Array = score[:size] - across @ score[size:]
    return total[:size, :size] - across @ total[size:, :size], left


def pseudo_inverse(total: Array) -> Array:
    """total^-1 (..., P, P), columns scaled alike first."""
    scale = column_sizes(np.diagonal(total, axis1=-2, axis2=-1))
    squares = scale[..., :, None] * scale[..., None, :]
    return np.asarray(pseudo_inverses(total / squares, 1e-13) / squares)
