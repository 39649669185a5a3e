"""What is built in and changed once: an arm or a mounting that is off from a moment on.

Off for about half of a log it raises the median of what windows show, so that nothing stands out,
and a fit of the noise takes it for slow noise.  Of every moment t that leaves enough of the log,
    G(t) = b' (X' W X) b,   b = (X' W X)^-1 X' W e, from t to the end, or from the beginning to t,
is held against what is left with a constant on either side of t: its mean square, and that of
windows of l = 1/16 and 1/8 of the log by the same candidate, 1 + (r_l - 1) L / l at a length of L,
where r_l over 1 is what noise of longer memory than l adds, and goes on adding at worst.  Of those
that are clear the likeliest is told, each figure paid for, in the white noise that the best of them
leaves: the slow noise that windows of a wrong candidate do not see makes it no likelier.
Source: one change point by the likelihood ratio, Hinkley, Biometrika 57 (1970).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.stretch_fits import Hit
from syncline_design.diagnosis.stretch_windows import BlockSums, log_chi2, squares
from syncline_design.machine.quick_dataclass import dataclass

SHORTEST, LONGEST = 0.1, 0.6  # of the log: shorter ones are windows, longer ones leave too little
WINDOWS: Final = (16, 8)  # side by side
SURE: Final = 1e-4  # chance of as much in white noise, paid for, from which on it is held on


@dataclass(frozen=True, slots=True)
class _Clear:
    """A change that is clear: its square over the spec's noise, and what is left of one row's."""

    hit: Hit
    square: float
    white: float

    def nats(self, white: float, rows: float) -> float:
        """Saved in noise of a variance, half of log N paid for each figure (Schwarz 1978)."""
        figures = float(self.hit.signature.columns.shape[2])
        return 0.5 * self.square / white - 0.5 * figures * math.log(rows)


def once_changed(found: Sequence[tuple[Signature, BlockSums]]) -> Hit | None:
    """The likeliest change of all candidates that do not come and go; None where none is clear."""
    built_in = [(s, sums) for s, sums in found if not s.candidate.effect.passing]
    clear = [one for s, sums in built_in if (one := _clearest(s, sums, len(built_in))) is not None]
    if not clear:
        return None
    white = min(one.white for one in clear)
    rows = max(max(float(sums.count[-1]) for _, sums in built_in), 1.0)
    return max(clear, key=lambda one: one.nats(white, rows)).hit


def _clearest(s: Signature, sums: BlockSums, asked: int) -> _Clear | None:
    blocks, width = len(sums.first) - 1, s.columns.shape[2]
    shortest, longest = max(round(SHORTEST * blocks), 1), math.floor(LONGEST * blocks)
    lengths = np.arange(shortest, longest + 1)
    if not lengths.size:
        return None
    first = np.concatenate([np.zeros(len(lengths), int), blocks - lengths])
    last = np.concatenate([lengths, np.full(len(lengths), blocks)])
    normal, score = sums.normal, sums.score[:, :1]
    inside, told = normal[last] - normal[first], score[last] - score[first]
    own, seen = squares(inside, told, width)
    rest, _ = squares(normal[-1] - inside, score[-1] - told, width)
    freedom = max(float(sums.count[-1]) - 2.0 * width, 1.0)
    left = np.maximum(sums.square[-1] - own[:, 0] - rest[:, 0], 0.0) / freedom
    white = np.maximum(left, 1.0)
    log_p = log_chi2(own[:, 0] / white, width) + math.log(2.0 * len(lengths) * asked)
    at = int(np.argmin(np.where(seen, log_p, 0.0)))
    if not seen[at] or log_p[at] > math.log(SURE):
        return None
    scale2 = max(float(white[at]), _slow(sums, int(first[at]), int(last[at]), width))
    clear = float(log_chi2(own[at : at + 1, 0] / scale2, width)[0])
    clear += math.log(2.0 * len(lengths) * asked)
    if clear > math.log(SURE):
        return None
    from_s = float(sums.time_s[sums.first[first[at]]])
    to_s = float(sums.time_s[sums.first[last[at]] - 1])
    hit = Hit(from_s, to_s, clear, scale2, s)
    return _Clear(hit, float(own[at, 0]), float(white[at]))


def _slow(sums: BlockSums, first: int, last: int, width: int) -> float:
    """Square of a stretch over that of white noise, by what short windows show without it."""
    blocks = len(sums.first) - 1
    score = np.diff(sums.score[:, 0], axis=0)
    normal = np.diff(sums.normal, axis=0)
    inside = (np.arange(blocks) >= first) & (np.arange(blocks) < last)
    for part in (inside, ~inside):
        told = np.linalg.pinv(normal[part].sum(0), hermitian=True) @ score[part].sum(0)
        score[part] -= normal[part] @ told
    worst = 1.0
    for parts in WINDOWS:
        edges = np.round(np.linspace(0, blocks, parts + 1)).astype(int)[:-1]
        own, seen = squares(np.add.reduceat(normal, edges),
                            np.add.reduceat(score, edges)[:, None], width)  # fmt: skip
        shown = float(np.mean(own[seen, 0])) / width if np.any(seen) else 1.0
        worst = max(worst, 1.0 + (shown - 1.0) * (last - first) * parts / blocks)
    return worst
