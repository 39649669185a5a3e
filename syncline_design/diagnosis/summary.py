"""A diagnosis as text that a field engineer reads."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.diagnosis.findings import AliasFigure, Finding
from syncline_design.diagnosis.gap import Gap
from syncline_design.diagnosis.identify import SAME
from syncline_design.diagnosis.regimes import Cell
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.model.estimates import figure

OPENING = {
    "agrees": "AGREES: nothing is missing; what differs is the noise that the spec expects.",
    "explained": "EXPLAINED: what is missing was found, and what remains is noise.",
    "unexplained": "UNEXPLAINED: something remains that no effect of the dictionary explains.",
}
LARGE = 1.25  # times the RMS that the spec's noise expects: said in the verdict
UNSOUND = (
    "UNEXPLAINED: the log contradicts itself or the limits of the spec's platform. "
    "Mend that first: every figure below rests on it."
)
OTHER = "of another signature, fits worse in its place"
NOWHERE = "  in no regime on average: it shows in how the errors vary, not in their mean"
BEYOND = " CAUTION: the log goes beyond the limits of the spec's platform."


def summary_text(diagnosis: Diagnosis) -> str:
    """Verdict, findings, gap, what remains and what this log could not show."""
    lines = [_opening(diagnosis), ""]
    if diagnosis.checks:
        lines += [*(f"! {check.message}." for check in diagnosis.checks), ""]
    for number, finding in enumerate(diagnosis.findings, 1):
        lines += _finding_lines(number, finding, diagnosis)
    lines += _gap_lines(diagnosis)
    if diagnosis.left:
        where = [_cell_line(c) for c in diagnosis.where_after] or [NOWHERE]
        lines += ["", "Where it remains:", *where]
        lines.append(f"  chance that noise does this: {diagnosis.remaining.p:.1g}")
    elif diagnosis.findings and diagnosis.where_before:
        lines += ["", "Where it was seen:", *(_cell_line(c) for c in diagnosis.where_before[:4])]
    if diagnosis.unseen:
        lines += ["", f"This log could not show: {', '.join(diagnosis.unseen)}."]
    lines += ["", *_log_lines(diagnosis)]
    return "\n".join(lines) + "\n"


def _opening(diagnosis: Diagnosis) -> str:
    """The verdict, or that the log is not fit for one; cautions are said with it."""
    if not diagnosis.sound:
        return UNSOUND
    opening = OPENING[diagnosis.verdict]
    gap = diagnosis.gap
    if diagnosis.verdict == "explained" and gap and gap.after.rms_m > LARGE * gap.expected_rms_m:
        times = gap.after.rms_m / gap.expected_rms_m
        opening = OPENING["explained"][:-1] + f", {times:.2g} times what the spec expects."
    return opening + BEYOND if diagnosis.checks else opening


def _finding_lines(number: int, finding: Finding, diagnosis: Diagnosis) -> list[str]:
    where = f"{finding.sensor}, {finding.stage}"
    lines = [
        f"{number}. {finding.sentence}.",
        f"   {finding.effect.name} ({where}); {finding.evidence}",
    ]
    if finding.aliases:
        names = "; ".join(_name(a) for a in finding.aliases)
        lines.append(f"   this log cannot tell it from: {names}")
        lines.append(f"   to separate them: {finding.effect.separated_by}")
    lines += lookalike_lines(finding.lookalikes)
    if finding.excluded and not finding.aliases:
        names = ", ".join(_name(a) for a in finding.excluded[:3])
        varied = ", ".join(
            f"{name.replace('_', ' ')} varied {m['low']:.3g} to {m['high']:.3g} {m['unit']}"
            for name, m in diagnosis.log["motion"].items()
        )
        lines.append(f"   excluded: {names}; {varied}")
    return lines


def lookalike_lines(found: Sequence[AliasFigure]) -> list[str]:
    """Three at most of those that fit worse, only with impossible values, or as well."""
    alike = [a for a in found if a.nats_worse >= 0.0 and a.cosine > SAME][:3]
    other = [a for a in found if a.nats_worse >= 0.0 and a.cosine <= SAME][:3]
    impossible = [a for a in found if a.nats_worse < 0.0 and not a.possible][:3]
    as_well = [a for a in found if a.nats_worse < 0.0 and a.possible][:3]
    lines = []
    for words, worse in (("looks alike, fits worse", alike), (OTHER, other)):
        named = ", ".join(f"{_name(a)} by {a.nats_worse:.3g} nat" for a in worse)
        lines += [f"   {words}: {named}"] if worse else []
    if impossible:
        named = ", ".join(f"{_name(a)} by {-a.nats_worse:.3g} nat" for a in impossible)
        lines.append(f"   fits better, but only with impossible values: {named}")
    if as_well:
        lines.append(f"   fits as well in its place: {', '.join(map(_name, as_well))}")
    return lines


def _name(alias: AliasFigure) -> str:
    return f"{alias.effect} ({alias.sensor})"


def _gap_lines(diagnosis: Diagnosis) -> list[str]:
    gap = diagnosis.gap
    if gap is None or not diagnosis.findings:
        return []
    lines = ["", f"On rows that the fit has not seen: {gap_text(gap)}"]
    name, regime = diagnosis.regime
    if regime is not None:
        lines.append(f"On a regime that the fit has not seen ({name}): {gap_text(regime)}")
    label, placebo = diagnosis.placebo
    if placebo is not None:
        change = placebo.difference - gap.difference
        lines.append(f"Adding {label} as well, which was not chosen: {change:+.4f} nat per sample")
    return lines


def gap_text(gap: Gap) -> str:
    closed = f"; the spec's noise expects {figure(gap.expected_rms_m, None, 'm')}"
    if gap.closed_fraction is not None and gap.closed_fraction > 0.0:
        closed += f"; {100.0 * gap.closed_fraction:.0f} % of the gap is closed"
    elif gap.closed_fraction is not None:
        closed += "; nothing of the gap is closed"
    elif gap.slight:
        closed += "; less than 2 % of it could be closed, too little for a share"
    return (
        f"RMS {figure(gap.before.rms_m, None, 'm')} before, {figure(gap.after.rms_m, None, 'm')} "
        f"after, {figure(gap.fitted.rms_m, None, 'm')} at best{closed}"
    )


def _cell_line(cell: Cell) -> str:
    mean = figure(cell.mean_m, None, "m")
    return (
        f"  {cell.covariate} {cell.low:.4g} to {cell.high:.4g} {cell.unit}, {cell.axis}: "
        f"{mean} on average, {abs(cell.score):.0f} standard errors"
    )


def _log_lines(diagnosis: Diagnosis) -> list[str]:
    log = diagnosis.log
    lines = [f"Log: {log['used']} of {log['rows']} rows used, {log['kind']}."]
    if log.get("thinned"):
        lines.append(f"  too long to hold: {log['thinned']} rows between the windows kept of it")
    if log["fitted"] < log["used"]:
        lines.append(f"  worked on: {log['fitted']} rows, in windows spread over the log")
    lines += [f"  left out: {count} ({reason})" for reason, count in log["rejected"].items()]
    lines += [f"  {note}" for note in log["notes"]]
    return lines
