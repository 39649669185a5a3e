"""Other effects that may take what is asked of a drive, left free one at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.information import Unknown, covariance_of
from syncline_design.planning.wanted import Goal

INSEPARABLE: Final = 20.0  # times wider: what no drive of the library tells apart
HARDLY: Final = 5.0  # the same of a sigma that is asked: to hold it would take the drive too long
WIDENED: Final = 3.0  # times that one other effect may widen a sigma that is not asked
TWICE: Final = 2.0  # times what is asked that it may leave
VAGUE: Final = 30.0  # times the prior: of what a search has not seen yet
_Places = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]


@dataclass(frozen=True, slots=True)
class Others:
    """Effects besides those asked for, one by one: where their parameters stand (f, 3), -1 where
    there are fewer, and by how much each may widen the sigmas of what is wanted (f, w)."""

    index: NDArray[np.int64]
    limit: Array

    _known: dict[tuple[int, ...], _Places] = field(default_factory=dict, repr=False, compare=False)

    def widened(self, information: Array, wanted: Sequence[int], vague: Array) -> Array:
        """Sigmas (f, w) of what is wanted with each other effect free."""
        every, known, both = self._places(tuple(wanted))
        parts = np.where(both, information[every[:, :, None], every[:, None, :]], 0.0)
        diagonal = np.einsum("fii->fi", parts)
        diagonal += np.where(known, vague[every] ** -2.0, 1.0)
        scale = np.sqrt(diagonal)
        inverse = np.linalg.inv(parts / scale[:, :, None] / scale[:, None, :])
        variance = np.einsum("fii->fi", inverse) / scale**2
        return np.asarray(np.sqrt(np.maximum(variance[:, : len(wanted)], 0.0)))

    def _places(self, wanted: tuple[int, ...]) -> _Places:
        """Where what is wanted and each other effect stand (f, w + 3), which of these there are,
        and which pairs of them; a search asks for the same again and again."""
        found = self._known.get(wanted)
        if found is None:
            count = self.index.shape[0]
            every = np.concatenate([np.tile(wanted, (count, 1)), self.index], axis=1)
            known = every >= 0
            found = every, known, known[:, :, None] & known[:, None, :]
            self._known[wanted] = found
        return found

    def some(self, kept: NDArray[np.bool_], limit: Array) -> Others:
        """Some of them, with limits of their own."""
        return Others(self.index[kept], limit[kept])


def others_of(
    every: Sequence[Unknown], goal: Goal, library: Array, prior: Array, held: Sequence[int] = ()
) -> tuple[Others, Others]:
    """The other effects that some drive tells from what is wanted, and those that none tells from
    some of it, or hardly: these have to be known otherwise.  library: all legs together.  held:
    places of what is known as a reference, which is no other effect."""
    index = _index(every, {every[k].candidate.label for k in (*goal.wanted, *held)})
    found = Others(index, np.zeros((0, 0)))
    if not len(index):
        none = Others(index, np.zeros((0, len(goal.wanted))))
        return none, none
    wanted = list(goal.wanted)
    covariance, _ = covariance_of(library[np.ix_(wanted, wanted)], VAGUE * prior[wanted])
    inflation = found.widened(library, wanted, VAGUE * prior) / np.sqrt(np.diag(covariance))
    asked = np.isfinite(goal.tolerance)
    told = inflation < np.where(asked, HARDLY, INSEPARABLE)
    limit = np.where(told & ~goal.only_rival, np.maximum(WIDENED, 1.5 * inflation), np.inf)
    paired = {k for pair in goal.pairs for k in (*pair.first, *pair.second)}
    # what is part of a pair says itself whether it is told
    beside = np.array([int(k) not in paired for k in index[:, 0]])
    untold = np.where(~told & ~goal.only_rival & beside[:, None], WIDENED, np.inf)
    return (
        found.some(np.any(np.isfinite(limit), axis=1), limit),
        found.some(np.any(np.isfinite(untold), axis=1), untold),
    )


def _index(every: Sequence[Unknown], asked: set[tuple[str, str, int]]) -> NDArray[np.int64]:
    """Where the parameters of each effect that is not asked for stand (f, n), -1 for none."""
    places: dict[tuple[str, str, int], list[int]] = {}
    for k, one in enumerate(every):
        if one.candidate.label not in asked:
            places.setdefault(one.candidate.label, []).append(k)
    width = max((len(found) for found in places.values()), default=1)
    rows = [[*found, *[-1] * (width - len(found))] for found in places.values()]
    return np.array(rows, dtype=np.int64).reshape(-1, width)


def taken_by(
    others: Others, goal: Goal, information: Array, prior: Array
) -> dict[int, dict[int, float]]:
    """What is wanted that other effects, each as large as is plausible, would leave beyond twice
    what is asked, or beyond their limit: by the first place of the effect, the sigma of each.  The
    effect first that leaves most, over what it may.

    Of what is wanted itself next to nothing is known before: a tolerance near what is plausible
    would be held by that alone.
    """
    wanted = list(goal.wanted)
    if not len(others.index):
        return {}
    covariance, _ = covariance_of(information[np.ix_(wanted, wanted)], VAGUE * prior[wanted])
    sigma = np.sqrt(np.diag(covariance))
    before = prior.copy()
    before[wanted] *= VAGUE
    left = others.widened(information, wanted, before)
    asked = np.isfinite(goal.tolerance)
    most = np.where(asked, TWICE * goal.tolerance, others.limit * sigma)
    beyond = np.isfinite(others.limit) & (left > most)
    harm = np.max(np.where(beyond, left / most, 0.0), axis=1)
    return {
        int(others.index[row, 0]): {
            wanted[k]: float(left[row, k]) for k in np.flatnonzero(beyond[row])
        }
        for row in map(int, np.argsort(-harm, kind="stable"))
        if harm[row] > 0.0
    }
