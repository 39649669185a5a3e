"""A diagnosis as Markdown, for a pull request comment or a job summary."""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.report.on_diagnosis import (
    check_sentences,
    design_lines,
    finding_words,
    gap_lines,
    gap_table,
    log_lines,
    meaning_table,
    outcome_of,
    remaining_text,
    sentence_text,
)
from syncline_design.report.render_markdown import markdown_table
from syncline_design.report.text import markdown_safe
from syncline_design.report.verdict_words import Json, items, part


def render_diagnosis_markdown(data: Json) -> str:
    """Outcome, every finding with its figures, the gap, what it means for the design."""
    outcome = outcome_of(data)
    name = part(data, "spec").get("name") or "Measured log against simulation"
    lines = [f"## {outcome.mark} {markdown_safe(name)}: {outcome.word}", ""]
    found = items(data, "findings")
    if found:
        lines += [text for check in check_sentences(data) for text in (markdown_safe(check), "")]
    else:
        lines += [markdown_safe(sentence_text(data)), ""]
    for number, entry in enumerate(found, 1):
        lines += [*_finding(number, entry), ""]
    left = remaining_text(data)
    if left:
        lines += [markdown_safe(left), ""]
    gap = gap_table(data)
    if gap is not None:
        lines += [f"**{markdown_safe(gap.caption)}**", "", markdown_table(gap)]
        lines += [*(f"- {markdown_safe(line)}" for line in gap_lines(data)), ""]
    lines += [*(f"- {markdown_safe(line)}" for line in log_lines(data)), ""]
    means = design_lines(data)
    if means:
        lines += ["**What it means for the design**", ""]
        lines += [f"- {markdown_safe(line.strip())}" for line in means]
        figures = meaning_table(data)
        lines += ["", markdown_table(figures)] if figures is not None else []
    return "\n".join(lines).rstrip() + "\n"


def _finding(number: int, entry: Json) -> Iterator[str]:
    words = finding_words(entry)
    yield f"{number}. **{markdown_safe(words['sentence'] or words['title'])}**"
    yield f"   - {markdown_safe(words['title'])} ({markdown_safe(words['place'])})"
    for name, text in words["parameters"]:
        yield f"   - {markdown_safe(name)}: {markdown_safe(text)}"
    if words["evidence"]:
        yield f"   - evidence: {markdown_safe(words['evidence'])}"
    if words["aliases"]:
        separated = f"; to separate them: {words['separated_by']}" if words["separated_by"] else ""
        yield f"   - not told apart from {markdown_safe(words['aliases'] + separated)}"
    if words["lookalikes"]:
        yield f"   - similar: {markdown_safe(words['lookalikes'])}"
    if words["excluded"]:
        yield f"   - told apart on this log from {markdown_safe(words['excluded'])}"
