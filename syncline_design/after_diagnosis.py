"""What a diagnosis means for the design: the spec with the findings written in, checked again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from syncline_design.diagnose import Diagnosis
from syncline_design.loading import LoadedSpec, load_text
from syncline_design.optimisation import pinned_text
from syncline_design.spec_writer import with_effects_text
from syncline_design.units import Dimension, format_quantity
from syncline_design.verify import CheckSettings, check_loaded, picked_design

Json = dict[str, Any]
WORDS = {
    "meets": "meets its requirements",
    "fails": "does not meet its requirements",
    "infeasible": "no candidate design meets the requirements",
    "indeterminate": "could not be decided",
}


@dataclass(frozen=True, slots=True)
class DesignMeaning:
    """The verdict before and after the findings; spec_text is the spec that holds them."""

    spec_text: str
    before: Json
    after: Json
    lines: tuple[str, ...]

    def to_json(self) -> Json:
        """The `design` key of a diagnosis."""
        return {
            "before": _summary(self.before),
            "after": _summary(self.after),
            "text": list(self.lines),
        }


def as_measured(loaded: LoadedSpec) -> LoadedSpec:
    """The spec of the system that made a log: with choices open, its best design pinned."""
    problem, design = picked_design(loaded)
    if problem.combinations == 1:
        return loaded
    text = pinned_text(loaded, problem, design)
    return load_text(text, loaded.path, loaded.builtin)


def meaning(loaded: LoadedSpec, found: Diagnosis, seed: int = 0) -> DesignMeaning | None:
    """Check the spec with and without the findings; None when nothing was found."""
    entries = found.effects_entries()
    if not entries:
        return None
    text = with_effects_text(loaded, entries)
    settings = CheckSettings(seed=seed)
    before = check_loaded(loaded, settings)
    after = check_loaded(load_text(text, loaded.path, loaded.builtin), settings)
    return DesignMeaning(text, before, after, tuple(_lines(before, after)))


def _lines(before: Json, after: Json) -> Iterator[str]:
    yield f"Without the finding the spec {_said(before)}; with it, {_said(after)}."
    for row in after["requirements"]:
        if row["status"] == "fail" and row["value"] is not None:
            value, limit = _figure(row, "value"), _figure(row, "limit")
            yield f"{row['id']}: {value} against a limit of {limit}."
    if before["spec"]["open_roles"]:
        yield from _payload_lines(before, after)
    elif after["verdict"] == "fails":
        yield (
            "The design is pinned; with candidates in the spec, the cheapest design that still "
            "meets the requirements would be named here."
        )


def _said(verdict: Json) -> str:
    word = WORDS[verdict["verdict"]]
    total = (verdict.get("syncline") or {}).get("total_m")
    return word if total is None else f"{word} (error {format_quantity(total, Dimension.LENGTH)})"


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
