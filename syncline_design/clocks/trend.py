"""Whether sessions are alike: those of a clock that runs off from one to the next are not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.clocks.sessions import ClockSession
from syncline_design.clocks.times import shown
from syncline_design.model.figure_text import rounded, to_digits

CHANCE: Final = 0.005  # with which sessions that are alike are said to run off
MATERIAL: Final = 0.2  # of the bound: how far over all sessions, to be worth a word
RUN_OFF: Final = "the sessions run off"  # how the note begins
_FEWEST: Final = 6  # whose order can be as unlikely as that: 2 / 6! = 0.003


def running_off(counted: Sequence[ClockSession], bound_s: float | None) -> str | None:
    """In words, where the sessions' medians rise or fall with time; None where they do not.

    By Kendall's rank correlation of median and order (Mann 1945), exact where no two are the same.
    Stamps since boot have no order.
    """
    from scipy.stats import kendalltau

    if bound_s is None or len(counted) < _FEWEST or counted[0].series.kind.stamps != "utc":
        return None
    medians = np.array([np.median(s.offsets) for s in counted])
    order = np.arange(len(medians))
    later, earlier = np.triu_indices(len(medians), 1)[::-1]
    slope = float(np.median((medians[later] - medians[earlier]) / (later - earlier)))
    if abs(slope) * (len(medians) - 1) <= MATERIAL * bound_s:
        return None
    chance = float(kendalltau(order, medians).pvalue)
    if not chance < CHANCE:
        return None
    return (f"{RUN_OFF}: from one to the next their medians move by "
            f"{shown(rounded(slope, 2))} or so, and alike ones would stand in such an order with a "
            f"chance of {to_digits(chance, 1)}; the claim takes them for alike, so it is for none "
            "much later than these")  # fmt: skip
