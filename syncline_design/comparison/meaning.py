"""What a diagnosis means for the design: the spec with the findings written in, checked again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from syncline_design.choice.problem import build_problem, sole_design
from syncline_design.diagnosis import Diagnosis
from syncline_design.model.quantity import Dimension, format_quantity
from syncline_design.spec.case import Case
from syncline_design.spec.edit import with_effects_text
from syncline_design.spec.known_effects import NoBudget
from syncline_design.spec.load import load_text
from syncline_design.verdict.optimise import pinned_text
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verified import frame
from syncline_design.verdict.verify import CheckSettings, check_loaded, picked_design

Json = dict[str, Any]
WORDS = {
    "meets": "meets its requirements",
    "fails": "does not meet its requirements",
    "infeasible": "has no candidate design that meets the requirements",
    "indeterminate": "could not be decided",
}
MODELS = {"syncline": "Syncline", "per_sensor": "per-sensor model"}
QUANTILE = "0.95"
WORTH_SAYING = 1.2  # a Syncline that exceeds the per-sensor model by more is explained


@dataclass(frozen=True, slots=True)
class DesignMeaning:
    """The verdict before and after the findings; spec_text is the spec that holds them.

    lines: what changes, in words.  figures: the error without and with the findings, by each way
    to say it.  horizon: over which it holds, in words.
    """

    spec_text: str
    before: Json
    after: Json
    lines: tuple[str, ...]
    figures: tuple[ErrorFigure, ...]
    horizon: str

    def to_json(self) -> Json:
        """The `design` key of a diagnosis."""
        return {
            "before": _summary(self.before),
            "after": _summary(self.after),
            "text": list(self.lines),
            "figures": [one.to_json() for one in self.figures],
            "horizon": {**self.after["horizon"], "text": self.horizon},
        }

    def text(self) -> str:
        """The same for a console: words, the figures side by side, the horizon."""
        rows = [("", "without", "with the findings")]
        rows += [(one.label, *one.words()) for one in self.figures]
        widths = [max(len(row[column]) for row in rows) for column in range(3)]
        table = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        ]
        return "".join(f"  {line}\n" for line in (*self.lines, *table, self.horizon))


@dataclass(frozen=True, slots=True)
class ErrorFigure:
    """One way to say the error [m]; None where there is no design or no simulation.

    low, high: the confidence interval of a simulated figure, without and with the findings.
    """

    key: str
    label: str
    before_m: float | None
    after_m: float | None
    before_interval_m: tuple[float | None, float | None] | None = None
    after_interval_m: tuple[float | None, float | None] | None = None

    def words(self) -> tuple[str, str]:
        """Both figures as the console prints them."""
        return _length(self.before_m), _length(self.after_m)

    def to_json(self) -> Json:
        """An entry of `figures`."""
        pairs = (("before", self.before_interval_m), ("after", self.after_interval_m))
        intervals = {f"{key}_interval_m": list(pair) for key, pair in pairs if pair is not None}
        return {
            "figure": self.key,
            "label": self.label,
            "before_m": self.before_m,
            "after_m": self.after_m,
            **intervals,
        }


def as_measured(case: Case) -> Case:
    """The spec of the system that made a log: with choices open, its best design pinned."""
    if sole_design(build_problem(case)) is not None:
        return case
    problem, design = picked_design(case)
    if problem.combinations == 1:
        return case
    text = pinned_text(case, problem, design)
    return load_text(text, case.path, case.builtin)


def meaning(case: Case, found: Diagnosis, seed: int = 0) -> DesignMeaning | None:
    """Check the spec with and without the findings; None when nothing was found."""
    entries = found.effects_entries()
    if not entries:
        return None
    text = with_effects_text(case, entries)
    settings = CheckSettings(seed=seed)
    before = _checked(case, settings)
    after = _checked(load_text(text, case.path, case.builtin), settings)
    return DesignMeaning(
        text,
        before,
        after,
        (*_lines(before, after), *_why_models_differ(after)),
        error_figures(before, after),
        horizon_words(after["horizon"], given="horizon" in case.spec.model_fields_set),
    )


def _checked(case: Case, settings: CheckSettings) -> Json:
    """The verdict; `indeterminate` with its `refusal` where an effect has no place in a budget."""
    try:
        return check_loaded(case, settings).to_json()
    except NoBudget as refused:
        words = [f"{one.message}; {one.hint}" for one in refused.problems]
        parts = frame(case, build_problem(case), settings.seed)
        return {**Verdict(verdict="indeterminate", **parts).to_json(), "refusal": words}


def error_figures(before: Json, after: Json) -> tuple[ErrorFigure, ...]:
    """Syncline, per-sensor model and simulated 95 % quantile, without and with the findings."""
    found = [
        ErrorFigure(
            f"{model}_m", label + (", which decides" if _decides(after, model) else ""),
            _modelled(before, model), _modelled(after, model),
        )
        for model, label in MODELS.items()
    ]  # fmt: skip
    one, other = _quantile(before), _quantile(after)
    label = f"simulated, {100 * float(QUANTILE):g} % of errors below"
    simulated = ErrorFigure(
        "simulated_95_m", label, one.get("value_m"), other.get("value_m"), _ends(one), _ends(other)
    )
    return (*found, simulated)


def _why_models_differ(after: Json) -> Iterator[str]:
    whole, own = _modelled(after, "syncline"), _modelled(after, "per_sensor")
    if whole is not None and own is not None and whole > WORTH_SAYING * own:
        yield (
            "The Syncline charges the largest timestamp difference of the system to all of its "
            "motion, the per-sensor model each sensor's own to what that sensor measures."
        )


def _decides(verdict: Json, model: str) -> bool:
    return bool(verdict["spec"].get("sync_model") == model)


def _modelled(verdict: Json, model: str) -> float | None:
    models = (verdict.get("syncline") or {}).get("models") or {}
    return (models.get(model) or {}).get("total_m")


def _quantile(verdict: Json) -> Json:
    quantiles = (verdict.get("monte_carlo") or {}).get("quantiles") or {}
    return quantiles.get(QUANTILE) or {}


def _ends(quantile: Json) -> tuple[float | None, float | None] | None:
    return (quantile.get("low_m"), quantile.get("high_m")) if quantile else None


def _length(value_m: float | None) -> str:
    return "-" if value_m is None else format_quantity(value_m, Dimension.LENGTH)


def horizon_words(horizon: Json, *, given: bool) -> str:
    """Over how long, how far and how steep a mission drifting effects are charged."""
    duration = format_duration(horizon["duration_s"])
    extent = format_quantity(horizon["extent_m"], Dimension.LENGTH)
    tilt = format_quantity(horizon["tilt_rad"], Dimension.ANGLE)
    whose = "the spec's" if given else "by default; `horizon:` in the spec changes it"
    return (
        f"Horizon: {duration}, {extent} about the origin, tilt up to {tilt} ({whose}). "
        "What drifts or grows with distance is charged for all of it."
    )


def format_duration(seconds: float) -> str:
    """`1 h`, `90 min`, `45 s`: a time that people plan missions in."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size and (seconds / size) % 0.5 == 0.0:
            return f"{seconds / size:g} {unit}"
    return format_quantity(seconds, Dimension.TIME)


