"""What several logs say together, as a diagnosis: findings with their scope and figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.campaign.found_alone import found_alone, undone_in_logs
from syncline_design.campaign.kept import Run
from syncline_design.campaign.lasting_noise import within_lasting_noise
from syncline_design.campaign.naming import NamedTerm, NamedTogether, WorseFit
from syncline_design.campaign.pool import Fitted, Pool, Scoped, Term, fitted
from syncline_design.campaign.sight import limits_of
from syncline_design.campaign.store import Entry, Stored
from syncline_design.campaign.unlike import RATE, UnlikeLog
from syncline_design.diagnosis.consequence import Weights, promise_of
from syncline_design.diagnosis.finding import estimate, evidence_words, finding, in_words, odds
from syncline_design.diagnosis.gap_result import Remaining, WholeGap
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.plotted import (
    Plots,
    Residuals,
)
from syncline_design.diagnosis.result import (
    Check,
    Diagnosis,
    Estimate,
    Finding,
    Joint,
    Likelihoods,
    LogAlone,
    LogOutcome,
    LogRead,
    Noise,
    PerLog,
    Rival,
    Scope,
    SpecRead,
    UnlikeOthers,
)
from syncline_design.diagnosis.run import provenance_of
from syncline_design.diagnosis.same_system import description
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.diagnosis.sight import DetectionLimit, alone, informative
from syncline_design.diagnosis.system import pinned_system
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import student_limit
from syncline_design.model.figure_text import format_estimates
from syncline_design.model.known import EffectEntry
from syncline_design.spec.case import Case

MOST_TOLD = 3  # logs whose own values a sentence tells


@dataclass(frozen=True, eq=False)
class Told:
    """All that a joint diagnosis is told from; before: how many runs the store held."""

    case: Case
    settings: DiagnosisSettings
    entries: tuple[Entry, ...]
    before: int
    pool: Pool
    named: NamedTogether
    stored: Stored | None
    torn: int
    unlike: tuple[tuple[Entry, UnlikeLog], ...] = ()

    @property
    def stages(self) -> list[str]:
        return [stage.name for stage in self.case.spec.stages]

    @property
    def runs(self) -> list[Run]:
        return [one.run for one in self.entries]

    @property
    def spec_m(self) -> float:
        """RMS [m] that the spec's noise makes over all logs."""
        rows = np.array([run.used for run in self.runs], dtype=float)
        squares = np.square([run.spec_m for run in self.runs])
        return float(np.sqrt(np.sum(rows * squares) / max(np.sum(rows), 1.0)))


def tell(told: Told) -> Diagnosis:
    """The diagnosis of several logs."""
    promise = promise_of(told.case)
    weights = Weights(told.spec_m, promise)
    found = [
        *undone_in_logs(told.entries),
        *(_finding(told, one, weights) for one in told.named.terms),
        *found_alone(told.entries, told.pool, told.stages),
    ]
    found.sort(key=lambda f: (not f.material, -f.gain_nat))
    left_m = max((run.left_m for run in told.runs), default=0.0)
    checks = tuple(_checks(told))
    odd = any(run.left_material and not run.checks for run in told.runs)
    explained = any(f.material for f in found)
    verdict: LogOutcome = "explained" if explained else "agrees"
    if odd or checks or (told.unlike and not explained):
        verdict = "unexplained"
    shown = tuple(_seen(told))
    return Diagnosis(
        verdict=verdict,
        sound=not checks,
        checks=checks,
        findings=tuple(found),
        remaining=Remaining(odd, told.spec_m, odd, None, (), left_m, odd),
        where=(),
        first_disagreement_s=None,
        gap=WholeGap(),
        steps=(),
        unseen=tuple(_unseen(told)),
        log=_log_read(told),
        noise=_noise(told),
        plots=Plots(Residuals((), {}), (), ()),
        spec=SpecRead(told.case.spec.name, str(told.case.path)),
        log_files=tuple(f for run in told.runs for f in run.files),
        provenance=provenance_of(told.settings, told.case),
        informative=informative(promise, shown),
        smallest_seen=tuple(one.record for one in shown),
        joint=_joint(told),
        system=description(pinned_system(told.case)),
    )


