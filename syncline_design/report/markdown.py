"""Markdown for a pull request comment or a job summary."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.report import numbers, verdict_tables
from syncline_design.report.ci import no_design_text, spec_file, spec_name
from syncline_design.report.table import Table
from syncline_design.report.text import markdown_safe
from syncline_design.report.verdict_words import Json, design_sentence, items, outcome, part


def render_markdown(verdicts: Sequence[Json]) -> str:
    """Every verdict: outcome, design, requirements, payload, warnings."""
    return "\n".join(_one(verdict) for verdict in verdicts)


def _one(verdict: Json) -> str:
    result = outcome(verdict)
    lines = [
        f"## {result.mark} {markdown_safe(spec_name(verdict))}: {markdown_safe(result.word)}",
        "",
    ]
    if part(verdict, "design"):
        lines += [markdown_safe(design_sentence(verdict)), "", _price(verdict)]
    else:
        lines += [markdown_safe(no_design_text(verdict)), ""]
    for entry in items(verdict, "problems"):
        place = f"{entry.get('file') or spec_file(verdict)}:{entry.get('line')}"
        lines.append(f"- {markdown_safe(place)}: {markdown_safe(entry.get('message'))}")
    if items(verdict, "requirements"):
        lines.append(markdown_table(verdict_tables.requirements(verdict)))
    if next(verdict_tables.roles(verdict), None) is not None:
        lines.append(markdown_table(verdict_tables.payload(verdict)))
        lines.append(markdown_table(verdict_tables.taus(verdict)))
    lines += [f"- {markdown_safe(text)}" for text in _simulated_over(verdict)]
    for entry in items(verdict, "warnings"):
        code = markdown_safe(entry.get("code") or "warning")
        lines.append(f"- Warning ({code}): {markdown_safe(entry.get('message'))}")
    return "\n".join(lines).rstrip() + "\n"


def _simulated_over(verdict: Json) -> list[str]:
    """The horizon, and over what the simulated quantiles run."""
    found = []
    if horizon := part(verdict, "horizon"):
        found.append(f"Horizon: {numbers.horizon(horizon)}")
    monte_carlo = part(verdict, "monte_carlo")
    if text := part(monte_carlo, "ensemble").get("text"):
        found.append(f"Monte Carlo: {text}")
    certificate = part(part(monte_carlo, "worst_case"), "certificate")
    if text := certificate.get("text"):
        found.append(f"Worst case: {text}")
    return found


def _price(verdict: Json) -> str:
    cost = part(verdict, "design").get("cost")
    total = part(verdict, "syncline").get("total_m")
    facts = []
    if cost is not None:
        facts.append(f"**Price** {numbers.money(cost, verdict_tables.currency_of(verdict))}")
    if total is not None:
        facts.append(f"**Syncline error** {numbers.length(total)}")
    return (", ".join(facts) + "\n") if facts else ""


def markdown_table(table: Table) -> str:
    """A table in GitHub's dialect, figures flush right."""
    head = "| " + " | ".join(markdown_safe(h.text) for h in table.heads) + " |"
    rule = "|" + "|".join(" ---: " if h.numeric else " --- " for h in table.heads) + "|"
    rows = [
        "| " + " | ".join(f"{c.mark} {markdown_safe(c.text)}".strip() for c in row) + " |"
        for row in table.rows
    ]
    return "\n".join([head, rule, *rows, ""])
