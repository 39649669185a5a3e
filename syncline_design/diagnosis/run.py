"""The whole diagnosis, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from syncline_design import __version__
from syncline_design.diagnosis.candidates import (
    hidden_by_noise,
)
from syncline_design.diagnosis.checks import is_sound, log_checks
from syncline_design.diagnosis.consequence import SHARE, SpecPromise, promise_of, rms_m, weighed
from syncline_design.diagnosis.findings import entry_of, findings
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.gap_result import Regime, Remaining
from syncline_design.diagnosis.gaps import gap_steps, whole_gap
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.identify import unseen
from syncline_design.diagnosis.knocks import after_a_knock, within_words, words_for
from syncline_design.diagnosis.mean_turn import with_mean_turn
from syncline_design.diagnosis.motion_columns import (
    merged_checks,
)
from syncline_design.diagnosis.noise_findings import (
    episode_finding,
    range_tail_findings,
    with_unlike_readings,
)
from syncline_design.diagnosis.one_delay import with_one_delay
from syncline_design.diagnosis.plots import plots
from syncline_design.diagnosis.regimes import (
    covariates,
    first_disagreement_s,
    strongest,
    where_maps,
)
from syncline_design.diagnosis.remainder import remainder
from syncline_design.diagnosis.result import (
    Check,
    Diagnosis,
    DiagnosisProvenance,
    Finding,
    Likelihoods,
    LogOutcome,
    LogRead,
    MotionQuantiles,
    Noise,
    SlowNoise,
    SpecRead,
)
from syncline_design.diagnosis.same_system import description
from syncline_design.diagnosis.search import Search, SearchResult
from syncline_design.diagnosis.searched import SearchedLog, examined, started
from syncline_design.diagnosis.settings import DiagnosisSettings, SearchProgress, silent
from syncline_design.diagnosis.sight import informative, smallest_seen
from syncline_design.diagnosis.survey import survey_m
from syncline_design.diagnosis.system import Measured, measured, pinned_system
from syncline_design.diagnosis.system_delay import with_system_delay
from syncline_design.diagnosis.turned_heading import with_turned_heading
from syncline_design.diagnosis.unseen_block import unseen_block
from syncline_design.effects import registry
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.spec.load import load

NAMED_SHARE = 0.9
REMAINDER_SHARE = 0.2  # of the false-alarm rate: for the test of what remains


def diagnose(
    spec: Case | Path | str,
    log_paths: Sequence[Path | str] = (),
    settings: DiagnosisSettings | None = None,
    progress: SearchProgress = silent,
) -> Diagnosis:
    """Find where a log disagrees with its spec, name what is missing, and show the gap shrink.

    Raises BadInput for a spec or log that cannot be used.
    """
    case = spec if isinstance(spec, Case) else load(spec)
    said = _within_time(progress)
    said("reading the log", 0.0)
    with one_thread():
        inputs = measured(case, [Path(p) for p in log_paths])
        return diagnose_measured(inputs, settings or DiagnosisSettings(), case, said)


def _within_time(progress: SearchProgress) -> SearchProgress:
    """The same progress; OutOfTime instead once the time is over."""

    def said(words: str, share: float) -> None:
        in_force().doing(words)
        progress(words, share)

    return said


def diagnose_measured(
    inputs: Measured,
    settings: DiagnosisSettings,
    case: Case | None = None,
    progress: SearchProgress = silent,
) -> Diagnosis:
    """The diagnosis of a system and a log that are already in memory."""
    return told(examined(inputs, settings, progress), case, progress)


def told(
    one: SearchedLog, case: Case | None = None, progress: SearchProgress = silent
) -> Diagnosis:
    """What a searched log says, in figures: what is left, what it means, how the gap closes."""
    inputs, faults, data, search, result = (
        one.inputs, one.faults, one.data, one.search, one.result
    )  # fmt: skip
    settings = search.settings
    view = data.view
    progress("testing what remains", 0.7)
    promise = None if case is None else promise_of(case)
    untouched = one.untouched
    weighed_up = weigh(one, promise)
    checks, sound, verdict = weighed_up.checks, weighed_up.sound, weighed_up.verdict
    shown = smallest_seen(search, result)
    progress("measuring the gap", 0.8)
    cells = weighed_up.cells
    remaining = replace(weighed_up.remaining, unexplained=verdict == "unexplained")
    return Diagnosis(
        verdict=verdict,
        sound=sound,
        checks=checks,
        findings=weighed_up.findings,
        remaining=remaining,
        where=strongest(cells),
        first_disagreement_s=first_disagreement_s(view, result.base.error, result.model.precision),
        gap=replace(
            whole_gap(data, search, result, untouched),
            unseen=unseen_block(data, result, lambda rows: started(inputs, rows, settings))
            if settings.unseen_block
            else None,
        ),
        steps=gap_steps(data, result, faults, untouched),
        unseen=_unseen(data, search, result, settings.exclude_effects),
        log=_log_read(replace(inputs.log, notes=view.log.notes), data),
        noise=_noise(data, result),
        plots=plots(data, result, cells),
        spec=None if case is None else SpecRead(case.spec.name, str(case.path)),
        log_files=tuple(inputs.files),
        provenance=provenance_of(settings, case),
        informative=informative(promise, shown),
        smallest_seen=tuple(one.record for one in shown),
        system=None if case is None else description(pinned_system(case)),
    )


@dataclass(frozen=True, slots=True)
class WeighedUp:
    """What was found, and what is left, with what both are worth; where the log disagrees.

    hangs: whether rows were left out in which a device hangs, and that matters.
    """

    findings: tuple[Finding, ...]
    remaining: Remaining
    checks: tuple[Check, ...]
    cells: tuple[Regime, ...]
    hangs: bool = False

    @property
    def sound(self) -> bool:
        return is_sound(self.checks)

    @property
    def verdict(self) -> LogOutcome:
        found = outcome(self.findings, self.sound and not self.remaining.material)
        return "explained" if found == "agrees" and self.hangs else found


def weigh(one: SearchedLog, promise: SpecPromise | None) -> WeighedUp:
    """Findings and remainder of a settled model, each with whether it matters."""
    data, search, result, faults = one.data, one.search, one.result, one.faults
    untouched = one.untouched
    rest = remainder(data, result.model, search.proposals.rng, search.proposals.candidates)
    left = rest.p < REMAINDER_SHARE * search.settings.false_alarm_rate
    weights = weighed(promise, data)
    named = findings(result.final, faults, weights, left)
    named = with_unlike_readings(named, result.final, search.unlike or (), weights)
    named = (*named, *(episode_finding(data, one, weights) for one in search.episodes or ()))
    for one_range in search.range_tails or ():
        named = (*named, *range_tail_findings(data, one_range, weights))
    if untouched is not None:
        named = _with_sizes(named, faults, rms_m(data, untouched - data.error(())))
    checks = merged_checks(
        (*one.replaced, *one.hanging.checks), log_checks(data.view, result.model.acting)
    )
    knocked = after_a_knock(named) if is_sound(checks) and not left else None
    named = within_words(named if knocked is None else knocked)
    causes = [entry_of(one) for one in named if one.kind == "cause" and one.material]
    waves = words_for(named)
    material = bool(waves) or (left and weights.left(rest.size_m, causes))
    if material:
        named = stand_ins(named, data, result.model, rest.size_m, untouched)
    errors = (result.base.error, result.model.error)
    before, after = where_maps(data.view, errors, result.model.precision)
    remaining = Remaining(
        unexplained=material,
        spec_m=weights.spec_m,
        beyond_noise=left,
        p=None if left else rest.p,
        where=strongest(after),
        size_m=rest.size_m,
        material=material,
    )
    named = with_system_delay(with_one_delay(named), data.view.log.kind)
    named = with_mean_turn(with_turned_heading(named, data.view), data.view)
    hangs = one.hanging.size_m >= SHARE * weights.spec_m
    return WeighedUp(named, remaining, checks, before, hangs)


def _with_sizes(
    named: Sequence[Finding], faults: Sequence[Gross], size_m: float
) -> tuple[Finding, ...]:
    """A gross fault that is alone has made all of the difference that undoing it makes."""
    if len(faults) != 1:
        return tuple(named)
    return (replace(named[0], size_m=size_m), *named[1:])


def outcome(named: Sequence[Finding], settled: bool) -> LogOutcome:
    """Explained where something material was found; settled: nothing material is left unnamed."""
    if not settled:
        return "unexplained"
    return "explained" if any(one.material for one in named) else "agrees"


def stand_ins(
    named: Sequence[Finding],
    data: Data,
    model: Model,
    left_m: float,
    untouched: Array | None = None,
) -> tuple[Finding, ...]:
    """Causes that leave too much are words for something else, not causes.

    The named set has to make up nine tenths of what it and the rest make up together, in squares.
    untouched: the error before gross faults were undone, of which these make up their part.
    """

    def enough(before: Array) -> bool:
        made_m = rms_m(data, before - model.error)
        return made_m**2 >= NAMED_SHARE * (made_m**2 + left_m**2)

    subtle = enough(data.error(()))
    gross = untouched is None or enough(untouched)
    return tuple(
        one
        if one.kind != "cause" or (subtle if registry()[one.effect].undoing is None else gross)
        else replace(one, kind="stand_in")
        for one in named
    )


def _unseen(
    data: Data, search: Search, result: SearchResult, exclude: Sequence[str]
) -> tuple[str, ...]:
    """What this log could not show, and what it would show by its noise alone."""
    hidden = unseen(data, result.model, search.proposals.free_signatures(result.model))
    by_noise = (f"{c.effect.name} ({c.sensor})" for c in hidden_by_noise(data.view, exclude))
    return (*hidden, *_unseen_parts(result), *dict.fromkeys(by_noise))


def _unseen_parts(result: SearchResult) -> tuple[str, ...]:
    """Parameters of what was found that no row depends on."""
    model, at, found = result.model, 0, []
    for one in model.acting:
        names = []
        for p in one.effect.slopes():
            names += [p.name] if not model.covariance[at, at] > 0.0 else []
            at += 1
        if names:
            found.append(f"{one.effect.name} ({one.sensor}): {', '.join(names)}")
    return tuple(found)


def _log_read(log: Log, data: Data) -> LogRead:
    """What was read of a log, and how it moves: every covariate but time and angles."""
    motion = {
        c.name: MotionQuantiles(float(low), float(high), c.unit, float(np.max(np.abs(c.values))))
        for c in covariates(data.view)
        if c.name in ("speed", "turn_rate", "range")
        for low, high in [np.quantile(c.values, [0.05, 0.95])]
    }
    return LogRead(
        kind=log.kind,
        rows=log.rows_read,
        used=len(log),
        rejected=dict(log.rejected),
        thinned=log.thinned,
        notes=log.notes,
        duration_s=log.duration_s,
        interval_s=log.interval_s,
        fitted=len(data.view),
        motion=motion,
    )


def _noise(data: Data, result: SearchResult) -> Noise:
    structure, level = data.structure, result.model.level
    slow = zip(structure.slow, level.slow, level.time_constant_s, strict=True)
    return Noise(
        {"/".join(w.sensor): f for w, f in zip(structure.white, level.factor, strict=True)},
        {"/".join(part.sensor): SlowNoise(v, t[:1]) for part, v, t in slow},
        len(data.noise_rows),
        Likelihoods(result.base.nll, result.model.nll),
        survey_m(data),
    )


def provenance_of(settings: DiagnosisSettings, case: Case | None) -> DiagnosisProvenance:
    """What an answer depends on besides the log."""
    return DiagnosisProvenance(
        version=__version__,
        seed=settings.seed,
        false_alarm_rate=settings.false_alarm_rate,
        max_effects=settings.max_effects,
        exclude_effects=settings.exclude_effects,
        spec_sha256=case.spec_sha256 if case else None,
        catalogs_sha256=case.catalogs_sha256 if case else None,
    )
