"""Several verdicts in a line, and the files that were passed over on the way to them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from syncline_design.machine.sentences import sentence_list
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import worse_but_waived
from syncline_design.report.words import VERBS
from syncline_design.spec.folders import Skipped
from syncline_design.verdict.tree import Checked, Verdict


def summary_line(verdicts: Sequence[Checked]) -> str:
    """`5 specs: 3 meet their requirements, 1 is infeasible and 1 is refused.`"""
    if not verdicts:
        return "No spec to check."
    counts: Counter[str] = Counter(verdict.verdict for verdict in verdicts)
    parts = [f"{counts[word]} {VERBS[word][counts[word] > 1]}" for word in VERBS if counts[word]]
    many = "spec" if len(verdicts) == 1 else "specs"
    return f"{len(verdicts)} {many}: {sentence_list(parts)}. {since_line(verdicts)}".strip()


def since_line(verdicts: Sequence[Checked]) -> str:
    """`Against base.json 1 of 5 got worse: lake.`; nothing without a baseline."""
    known = [v.baseline for v in verdicts if isinstance(v, Verdict) and v.baseline is not None]
    if not known:
        return ""
    worse = [v.name for v in verdicts if isinstance(v, Verdict) and v.baseline and v.baseline.worse]
    lead = f"Against {visible(known[0].file)}"
    if not worse:
        waived = any(worse_but_waived(v) for v in verdicts if isinstance(v, Verdict))
        but = " but what is waived" if waived else ""
        return f"{lead} nothing got worse{but}: the exit code is 0."
    return f"{lead} {len(worse)} of {len(verdicts)} got worse: {visible(sentence_list(worse))}."


def skipped_text(skipped: Sequence[Skipped]) -> str:
    """One line per file that is no spec, and what it is."""
    return "\n".join(f"skipped, no spec: {visible(one.file)} ({one.what})" for one in skipped)
