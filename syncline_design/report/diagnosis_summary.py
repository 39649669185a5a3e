"""A diagnosis as text that a field engineer reads."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.comparison.meaning import DesignMeaning
from syncline_design.diagnosis.identify import SAME
from syncline_design.diagnosis.result import Diagnosis, Finding, Gap, HeldOut, Regime, Rival
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
    remaining = diagnosis.remaining
    if remaining.beyond_noise:
        where = [_regime_line(one) for one in remaining.where] or [NOWHERE]
        lines += ["", "Where it remains:", *where]
        lines.append(f"  chance that noise does this: {remaining.p:.1g}")
    elif diagnosis.findings and diagnosis.where:
        lines += ["", "Where it was seen:", *(_regime_line(one) for one in diagnosis.where[:4])]
    if diagnosis.unseen:
        lines += ["", f"This log could not show: {', '.join(diagnosis.unseen)}."]
    lines += ["", *_log_lines(diagnosis)]
    return "\n".join(lines) + "\n"


def _opening(diagnosis: Diagnosis) -> str:
    """The verdict, or that the log is not fit for one; cautions are said with it."""
    if not diagnosis.sound:
        return UNSOUND
    opening = OPENING[diagnosis.verdict]
    times = _times_expected(diagnosis.gap)
    if diagnosis.verdict == "explained" and times > LARGE:
        opening = OPENING["explained"][:-1] + f", {times:.2g} times what the spec expects."
    return opening + BEYOND if diagnosis.checks else opening


def _times_expected(gap: Gap) -> float:
    """RMS after, over what the spec's noise gives; 0 where no rows were held out."""
    if gap.held_out is None or gap.expected_rms_m is None:
        return 0.0
    return gap.held_out.after.rms_m / max(gap.expected_rms_m, 1e-300)


def _finding_lines(number: int, finding: Finding, diagnosis: Diagnosis) -> list[str]:
    where = f"{finding.sensor}, {finding.stage}"
    lines = [
        f"{number}. {finding.sentence}.",
        f"   {finding.effect} ({where}); {finding.evidence}",
    ]
    if finding.aliases:
        names = "; ".join(_name(a) for a in finding.aliases)
        lines.append(f"   this log cannot tell it from: {names}")
        lines.append(f"   to separate them: {finding.separated_by}")
    lines += lookalike_lines(finding.lookalikes)
    if finding.excluded and not finding.aliases:
        names = ", ".join(_name(a) for a in finding.excluded[:3])
        varied = ", ".join(
            f"{name.replace('_', ' ')} varied {m.low:.3g} to {m.high:.3g} {m.unit}"
            for name, m in diagnosis.log.motion.items()
        )
        lines.append(f"   excluded: {names}; {varied}")
    return lines


def lookalike_lines(found: Sequence[Rival]) -> list[str]:
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


def _name(alias: Rival) -> str:
    return f"{alias.effect} ({alias.sensor})"


def _gap_lines(diagnosis: Diagnosis) -> list[str]:
    gap = diagnosis.gap
    if gap.held_out is None or not diagnosis.findings:
        return []
    lines = ["", f"On rows that the fit has not seen: {gap_text(gap, gap.held_out)}"]
    regime, placebo = gap.regime, gap.placebo
    if regime.held_out is not None:
        text = gap_text(regime, regime.held_out)
        lines.append(f"On a regime that the fit has not seen ({regime.held_rows}): {text}")
    if placebo.nll_saved_per_sample is not None and gap.nll_saved_per_sample is not None:
        change = placebo.nll_saved_per_sample.value - gap.nll_saved_per_sample.value
        added = f"Adding {placebo.added} as well, which was not chosen"
        lines.append(f"{added}: {change:+.4f} nat per sample")
    return lines


def gap_text(gap: Gap, scores: HeldOut) -> str:
    """Before, after and at best, against what the spec's noise expects."""
    closed = f"; the spec's noise expects {_metres(gap.expected_rms_m)}"
    if gap.closed_fraction is not None and gap.closed_fraction > 0.0:
        closed += f"; {100.0 * gap.closed_fraction:.0f} % of the gap is closed"
    elif gap.closed_fraction is not None:
        closed += "; nothing of the gap is closed"
    elif scores.slight:
        closed += "; less than 2 % of it could be closed, too little for a share"
    before, after, best = (
        _metres(fit.rms_m) for fit in (scores.before, scores.after, scores.fitted)
    )
    return f"RMS {before} before, {after} after, {best} at best{closed}"


def _metres(value_m: float | None) -> str:
    return "-" if value_m is None else figure(value_m, None, "m")


def _regime_line(one: Regime) -> str:
    return (
        f"  {one.covariate} {one.low:.4g} to {one.high:.4g} {one.unit}, {one.axis}: "
        f"{_metres(one.mean_m)} on average, {abs(one.score):.0f} standard errors"
    )


def _log_lines(diagnosis: Diagnosis) -> list[str]:
    log = diagnosis.log
    lines = [f"Log: {log.used} of {log.rows} rows used, {log.kind}."]
    if log.thinned:
        lines.append(f"  too long to hold: {log.thinned} rows between the windows kept of it")
    if log.fitted < log.used:
        lines.append(f"  worked on: {log.fitted} rows, in windows spread over the log")
    lines += [f"  left out: {count} ({reason})" for reason, count in log.rejected.items()]
    lines += [f"  {note}" for note in log.notes]
    return lines


def meaning_text(design: DesignMeaning) -> str:
    """What the findings mean for the design: words, the figures side by side, the horizon."""
    rows = [("", "without", "with the findings")]
    rows += [(one.label, *one.words()) for one in design.figures]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    table = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    return "".join(f"  {line}\n" for line in (*design.text, *table, design.horizon.text))
