"""The Monte Carlo part of a verdict or a simulation: facts, quantiles, distribution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from syncline_design.report import numbers
from syncline_design.report.document import Chart, Node
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import Json, named, part
from syncline_design.report.words import ENVELOPES

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineFigure

BEYOND: Final = (
    "Samples exceed a sum of one-sigma terms often (39 % of them where position noise is all there "
    "is) and do not contradict the Syncline."
)


def simulation_facts(monte_carlo: Json) -> list[tuple[str, str]]:
    """Samples, envelope, probability and worst case of a Monte Carlo part."""
    envelope = str(monte_carlo.get("envelope"))
    facts = [
        ("Samples", numbers.count(monte_carlo.get("samples"))),
        ("Motion", ENVELOPES.get(envelope, envelope)),
        ("Seed", str(monte_carlo.get("seed", numbers.MISSING))),
    ]
    within = part(monte_carlo, "probability_within_target")
    if within.get("value") is not None:
        low, high = (numbers.percent(within.get(key), 5) for key in ("low", "high"))
        shown = numbers.percent(within["value"], 5)
        label = f"Within the target of {numbers.length(within.get('target_m'))}"
        facts.append((label, f"{shown} (95 %: {low} to {high})"))
    worst = part(monte_carlo, "worst_case")
    if worst.get("value_m") is not None:
        ratio = numbers.percent(worst.get("ratio_to_syncline"))
        shown = numbers.length(worst["value_m"])
        facts.append(("Worst case found", f"{shown}, {ratio} of the Syncline"))
    if part(worst, "certificate"):
        facts.append(("Upper bound", numbers.length(worst.get("bound_m"))))
    return facts


def certificate(monte_carlo: Json) -> str:
    """For what the upper bound holds, as a sentence."""
    told = part(part(monte_carlo, "worst_case"), "certificate").get("text")
    return _sentence(str(told)) if told else ""


def ensemble(monte_carlo: Json) -> str:
    """Over what the quantiles run, as a sentence."""
    told = part(monte_carlo, "ensemble").get("text")
    return _sentence(str(told)) if told else ""


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}."


def quantiles(monte_carlo: Json) -> Table:
    """Quantiles of the simulated error with their confidence intervals."""
    rows = []
    for key, entry in named(monte_carlo, "quantiles"):
        rows.append((
            Cell(numbers.percent(float(key), 4), float(key)),
            Cell(numbers.length(entry.get("value_m")), numbers.finite(entry.get("value_m"))),
            _interval(entry),
        ))  # fmt: skip
    confidence = numbers.percent(monte_carlo.get("confidence") or 0.95)
    heads = ("Quantile", "Error #", f"{confidence} confidence interval")
    return table("Quantiles of the simulated error", heads, rows)


def _interval(entry: Json) -> str:
    """Both ends; of an interval from few samples the upper one may be unknown."""
    low, high = numbers.length(entry.get("low_m")), entry.get("high_m")
    return f"{low} or more" if high is None else f"{low} to {numbers.length(high)}"


def span(first: str, last: str) -> str:
    """Two ends as words; the same ones once."""
    return first if first == last else f"{first} to {last}"


def histogram_chart(monte_carlo: Json, syncline_m: float | None) -> list[Node]:
    """The distribution of the simulated error, where it was kept."""
    found = part(monte_carlo, "histogram")
    edges = [numbers.finite(edge) for edge in found.get("edges_m") or ()]
    density = tuple(numbers.finite(value) or 0.0 for value in found.get("density") or ())
    known = tuple(edge for edge in edges if edge is not None)
    if not len(known) == len(edges) == len(density) + 1 > 1:
        return []
    target = numbers.finite(part(monte_carlo, "probability_within_target").get("target_m"))
    marks = tuple(
        (numbers.percent(float(key), 4), value)
        for key, entry in named(monte_carlo, "quantiles")
        if (value := numbers.finite(entry.get("value_m"))) is not None
    )

    def draw() -> InlineFigure:
        from syncline_design.report.figures_results import Histogram, error_histogram

        return error_histogram(Histogram(known, density, marks, target, syncline_m))

    caption = (
        "Density of the error of the simulated samples, with quantiles, target and Syncline where "
        "known."
    )
    return [Chart("histogram", draw, caption)]
