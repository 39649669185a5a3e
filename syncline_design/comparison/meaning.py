"""What a diagnosis means for the design: the spec with the findings written in, checked again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace

from syncline_design.choice.effect_tables import NoBudget
from syncline_design.choice.outcome import Explanation
from syncline_design.choice.problem import build_problem
from syncline_design.comparison.repairs import Repair
from syncline_design.diagnosis.one_of_several import is_one_of_several, members, rivals_words
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.model.budget import SyncModelName
from syncline_design.model.figure_text import format_duration, format_quantity, percent
from syncline_design.model.quantity import Dimension
from syncline_design.model.written import beside, limit_as_written
from syncline_design.simulation.results import QuantileEstimate
from syncline_design.spec.case import Case
from syncline_design.spec.edit import with_effects
from syncline_design.spec.effects_listed import EffectChoice
from syncline_design.verdict.named import NamedDesign
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import (
    PREDICATES,
    MissionHorizon,
    RequirementResult,
    Verdict,
    Word,
    finite,
)
from syncline_design.verdict.verified import framed
from syncline_design.verdict.verify import check_loaded

MODELS: Mapping[SyncModelName, str] = {"syncline": "Syncline", "per_sensor": "per-sensor model"}
QUANTILE = "0.95"
WORTH_SAYING = 1.2  # a Syncline that exceeds the per-sensor model by more is explained


@dataclass(frozen=True, slots=True)
class ErrorFigure(Record):
    """One way to say the error [m]; None where there is no design or no simulation.

    before_interval_m, after_interval_m: the confidence interval of a simulated figure.
    """

    figure: str
    label: str
    before_m: float | None
    after_m: float | None
    before_interval_m: tuple[float | None, float | None] | None = optional()
    after_interval_m: tuple[float | None, float | None] | None = optional()


@dataclass(frozen=True, slots=True)
class ChargedHorizon(Record):
    """Over what drifting effects are charged, and the same in words."""

    duration_s: float
    extent_m: float
    tilt_rad: float
    text: str


@dataclass(frozen=True, slots=True)
class Summary(Record):
    """What a verdict says of the design, without or with the findings."""

    verdict: Word
    requirements: tuple[RequirementResult, ...]
    design: NamedDesign | None
    infeasibility: Explanation | None = optional()


@dataclass(frozen=True, slots=True)
class DesignMeaning(Record):
    """The verdict before and after the findings: the `design` key of a diagnosis.

    text: what changes, in words.  figures: the error without and with the findings, by each way
    to say it.  horizon: over which it holds.
    """

    before: Summary
    after: Summary
    text: tuple[str, ...]
    figures: tuple[ErrorFigure, ...]
    horizon: ChargedHorizon


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosisAndDesign(Diagnosis):
    """A diagnosis with what it means for the design and what would put it right, where something
    was found; repairs: the best of each kind, by rising price.
    """

    design: DesignMeaning | None = optional()
    repairs: tuple[Repair, ...] | None = optional()


def with_design(
    found: Diagnosis, means: DesignMeaning | None, repairs: tuple[Repair, ...] | None = None
) -> DiagnosisAndDesign:
    """The diagnosis with what it means for the design, and what would put that right."""
    parts = {f.name: getattr(found, f.name) for f in fields(Diagnosis)}
    if means is not None:
        means = replace(means, text=(*means.text, *_class_lines(found)))
    return DiagnosisAndDesign(**parts, design=means, repairs=repairs)


def _class_lines(found: Diagnosis) -> Iterator[str]:
    """Of what is one of several that the log cannot tell apart: as which of them it is charged."""
    who = "this log" if found.joint is None else "these logs"
    for one in found.findings:
        if is_one_of_several(one) and one.material and one.kind == "cause" and one.fits_a_spec:
            first = members(one)[0]
            yield (
                f"Charged is {first}; with {rivals_words(one)}, which {who} cannot tell from it, "
                "the figures may be others."
            )


def meaning(case: Case, entries: Sequence[EffectChoice], seed: int) -> DesignMeaning | None:
    """Check the spec with and without the findings; None when nothing was found."""
    if not entries:
        return None
    settings = CheckSettings(seed=seed)
    before = _checked(case, settings)
    after = _checked(with_effects(case, entries), settings)
    horizon = after.verdict.horizon
    given = "horizon" in case.spec.model_fields_set
    return DesignMeaning(
        before=_summary(before.verdict),
        after=_summary(after.verdict),
        text=(*_lines(before, after), *_why_models_differ(after.verdict)),
        figures=error_figures(before.verdict, after.verdict),
        horizon=ChargedHorizon(
            horizon.duration_s,
            horizon.extent_m,
            horizon.tilt_rad,
            horizon_words(horizon, given=given),
        ),
    )


@dataclass(frozen=True, slots=True)
class _Checked:
    """A verdict; refusal: why there is none where an effect has no place in a budget."""

    verdict: Verdict
    refusal: tuple[str, ...] = ()


def _checked(case: Case, settings: CheckSettings) -> _Checked:
    try:
        return _Checked(check_loaded(case, settings))
    except NoBudget as refused:
        words = tuple(f"{one.message}; {one.hint}" for one in refused.problems)
        return _Checked(framed("indeterminate", case, build_problem(case), settings), words)


def _summary(verdict: Verdict) -> Summary:
    return Summary(verdict.verdict, verdict.requirements, verdict.design, verdict.infeasibility)


def error_figures(before: Verdict, after: Verdict) -> tuple[ErrorFigure, ...]:
    """Syncline, per-sensor model and simulated 95 % quantile, without and with the findings."""
    found = [
        ErrorFigure(
            f"{model}_m",
            label + (", which decides" if after.spec.sync_model == model else ""),
            _modelled(before, model),
            _modelled(after, model),
        )
        for model, label in MODELS.items()
    ]
    one, other = _quantile(before), _quantile(after)
    label = f"simulated, {percent(float(QUANTILE), 6)} of errors below"
    simulated = ErrorFigure(
        "simulated_95_m",
        label,
        None if one is None else finite(one.value_m),
        None if other is None else finite(other.value_m),
        _ends(one),
        _ends(other),
    )
    return (*found, simulated)


def _why_models_differ(after: Verdict) -> Iterator[str]:
    whole, own = _modelled(after, "syncline"), _modelled(after, "per_sensor")
    if whole is not None and own is not None and whole > WORTH_SAYING * own:
        yield (
            "The Syncline charges the largest timestamp difference of the system to all of its "
            "motion, the per-sensor model each sensor's own to what that sensor measures."
        )


def _modelled(verdict: Verdict, model: SyncModelName) -> float | None:
    if verdict.syncline is None:
        return None
    models = verdict.syncline.models
    return (models.syncline if model == "syncline" else models.per_sensor).total_m


def _quantile(verdict: Verdict) -> QuantileEstimate | None:
    return None if verdict.monte_carlo is None else verdict.monte_carlo.quantiles.get(QUANTILE)


def _ends(found: QuantileEstimate | None) -> tuple[float | None, float | None] | None:
    return None if found is None else (finite(found.low_m), finite(found.high_m))


def horizon_words(horizon: MissionHorizon, *, given: bool) -> str:
    """Over how long, how far and how steep a mission drifting effects are charged."""
    duration = format_duration(horizon.duration_s)
    extent = format_quantity(horizon.extent_m, Dimension.LENGTH)
    tilt = format_quantity(horizon.tilt_rad, Dimension.ANGLE)
    whose = "the spec's" if given else "by default; horizon in the spec changes it"
    return (
        f"Horizon: {duration}, {extent} about the origin, tilt up to {tilt} ({whose}). "
        "What drifts or grows with distance is charged for all of it."
    )


def _lines(before: _Checked, after: _Checked) -> Iterator[str]:
    said = [PREDICATES[one.verdict.verdict] for one in (before, after)]
    yield f"Without the findings the spec {said[0]}; with them, it {said[1]}."
    yield from after.refusal or before.refusal
    for row in after.verdict.requirements:
        if row.status == "fail" and row.value is not None:
            yield f"{row.id}: {_against_limit(row, row.value)}."
    if before.verdict.spec.open_roles and not (before.refusal or after.refusal):
        yield from _payload_lines(before.verdict, after.verdict)
    elif after.verdict.verdict == "fails":
        yield (
            "The design is pinned; with candidates in the spec, the cheapest design that still "
            "meets the requirements would be named here."
        )


def _against_limit(row: RequirementResult, value: float) -> str:
    written = limit_as_written(row.limit_written, row.limit, row.unit)
    if written is not None:
        return f"{beside(written, value, row.unit)} against a limit of {written}"
    return f"{_figure(value, row.unit)} against a limit of {_figure(row.limit, row.unit)}"


def _figure(value: float, unit: str) -> str:
    dimension = Dimension.LENGTH if unit == "m" else Dimension.DIMENSIONLESS
    return format_quantity(value, dimension) + ("" if unit in "m1" else f" {unit}")


def _payload_lines(before: Verdict, after: Verdict) -> Iterator[str]:
    """Which candidates meet the requirements now."""
    if after.infeasibility is not None:
        yield from after.infeasibility.text
        return
    old, new = _payload(before), _payload(after)
    changes = [f"{role}: {old[role]} -> {new[role]}" for role in new if old.get(role) != new[role]]
    if not changes:
        yield "The same payload is still the best one."
        return
    yield "Another payload meets the requirements now:"
    yield from (f"  {change}" for change in changes)
    if before.design is None or after.design is None:
        return
    old_cost, new_cost, currency = before.design.cost, after.design.cost, after.design.currency
    if old_cost is not None and new_cost is not None:
        change = format_quantity(abs(new_cost - old_cost), Dimension.MONEY, currency=currency)
        yield f"  {change} {'more' if new_cost >= old_cost else 'less'}"


def _payload(verdict: Verdict) -> dict[str, str]:
    if verdict.design is None:
        return {}
    return {
        f"{stage.name} {role}": f"{taken.sensor} by {taken.timestamping}"
        for stage, role, taken in verdict.design.roles
    }
