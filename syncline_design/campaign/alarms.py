"""Changes that were seen, as the alarms that `watch` tells: one a parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.pool import Term
from syncline_design.campaign.seen import Seen
from syncline_design.campaign.store import Entry
from syncline_design.campaign.watch_result import Alarm, Drift, Since, e_value_text
from syncline_design.diagnosis.finding import estimate
from syncline_design.diagnosis.result import Other
from syncline_design.model.figure_text import to_digits
from syncline_design.model.normal import NORMAL_95

SHOWN: Final = 3.0  # standard uncertainties from which a parameter of a changed effect is told


def alarms_of(
    one: Seen, runs: Sequence[Entry], stage: Callable[[int], str], rate: float
) -> Iterator[Alarm]:
    """An alarm for each parameter of an effect that clearly changed; at least the clearest.

    Of a drift, the change is what it came to by the last of the runs.
    """
    change, slopes = one.change, one.change.term.effect.slopes()
    grown = float(change.trend.over(len(runs))[-1])
    spread = np.sqrt(np.maximum(np.diag(change.covariance + one.dating), 0.0))
    whole = np.sqrt(np.maximum(np.diag(grown**2 * change.covariance + one.dating_now), 0.0))
    size = np.abs(change.values) / np.where(spread > 0.0, spread, np.inf)
    for k in np.argsort(-size):
        if size[k] < SHOWN and k != np.argmax(size):
            continue
        drift = None
        if change.trend.kind == "drift":
            each, own = float(change.values[k]), float(spread[k])
            until = change.trend.until
            last = runs[-1 if until is None else until - 1].number
            text = estimate(each, own, slopes[k].unit).text
            drift = Drift(each, own, text, last, None if until is None else True)
        value, sigma = grown * float(change.values[k]), float(whole[k])
        given = grown * float(np.sqrt(max(change.covariance[k, k], 0.0)))
        if NORMAL_95 * given < abs(value) <= NORMAL_95 * sigma:
            sigma = given  # which run is the first has an interval of its own
        half = NORMAL_95 * sigma
        e_value = math.exp(min(one.log_evidence, 690.0))
        yield Alarm(
            effect=change.term.effect.name,
            sensor=change.term.sensor,
            stage=stage(change.term.stage),
            parameter=slopes[k].name,
            change=value,
            standard_uncertainty=sigma,
            interval95=(value - half, value + half),
            unit=slopes[k].unit,
            text=estimate(value, sigma, slopes[k].unit).text,
            since=since_of(runs, change.k, one.low, one.high),
            evidence=f"e-value {e_value_text(e_value)}, alarm from {to_digits(1.0 / rate, 3)} on",
            e_value=e_value,
            first_run=max(runs[k].number for k in (one.first_look - 1, change.k)),
            aliases=others_of(one.others, stage),
            drift=drift,
        )


def others_of(
    others: Sequence[tuple[Term, float]], stage: Callable[[int], str]
) -> tuple[Other, ...]:
    """Effects that explain the same as well, by how many nats less."""
    return tuple(Other(*term.label[:2], stage(term.stage), worse) for term, worse in others)


def since_of(runs: Sequence[Entry], at: int, low: int, high: int) -> Since:
    """The first run of a change, and between which it lies, by their places."""
    run, first, last = (runs[k] for k in (at, low, high))
    return Since(run.number, run.run.files[0], run.run.date, first.number, last.number,
                 first.run.date, last.run.date)  # fmt: skip
