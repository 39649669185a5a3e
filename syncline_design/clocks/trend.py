"""Whether sessions are alike: not those of a clock that runs off, grows worse, or remembers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.clocks.series import Array
from syncline_design.clocks.sessions import ClockSession
from syncline_design.clocks.times import shown
from syncline_design.clocks.tolerance import LEAST_SESSIONS
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import percent, rounded, to_digits

CHANCE: Final = 0.005  # with which sessions that are alike are said to run off
MATERIAL: Final = 0.2  # of the largest session: how far over all of them, to be worth a word
CHANCE_OF_GROWTH: Final = 0.01
MATERIAL_GROWTH: Final = 0.05  # of the largest session, over all of them
CHANCE_OF_MEMORY: Final = 0.01  # of the medians, and as much of the sessions' figures
RUN_OFF: Final = "the sessions run off"  # how the note begins
GROW: Final = "the sessions grow worse"
REMEMBER: Final = "the sessions remember one another"
_FEWEST: Final = 6  # whose order can be as unlikely as that: 2 / 6! = 0.003
_FEWEST_GROWING: Final = 5  # 1 / 5! = 0.008


@dataclass(frozen=True, slots=True)
class SessionCourse:
    """What the order of sessions tells; in words, None where it tells nothing.

    effective: as many sessions as these say as much as, were they independent of one another.
    """

    runs_off: str | None = None
    grows: str | None = None
    remembers: str | None = None
    effective: float = math.inf

    @classmethod
    def of(cls, counted: Sequence[ClockSession], figures: Array, coverage: float) -> SessionCourse:
        """Of sessions; stamps since boot have no order."""
        if not counted or counted[0].series.kind.stamps != "utc":
            return cls()
        return cls.of_figures(np.array([np.median(s.offsets) for s in counted]), figures, coverage)

    @classmethod
    def of_figures(cls, medians: Array, figures: Array, coverage: float) -> SessionCourse:
        """Of sessions in their order; figures: the |offset| that each keeps for the share
        `coverage` of its time."""
        if len(figures) < _FEWEST_GROWING:
            return cls()
        largest = float(np.max(figures))
        remembers, effective = _memory(medians, figures)
        return cls(_running_off(medians, largest), _growing(figures, largest, coverage),
                   remembers, effective)  # fmt: skip

    @property
    def forbids(self) -> str | None:
        """Why nothing can be claimed of future sessions; None where something can."""
        if self.grows is not None:
            return self.grows
        few = self.effective < LEAST_SESSIONS
        return (self.runs_off or self.remembers) if few else None

    @property
    def reservations(self) -> list[str]:
        """What keeps a bound of these sessions from being one of later sessions."""
        return [said for said in dict.fromkeys((self.forbids, self.runs_off)) if said is not None]

    @property
    def words(self) -> list[str]:
        """What has to be said beside the claim."""
        found = (self.runs_off, self.grows, self.remembers)
        return [said for said in found if said is not None and said != self.forbids]


def _slope(values: Array) -> float:
    """Median of all slopes between two sessions, a session (Theil 1950; Sen 1968)."""
    later, earlier = np.triu_indices(len(values), 1)[::-1]
    return float(np.median((values[later] - values[earlier]) / (later - earlier)))


def _running_off(medians: Array, largest: float) -> str | None:
    """By Kendall's rank correlation of median and order (Mann 1945), exact where no two are the
    same."""
    from scipy.stats import kendalltau

    slope = _slope(medians)
    if len(medians) < _FEWEST or abs(slope) * (len(medians) - 1) <= MATERIAL * largest:
        return None
    chance = float(kendalltau(np.arange(len(medians)), medians).pvalue)
    if not chance < CHANCE:
        return None
    return (f"{RUN_OFF}: from one to the next their medians move by "
            f"{shown(rounded(slope, 2))} or so, and alike ones would stand in such an order with a "
            f"chance of {to_digits(chance, 1)}; a bound of these is for none much later than "
            "these")  # fmt: skip


def _growing(figures: Array, largest: float, coverage: float) -> str | None:
    """As `_running_off`, of what is claimed itself, and of its growth alone: what falls is within
    the bound."""
    from scipy.stats import kendalltau

    slope = _slope(figures)
    if slope * (len(figures) - 1) <= MATERIAL_GROWTH * largest:
        return None
    found = kendalltau(np.arange(len(figures)), figures, alternative="greater")
    chance = float(found.pvalue)
    if not chance < CHANCE_OF_GROWTH:
        return None
    return (f"{GROW}: what one keeps to for {percent(coverage, 6)} of its time grows by "
            f"{shown(rounded(slope, 2))} or so from one to the next, and alike ones would stand in "
            f"such an order with a chance of {to_digits(chance, 1)}; no bound of these is one of "
            "later ones")  # fmt: skip


def _memory(medians: Array, figures: Array) -> tuple[str | None, float]:
    """Whether one session resembles the one before it, and what all are worth then.

    n (1 - r) / (1 + r) independent ones (Bayley and Hammersley 1946), r the rank correlation of one
    with the next, less small for its bias of (1 + 4 r) / n (Kendall 1954).
    """
    count, found = len(medians), []
    for name, values in (("medians", medians), ("figures", figures)):
        ratio, chance = neumann_ratio(values)
        if chance < CHANCE_OF_MEMORY:
            found.append((1.0 - ratio / 2.0, name, chance))
    if not found:
        return None, math.inf
    r, name, chance = max(found)
    corrected = min(r + (1.0 + 4.0 * r) / count, 0.999)
    effective = max(1.0, count * (1.0 - corrected) / (1.0 + corrected))
    return (f"{REMEMBER}: the {name} of one and the next correlate by {to_digits(r, 2)}, as those "
            f"of independent ones do with a chance of {to_digits(chance, 1)}; {count} of them say "
            f"as much as {to_digits(effective, 2)} independent ones"), effective  # fmt: skip


def neumann_ratio(values: Array) -> tuple[float, float]:
    """Rank version of von Neumann's ratio, and the chance of one as small without memory.

    Sum of squared differences of successive ranks over that of ranks about their mean: 2 without
    memory, with a variance of 4 (n - 2)(5 n^2 - 2 n - 9) / (5 n (n + 1)(n - 1)^2) (Bartels 1982).
    """
    from scipy.special import ndtr
    from scipy.stats import rankdata

    n = len(values)
    ranks = rankdata(values)
    square = float(np.sum((ranks - np.mean(ranks)) ** 2))
    if not square > 0.0:
        return 2.0, 1.0
    ratio = float(np.sum(np.diff(ranks) ** 2)) / square
    variance = 4.0 * (n - 2) * (5 * n * n - 2 * n - 9) / (5.0 * n * (n + 1) * (n - 1) ** 2)
    return ratio, float(ndtr((ratio - 2.0) / math.sqrt(variance)))
