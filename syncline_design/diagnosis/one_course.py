"""Whether what is left of a log is one course that begins and ends, and no noise.

A knock that nothing names, or one of which a constant of the whole log took a part, is noise of
some sensor by every fit of the noise.  With S = e' W e what is left over the spec's white noise of
n components, and G(a, b) what one effect with a value in [a, b] and another one outside takes off,
    share = max G / (S - n)
over all effects and stretches of whole blocks is nearly 1 of a knock, and small of noise whose
course changes several times along the log.
Source: as of `stretch_windows`; sums of squares by an effect as in an analysis of variance.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.diagnosis.identity import Label
from syncline_design.diagnosis.stretch_windows import BlockSums, squares
from syncline_design.machine.quick_dataclass import dataclass

BLOCKS: Final = 40
LEAST: Final = 2  # blocks of a stretch
ENOUGH: Final = 0.1  # of n, that has to be left for a share of it to say anything
MOST_OF_IT: Final = 0.8


@dataclass(frozen=True, slots=True)
class OneCourse:
    """An effect that makes up a share of what is beyond the spec's noise, in a stretch and else."""

    label: Label
    from_s: float
    to_s: float
    share: float


def one_course(found: Sequence[tuple[Label, BlockSums]]) -> OneCourse | None:
    """The effect and stretch that make up most of what is left; None where none does."""
    told = [one for label, sums in found if (one := _largest(label, sums)) is not None]
    best = max(told, key=lambda one: one.share, default=None)
    return best if best is not None and best.share > MOST_OF_IT else None


def _largest(label: Label, sums: BlockSums) -> OneCourse | None:
    blocks = len(sums.first) - 1
    count = float(sums.count[-1])
    beyond = float(sums.square[-1]) - count
    if blocks < BLOCKS or beyond < ENOUGH * count:
        return None
    edges = np.round(np.linspace(0, blocks, BLOCKS + 1)).astype(int)
    pairs = [(a, b) for a, b in itertools.combinations(range(BLOCKS + 1), 2)
             if LEAST <= b - a <= BLOCKS - LEAST]  # fmt: skip
    first, last = (edges[list(ends)] for ends in zip(*pairs, strict=True))
    normal, score = sums.normal, sums.score[:, :1]
    inside = normal[last] - normal[first], score[last] - score[first]
    outside = normal[-1] - inside[0], score[-1] - inside[1]
    width = normal.shape[2]
    taken = np.zeros(len(pairs))
    for weight, told in (inside, outside):
        own, seen = squares(weight, told, width)
        taken += np.where(seen, own[:, 0], 0.0)
    at = int(np.argmax(taken))
    from_s, to_s = (
        float(sums.time_s[k]) for k in (sums.first[first[at]], sums.first[last[at]] - 1)
    )
    return OneCourse(label, from_s, to_s, min(float(taken[at]) / beyond, 1.0))