def _checks(told: Told) -> Iterator[Check]:
    """Where a log contradicts itself or the limits of the spec's platform, each with its files."""
    for run in told.runs:
        files = ", ".join(run.files)
        for check in run.checks or ():
            yield replace(check, message=f"in {files}: {check.message}")


def _finding(told: Told, one: NamedTerm, weights: Weights) -> Finding:
    """One effect in words; what differs from log to log has its mean, and a value for each."""
    term, effect = one.scoped.term, one.scoped.term.effect
    stage = told.stages[term.stage]
    k = [s.term.label for s in told.named.fit.scoped].index(term.label)
    shown = estimates(term, one.judged)
    if one.scoped.scope != "build":
        shown = on_average(term, told.named.fit.of(k), shown)
    size_m = _size_m(told, k)
    scope = one.scoped.scope
    logs = tuple(_per_log(told, _apart(told, k) if scope == "build" else told.named.fit, k))
    said = [shown] if scope == "build" else [log.parameters for log in logs]
    material = any(
        weights.material(
            size_m,
            EffectEntry(
                effect.name, term.sensor, stage, tuple((name, e.value) for name, e in own.items())
            ),
        )
        for own in said
    )
    constant = within_lasting_noise(
        told.named.fit, k, pinned_system(told.case), positions=told.runs[0].kind == "position"
    )
    log10_p, changing = one.log_p / math.log(10.0), constant is not None
    words = evidence_words(one.gain, log10_p, noise_kept=True, changing=changing)
    aliases = tuple(_rival(told, b) for b in one.rivals)
    total = 1.0 + sum(odds(b.nats_worse) for b in aliases)
    aliases = tuple(replace(b, probability=odds(b.nats_worse) / total) for b in aliases)
    found = finding(
        effect, term.sensor, stage, shown, words, one.gain, log10_p,
        (aliases, (), ()), material, size_m,
    )  # fmt: skip
    tested = one.tested.logs if one.tested.starts is None else one.tested.starts
    found = replace(found, scope=scope, one_value=tested, within_noise=constant,
                    probability=1.0 / total if aliases else None)  # fmt: skip
    if scope == "build":
        return replace(found, each_log=logs)
    texts = {name: _ends_text([log.parameters[name] for log in logs]) for name in shown}
    parameters = {name: replace(own, text=texts[name]) for name, own in shown.items()}
    sentence = _differing_words(effect, term.sensor, logs, scope)
    return replace(found, per_log=logs, parameters=parameters, sentence=sentence)


def _ends_text(each: Sequence[Estimate]) -> str:
    """`-12.9 ± 0.3 ms to 14.6 ± 0.3 ms`: the ends of values that are not one."""
    seen = [one for one in each if one.seen and not isinstance(one.value, str)]
    if not seen:
        return each[0].text
    low, high = (pick(seen, key=lambda one: one.value) for pick in (min, max))
    pairs = [(float(one.value), one.standard_uncertainty) for one in (low, high)]
    texts = format_estimates(pairs, low.unit)
    return texts[0] if texts[0] == texts[1] else f"{texts[0]} to {texts[1]}"


def _differing_words(effect: Effect, sensor: str, logs: Sequence[PerLog], scope: Scope) -> str:
    """What each log says where they disagree; of many, the two whose first values are the ends."""
    every = "at every start" if scope == "start" else "in every log"
    said = list(logs)
    if len(said) > MOST_TOLD:
        first = next(iter(said[0].parameters))
        said.sort(key=lambda one: float(one.parameters[first].value))
        said = [said[0], said[-1]]
    words = "; ".join(f"{one.file}: {in_words(effect, sensor, one.parameters)}" for one in said)
    ends = f" (the ends of {len(logs)})" if len(said) < len(logs) else ""
    return f"The logs disagree, another value {every}: {words}{ends}"


