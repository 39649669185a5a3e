"""Which effects runs together show as constants, and how free each of them then is (`changes`)."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.campaign.column_sizes import column_sizes
from syncline_design.campaign.hermitian import eigen
from syncline_design.campaign.pool import Index
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

PLAUSIBLE: Final = 2.0  # standard deviations within which a constant is that no run shows
SHOWN_NATS: Final = 2.0  # beyond one a parameter, from which runs show a constant
ANOTHER: Final = 1e-3  # share of its information that a constant has apart from those shown
NO_INFORMATION: Final = 1e-10


@dataclass(frozen=True, slots=True)
class Constant:
    """An effect that runs show (its place among all), its parameters, and the prior information of
    those of its directions (p, p) that are one with what was shown before."""

    term: int
    index: Index
    prior: Array


@dataclass(frozen=True, slots=True)
class Apart:
    """What effects of one size have apart from others, by their own directions: turn (G, p, p), its
    columns of one unit of own information each, and share (G, p), what is left of that unit."""

    turn: Array
    share: Array

    @property
    def another(self) -> Array:
        """1 / share of the directions that are another thing than the others, else 0, (G, p)."""
        found = self.share > ANOTHER
        return np.where(found, 1.0 / np.where(found, self.share, 1.0), 0.0)


def shown_constants(
    total: Array, score: Array, groups: tuple[tuple[Index, Index], ...], inside: Array
) -> list[Constant]:
    """Effects that runs of information (P, P) and score (P,) show: forward, what gains most first.

    As many as they show: after a hundred runs it may be every one that is not 0, and of those that
    are not taken for constants a day that is driven otherwise makes a change.

    groups: places (G,) and parameters (G, p) of the effects of a size; inside (C,) their variance.
    The slopes of a run are those where its own search ended.  Two effects that are one to first
    order (a latency and a filter's lag) so differ a little where a change was named, and none
    elsewhere: both free, huge values of either sign would stand for the change as constants.
    """
    found = list[Constant]()
    whole = [blocks_of(_blocks(total, index)) for _, index in groups]
    while True:
        best, at, least = None, 0, SHOWN_NATS
        for (terms, index), own in zip(groups, whole, strict=True):
            apart = own.apart(_blocks(total, index))
            along = np.einsum("gap,ga->gp", apart.turn, score[index])
            gains = 0.5 * np.sum(along**2 * apart.another, axis=1) / inside[terms] - index.shape[1]
            for one in found:
                gains[terms == one.term] = 0.0
            k = int(np.argmax(gains))
            if gains[k] >= least:
                best, at, least = (terms, index, apart, own), k, float(gains[k])
        if best is None:
            return found
        terms, index, apart, own = best
        place, turn, another = index[at], apart.turn[at], apart.another[at]
        held = held_of(own.information[at], turn, another)
        found.append(Constant(int(terms[at]), place, held))
        inverse = (turn * another) @ turn.T
        across = total[:, place]
        score = score - across @ (inverse @ score[place])
        total = total - across @ inverse @ total[place]


def _blocks(total: Array, index: Index) -> Array:
    return np.asarray(total[index[..., :, None], index[..., None, :]])


def held_of(own: Array, turn: Array, another: Array) -> Array:
    """Prior information of the directions that are no other thing: as of what no run shows."""
    alike = own @ turn[:, another == 0.0]
    return np.asarray(alike @ alike.T / PLAUSIBLE**2)


@dataclass(frozen=True, slots=True)
class AloneOfSize:
    """Information of effects of one size alone (G, p, p), the sizes of its columns, their products,
    and its inverse root in columns of size 1: made once, and held against whatever is freed."""

    information: Array
    scale: Array
    squares: Array
    root: Array

    def apart(self, left: Array) -> Apart:
        """left (G, p, p): the information with those shown freed."""
        inner = np.swapaxes(self.root, 1, 2) @ (left / self.squares) @ self.root
        share, turned = eigen(0.5 * (inner + np.swapaxes(inner, 1, 2)))
        return Apart((self.root @ turned) / self.scale[:, :, None], share)


def blocks_of(own: Array) -> AloneOfSize:
    """own (G, p, p): information of effects alone."""
    scale = column_sizes(np.einsum("gaa->ga", own))
    squares = scale[:, :, None] * scale[:, None, :]
    values, vectors = eigen(own / squares)
    seen = values > NO_INFORMATION
    root = vectors * np.where(seen, np.where(seen, values, 1.0) ** -0.5, 0.0)[:, None, :]
    return AloneOfSize(own, scale, squares, root)