def _lines(before: Json, after: Json) -> Iterator[str]:
    yield f"Without the findings the spec {_said(before)}; with them, it {_said(after)}."
    yield from after.get("refusal") or before.get("refusal") or []
    for row in after["requirements"]:
        if row["status"] == "fail" and row["value"] is not None:
            value, limit = _figure(row, "value"), _figure(row, "limit")
            yield f"{row['id']}: {value} against a limit of {limit}."
    if before["spec"]["open_roles"] and "refusal" not in {*before, *after}:
        yield from _payload_lines(before, after)
    elif after["verdict"] == "fails":
        yield (
            "The design is pinned; with candidates in the spec, the cheapest design that still "
            "meets the requirements would be named here."
        )


def _said(verdict: Json) -> str:
    return WORDS[verdict["verdict"]]


def _figure(row: Json, key: str) -> str:
    dimension = Dimension.LENGTH if row["unit"] == "m" else Dimension.DIMENSIONLESS
    return format_quantity(row[key], dimension) + ("" if row["unit"] in "m1" else f" {row['unit']}")


def _payload_lines(before: Json, after: Json) -> Iterator[str]:
    """Which candidates meet the requirements now."""
    if after["verdict"] == "infeasible":
        yield from after["infeasibility"]["text"]
        return
    old, new = _payload(before), _payload(after)
    changes = [f"{role}: {old[role]} -> {new[role]}" for role in new if old.get(role) != new[role]]
    if not changes:
        yield "The same payload is still the best one."
        return
    yield "Another payload meets the requirements now:"
    yield from (f"  {change}" for change in changes)
    costs = [verdict["design"]["cost"] for verdict in (before, after)]
    if None not in costs:
        currency = after["design"]["currency"]
        change = format_quantity(abs(costs[1] - costs[0]), Dimension.MONEY, currency=currency)
        yield f"  {change} {'more' if costs[1] >= costs[0] else 'less'}"


def _payload(verdict: Json) -> dict[str, str]:
    return {
        f"{stage['name']} {role}": f"{entry['sensor']} by {entry['timestamping']}"
        for stage in (verdict["design"] or {"stages": []})["stages"]
        for role, entry in stage["roles"].items()
    }


def _summary(verdict: Json) -> Json:
    keys = ("verdict", "requirements", "design", "infeasibility")
    return {key: verdict[key] for key in keys if key in verdict}
