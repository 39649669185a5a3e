"""The Monte Carlo part of a verdict or a simulation: facts, quantiles, distribution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from syncline_design.report import numbers
from syncline_design.report.document import Chart, Node
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.words import ENVELOPES

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart
    from syncline_design.simulation.results import Along, MonteCarlo, QuantileEstimate

EVEN: Final = 1.1  # largest over smallest error along a trajectory up to which it is called even
ALL: Final = 0.999  # share from which four figures no longer tell it from all
BEYOND: Final = (
    "Samples exceed a sum of one-sigma terms often (39 % of them where position noise is all there "
    "is) and do not contradict the Syncline."
)


def simulation_facts(found: MonteCarlo) -> list[tuple[str, str]]:
    """Samples, envelope, probability and worst case of a Monte Carlo part."""
    facts = [
        ("Samples", numbers.count(found.samples)),
        ("Motion", ENVELOPES[found.envelope]),
        ("Seed", str(found.seed)),
    ]
    for stage, distance in (found.distances_m or {}).items():
        end = f"{numbers.length(distance)}, the end of {stage}'s distances with the larger errors"
        facts.append(("Distance simulated", end))
    within, worst = found.probability_within_target, found.worst_case
    if within is not None:
        digits = 4 if within.high < ALL else 5
        told, low, high = (
            numbers.percent(share, digits) for share in (within.value, within.low, within.high)
        )
        label = f"Within the limit of {numbers.limit(within)}"
        facts.append((label, f"{told} (95 %: {low} to {high})"))
    ratio = numbers.percent(worst.ratio_to_syncline)
    return [
        *facts,
        ("Worst case found", f"{numbers.error(worst.value_m, within)}, {ratio} of the Syncline"),
        ("Upper bound", numbers.error(worst.bound_m, within)),
    ]


def certificate(found: MonteCarlo) -> str:
    """For what the upper bound holds, as a sentence."""
    return _sentence(found.worst_case.certificate.text)


def ensemble(found: MonteCarlo) -> str:
    """Over what the quantiles run, as a sentence."""
    return _sentence(found.ensemble.text)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}."


def quantiles(found: MonteCarlo) -> Table:
    """Quantiles of the simulated error with their confidence intervals."""
    within = found.probability_within_target
    rows = [
        (
            Cell(numbers.percent(float(key), 4), float(key)),
            Cell(numbers.error(entry.value_m, within), numbers.finite(entry.value_m)),
            _interval(entry, within),
        )
        for key, entry in found.quantiles.items()
    ]
    confidence = numbers.percent(found.confidence)
    heads = ("Quantile", "Error #", f"{confidence} confidence interval #")
    return table("Quantiles of the simulated error", heads, rows)


def _interval(entry: QuantileEstimate, limit: numbers.Limited | None) -> str:
    """Both ends; of an interval from few samples the upper one may be unknown."""
    low, high = numbers.error(entry.low_m, limit), numbers.finite(entry.high_m)
    return f"{low} or more" if high is None else f"{low} to {numbers.error(high, limit)}"


def span(first: str, last: str) -> str:
    """Two ends as words; the same ones once."""
    return first if first == last else f"{first} to {last}"


def histogram_chart(found: MonteCarlo, syncline_m: float | None, mission: str = "") -> list[Node]:
    """The distribution of the simulated error; mission: a sentence on whose it is."""
    bins, within = found.histogram, found.probability_within_target
    marks = tuple(
        (numbers.percent(float(key), 4), entry.value_m)
        for key, entry in found.quantiles.items()
        if numbers.finite(entry.value_m) is not None
    )

    def draw() -> InlineChart:
        from syncline_design.report.charts_distribution import DensityBars, error_histogram

        return error_histogram(DensityBars(bins.edges_m, bins.density, marks, within, syncline_m))

    caption = (
        "Density of the error of the simulated samples, with quantiles, limit and Syncline where "
        "known."
    )
    return [Chart("histogram", draw, caption + mission)]


def along_chart(found: MonteCarlo) -> list[Node]:
    """The trajectory of a file from above, with the errors along it."""
    along, within = found.along, found.probability_within_target
    if along is None:
        return []

    def draw() -> InlineChart:
        from syncline_design.report.charts_ways import errors_along

        return errors_along(along, within)

    return [Chart("along", draw, _along_words(along, within))]


def _along_words(along: Along, limit: numbers.Limited | None) -> str:
    """How the errors differ from stretch to stretch, and how the largest are flown."""
    sizes = [one.quantile95_m for one in along.stretches]
    low, high = (numbers.error(end, limit, 3) for end in (min(sizes), max(sizes)))
    lead = (
        f"The trajectory from above. Each of {len(sizes)} stretches of equal time is as wide as "
        f"what 95 % of its simulated errors are within ({numbers.count(along.samples)} samples). "
    )
    most = along.largest
    over = f" over {numbers.length(most.distance_m, 3)}" if most.distance_m else ""
    motion = (
        f"{numbers.speed(most.speed_mps, 3)} and "
        f"{numbers.si_quantity(most.turn_rate_radps, 'rad/s', 3)}{over}"
    )
    when = numbers.from_to(most.from_s, most.to_s)
    told = f"Largest from {when}: {high}, at {motion}; smallest: {low}."
    if max(sizes) <= EVEN * min(sizes):
        told = f"It is even: {span(low, high)} all along."
    beyond = 0 if limit is None else sum(size > limit.limit for size in sizes)
    if limit is not None and beyond:
        told += f" {beyond} of {len(sizes)} exceed the limit of {numbers.limit(limit)}."
    return lead + told
