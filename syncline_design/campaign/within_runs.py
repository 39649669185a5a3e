"""How far the parts of a run scatter over what the noise fitted makes (`changes`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.campaign.pool import Pool, inverted
from syncline_design.campaign.run_records import SameSize
from syncline_design.effects.record import Array


def scatter_within(pool: Pool, run: int, groups: Sequence[SameSize], known: Array) -> Array:
    """Variance of each effect by the parts of one run over that fitted, (C,); known: its
    information (P, P) and the prior's, inverted.

    Of each effect alone, the others where the run itself puts them: what acts all along would
    else be taken for scatter.
    """
    less, whole = pool.less[run], pool.normal[run]
    values = known @ pool.score[run]
    found = np.zeros((len(less), sum(len(group.terms) for group in groups)))
    for k, part in enumerate(less):
        left = part.score - part.normal @ values
        for group in groups:
            found[k, group.terms] = _scatter(whole, part.normal, left, group)
    return np.asarray(np.max(found, axis=0))


def _scatter(whole: Array, normals: Array, scores: Array, group: SameSize) -> Array:
    """Mean over an effect's parameters of the jackknife's variance over the fitted one, (G,).

    normals (n, P, P), scores (n, P): of a run without each of its parts.
    """
    own = whole[group.blocks]
    values = np.einsum("ngab,ngb->nga", inverted(normals[:, *group.blocks]), scores[:, group.index])
    off = values - values.mean(axis=0)
    seen = np.sum(np.einsum("gaa->ga", own) > 0.0, axis=-1)
    spread = (1.0 - 1.0 / len(values)) * np.einsum("nga,gab,ngb->g", off, own, off)
    return np.asarray(np.where(seen > 0, spread / np.maximum(seen, 1), 1.0))
