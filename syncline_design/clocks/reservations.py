"""What keeps logs from bearing a bound out, though a claim may be made of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.clocks.sessions import LEAST_SAMPLES, ClockSession
from syncline_design.clocks.times import moment, shown
from syncline_design.model.figure_text import rounded, to_digits

_FAST: Final = 5e-6  # change of rate [s/s]: more than crystals do from one sample to the next
_UNSEEN: Final = 0.1  # of what such a change brings until the next sample


def reservations(sessions: Sequence[ClockSession]) -> list[str]:
    """Every one a sentence without its stop."""
    return [*_overlapping(sessions), *_of_another_rate(sessions)]


def _overlapping(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """Two sessions with dates at the same time: one clock has one session at a time."""
    spans = sorted((float(s.series.time_s[0]), float(s.series.time_s[-1]))
                   for s in sessions if s.series.kind.stamps == "utc")  # fmt: skip
    if any(after[0] < before[1] for before, after in itertools.pairwise(spans)):
        yield (
            "sessions overlap in time: if these are several clocks, the claim is for such "
            "clocks together"
        )


def _of_another_rate(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """A rate that changes at once without an offset: it is the reference that changed its own.

    A clock whose own rate changed would have been off by the change times the interval.
    """
    for session in sessions:
        rows = session.steady & np.isfinite(session.series.rate)
        times, rates = session.series.time_s[rows], session.series.rate[rows]
        if rates.shape[0] <= LEAST_SAMPLES:
            continue
        jumps, sizes = np.diff(rates), np.abs(session.series.offset_s[rows])
        brought = np.abs(jumps) * np.diff(times)
        seen = np.maximum(sizes[1:], sizes[:-1])
        found = (np.abs(jumps) >= _FAST) & (seen <= _UNSEEN * brought)
        found[:LEAST_SAMPLES] = False  # a start that finds its rate
        if np.any(found):
            k = int(np.argmax(found))
            yield (f"{session.series.kind.name}: at "
                   f"{moment(float(times[k + 1]), session.series.kind.stamps)} its rate changes by "
                   f"{to_digits(1e6 * abs(float(jumps[k])), 3)} ppm, which would have brought "
                   f"{shown(rounded(float(brought[k]), 2))} until the next sample and did not: "
                   "the reference changed its rate (a smeared leap second?), and may be off UTC "
                   "by up to 0.5 s meanwhile")  # fmt: skip
            return