def _rival(told: Told, one: WorseFit) -> Rival:
    name, sensor, stage = one.term.label
    return Rival(name, sensor, told.stages[stage], one.cosine, one.worse, one.possible)


def estimates(term: Term, judged: Judged) -> dict[str, Estimate]:
    """Parameters with the uncertainty and interval to rely on."""
    found = {}
    slopes = [p.name for p in term.effect.slopes()]
    spreads, seen = judged.spread, np.diag(judged.model) > 0.0
    for p in term.effect.parameters:
        k = slopes.index(p.name)
        value, spread = float(judged.values[k]), float(spreads[k])
        half = judged.coverage * spread
        interval = (value - half, value + half) if seen[k] else None
        shown = spread if seen[k] else math.inf
        found[p.name] = estimate(value, shown, p.unit, bool(seen[k]), interval)
    return found


def on_average(term: Term, values: Array, once: dict[str, Estimate]) -> dict[str, Estimate]:
    """The mean of values (groups, p) that differ, as uncertain as they scatter.

    s / sqrt(n), with Student's interval of n - 1: the logs are what is drawn, not their rows.
    once: as if it were one value, which says what is seen.
    """
    count = len(values)
    if count < 2:
        return once
    slopes = [p.name for p in term.effect.slopes()]
    means, spreads = values.mean(axis=0), values.std(axis=0, ddof=1) / math.sqrt(count)
    half = student_limit(0.025, count - 1) * spreads
    found = {}
    for name, each in once.items():
        k = slopes.index(name)
        value = float(means[k])
        ends = (value - float(half[k]), value + float(half[k])) if each.seen else None
        spread = float(spreads[k]) if each.seen else math.inf
        found[name] = estimate(value, spread, each.unit, each.seen, ends)
    return found


def _apart(told: Told, k: int) -> Fitted:
    """All effects fitted anew, one of them with a value of its own in every log."""
    scoped = list(told.named.fit.scoped)
    scoped[k] = replace(scoped[k], scope="log")
    return fitted(told.pool, scoped)


def _per_log(told: Told, fit: Fitted, k: int) -> Iterator[PerLog]:
    """The values of an effect in every log."""
    one = fit.scoped[k]
    group = told.pool.group_of(one.scope)
    for run, entry in enumerate(told.entries):
        judged = fit.judged(fit.place[k][group[run]])
        yield PerLog(entry.number, entry.run.files[0], entry.start, estimates(one.term, judged))


def _size_m(told: Told, k: int) -> float:
    """RMS [m] that an effect makes over all rows of all logs."""
    fit = told.named.fit
    one = fit.scoped[k]
    values = fit.of(k)[told.pool.group_of(one.scope)]
    gram = told.pool.gram[:, one.term.index[:, None], one.term.index]
    squares = np.einsum("lp,lpq,lq->l", values, gram, values)
    rows = np.array([run.used for run in told.runs], dtype=float)
    return float(np.sqrt(max(float(rows @ squares) / float(np.sum(rows)), 0.0)))


def _seen(told: Told) -> Iterator[DetectionLimit]:
    """The smallest value common to all logs that half of such sets of logs would show."""
    taken = {one.term.label for one in told.named.fit.scoped}
    doubles = {b.term.label for one in told.named.terms for b in one.rivals}
    rate = told.settings.false_alarm_rate / max(len(told.pool.terms), 1)
    for term in told.pool.terms:
        if term.label in taken | doubles or term.effect.name in told.settings.exclude_effects:
            continue
        fit = fitted(told.pool, (*told.named.fit.scoped, Scoped(term, "build")))
        judged = fit.judged(fit.place[-1][0])
        yield from limits_of(term, told.stages, _smallest(judged, math.log(rate)))
    for term in told.pool.untold:
        if term.effect.name not in told.settings.exclude_effects:
            yield from limits_of(term, told.stages)


