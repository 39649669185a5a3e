"""A diagnosis as Markdown, for a pull request comment or a job summary."""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.comparison.meaning import DiagnosisAndDesign
from syncline_design.report.on_diagnosis import (
    FindingWords,
    check_sentences,
    design_lines,
    finding_words,
    gap_lines,
    gap_table,
    log_lines,
    meaning_table,
    name_of,
    outcome_of,
    remaining_text,
    sentence_text,
)
from syncline_design.report.render_markdown import markdown_table
from syncline_design.report.text import markdown_safe


def render_diagnosis_markdown(found: DiagnosisAndDesign) -> str:
    """Outcome, every finding with its figures, the gap, what it means for the design."""
    outcome = outcome_of(found)
    lines = [f"## {outcome.mark} {markdown_safe(name_of(found))}: {outcome.word}", ""]
    if found.findings:
        lines += [text for check in check_sentences(found) for text in (markdown_safe(check), "")]
    else:
        lines += [markdown_safe(sentence_text(found)), ""]
    for number, entry in enumerate(found.findings, 1):
        lines += [*_finding(number, finding_words(entry)), ""]
    left = remaining_text(found)
    if left:
        lines += [markdown_safe(left), ""]
    gap = gap_table(found.gap)
    if gap is not None:
        lines += [f"**{markdown_safe(gap.caption)}**", "", markdown_table(gap)]
        lines += [*(f"- {markdown_safe(line)}" for line in gap_lines(found.gap)), ""]
    lines += [*(f"- {markdown_safe(line)}" for line in log_lines(found.log)), ""]
    means = design_lines(found.design)
    if means:
        lines += ["**What it means for the design**", ""]
        lines += [f"- {markdown_safe(line.strip())}" for line in means]
        figures = meaning_table(found.design)
        lines += ["", markdown_table(figures)] if figures is not None else []
    return "\n".join(lines).rstrip() + "\n"


def _finding(number: int, words: FindingWords) -> Iterator[str]:
    yield f"{number}. **{markdown_safe(words.sentence)}**"
    yield f"   - {markdown_safe(words.title)} ({markdown_safe(words.place)})"
    for name, text in words.parameters:
        yield f"   - {markdown_safe(name)}: {markdown_safe(text)}"
    yield f"   - evidence: {markdown_safe(words.evidence)}"
    if words.aliases:
        separated = f"; to separate them: {words.separated_by}"
        yield f"   - not told apart from {markdown_safe(words.aliases + separated)}"
    if words.lookalikes:
        yield f"   - similar: {markdown_safe(words.lookalikes)}"
    if words.excluded:
        yield f"   - told apart on this log from {markdown_safe(words.excluded)}"