def _smallest(judged: Judged, log_p: float) -> Array:
    size = np.maximum(alone(judged.model, log_p), 0.0)
    for covariance, count in judged.jackknives:
        size = np.maximum(size, alone(covariance, log_p, count))
    return np.where(np.diag(judged.model) > 0.0, size, np.inf)


def _unseen(told: Told) -> Iterator[str]:
    """Effects of which no log says enough: at their plausible most they stay below 3 sigma."""
    for term in told.pool.terms:
        information = np.einsum("lpp->p", told.pool.normal[:, term.index[:, None], term.index])
        slopes = term.effect.slopes()
        names = [
            p.name
            for p, i in zip(slopes, information, strict=True)
            if p.high * math.sqrt(max(float(i), 0.0)) < 3.0
        ]
        if names:
            which = "" if len(names) == len(slopes) else f": {', '.join(names)}"
            yield f"{term.effect.name} ({term.sensor}){which}"


def _log_read(told: Told) -> LogRead:
    rejected: dict[str, int] = {}
    for run in told.runs:
        for reason, count in run.rejected.items():
            rejected[reason] = rejected.get(reason, 0) + count
    kinds = sorted({run.kind for run in told.runs})
    used = sum(run.used for run in told.runs)
    rows = sum(run.rows for run in told.runs)
    duration = sum(run.duration_s for run in told.runs)
    thinned = rows - used - sum(rejected.values())
    return LogRead("/".join(kinds), rows, used, rejected, max(thinned, 0), (), duration,
                   duration / max(used - len(told.runs), 1), used, {})  # fmt: skip


def _noise(told: Told) -> Noise:
    """Noise factors over all logs, root mean square by rows."""
    factors: dict[str, list[tuple[float, int]]] = {}
    for run in told.runs:
        for sensor, factor in run.white_factor.items():
            factors.setdefault(sensor, []).append((factor, run.used))
    white = {sensor: _rms(own) for sensor, own in factors.items()}
    before = 0.5 * sum(run.square for run in told.runs)
    return Noise(white, {}, sum(run.used for run in told.runs),
                 Likelihoods(before, before - told.named.fit.gain))  # fmt: skip


def _rms(own: Sequence[tuple[float, int]]) -> float:
    weight = sum(rows for _, rows in own)
    return math.sqrt(sum(rows * f * f for f, rows in own) / max(weight, 1))


def _joint(told: Told) -> Joint:
    logs = tuple(
        LogAlone(
            number=e.number,
            files=e.run.files,
            start=e.start,
            date=e.run.date,
            rows=e.run.rows,
            used=e.run.used,
            duration_s=e.run.duration_s,
            verdict=e.run.verdict,  # type: ignore[arg-type]  # as it was written
            named=tuple(one.words for one in e.run.named),
            left_m=e.run.left_m,
            spec_m=e.run.spec_m,
            white_factor=dict(e.run.white_factor),
            new=e.number > told.before,
        )
        for e in told.entries
    )
    stored = told.stored
    return Joint(logs, len({e.start for e in told.entries}),
                 None if stored is None else str(stored.path),
                 None if stored is None else stored.last, told.torn,
                 tuple(_unlike(told)) or None, RATE if told.unlike else None,
                 None if stored is None else tuple(stored.left_out_words()) or None)  # fmt: skip


def _unlike(told: Told) -> Iterator[UnlikeOthers]:
    """Logs that are unlike all the others."""
    for entry, one in told.unlike:
        name, sensor, stage = one.term.label
        differs = estimates(one.term, one.judged)
        chance = one.log_p / math.log(10.0)
        yield UnlikeOthers(entry.number, entry.run.files, name, sensor, told.stages[stage], differs,
                           chance)  # fmt: skip
