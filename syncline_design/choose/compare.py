"""Two specs and what they choose, told apart in words: `v_max 2 to 3 m/s: payload changes`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from syncline_design.choose.decide import choose
from syncline_design.choose.evaluate import chosen_options, evaluate
from syncline_design.choose.fixes import in_unit_of
from syncline_design.choose.outcome import Choice
from syncline_design.choose.presentation import amount_text, length_text
from syncline_design.choose.variations import PLATFORM_FIGURES, Build, platform_figure
from syncline_design.design_space import RESOURCES, Design, Problem
from syncline_design.loading import LoadedSpec
from syncline_design.problem import build_problem, sole_design
from syncline_design.units import Quantity


@dataclass(frozen=True, slots=True)
class Comparison:
    """What differs between two specs, and what follows for the choice."""

    changes: tuple[str, ...]
    consequences: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """As data."""
        return {"changes": list(self.changes), "consequences": list(self.consequences)}

    @property
    def text(self) -> str:
        """One line: what changed, then what that does."""
        changes = ", ".join(self.changes) or "no change of platform, requirement or objective"
        return f"{changes}: {', '.join(self.consequences) or 'nothing changes'}"


def compare(before: LoadedSpec, after: LoadedSpec, build: Build = build_problem) -> Comparison:
    """Differences of two specs and of the designs they lead to."""
    one, other = (_chosen(build(loaded)) for loaded in (before, after))
    changes = (*_platform_changes(before, after), *_requirement_changes(before, after))
    return Comparison(changes, tuple(_consequences(one, other, after.spec.currency)))


def _chosen(problem: Problem) -> tuple[Problem, Design | None]:
    """The design of a spec: the only one it allows, else the best."""
    sole = sole_design(problem)
    if sole is not None:
        return sole
    found = choose(problem)
    return problem, found.design if isinstance(found, Choice) else None


def _platform_changes(before: LoadedSpec, after: LoadedSpec) -> Iterator[str]:
    names = [stage.name for stage in before.spec.stages]
    for index, stage in enumerate(after.spec.stages):
        if stage.name not in names:
            yield f"stage {stage.name} is new"
            continue
        for figure, (_, dimension) in PLATFORM_FIGURES.items():
            old = platform_figure(before, names.index(stage.name), figure)
            new = platform_figure(after, index, figure)
            if old != new:
                texts = [in_unit_of(getattr(v, "text", ""), v, dimension) for v in (old, new)]
                yield f"{figure} of {stage.name} {_from_to(texts[0], texts[1])}"
    gone = set(names) - {stage.name for stage in after.spec.stages}
    yield from (f"stage {name} is gone" for name in names if name in gone)


def _from_to(old: str, new: str) -> str:
    """`2 to 3 m/s` where both have one unit."""
    (a, unit), (b, other) = (text.partition(" ")[::2] for text in (old, new))
    return f"{a} to {b} {unit}" if unit == other else f"{old} to {new}"


def _requirement_changes(before: LoadedSpec, after: LoadedSpec) -> Iterator[str]:
    old = {r.id: r for r in before.spec.requirements}
    new = {r.id: r for r in after.spec.requirements}
    for name, requirement in new.items():
        if name not in old:
            yield f"{name} is new ({_limit(requirement.limit)})"
        elif old[name].limit != requirement.limit:
            texts = (_limit(old[name].limit), _limit(requirement.limit))
            yield f"{name} {_from_to(*texts)}"
    yield from (f"{name} is gone" for name in old if name not in new)
    if before.spec.objective != after.spec.objective:
        yield f"objective {before.spec.objective} to {after.spec.objective}"


def _limit(limit: float) -> str:
    return limit.text if isinstance(limit, Quantity) else f"{limit:g}"


def _consequences(
    one: tuple[Problem, Design | None], other: tuple[Problem, Design | None], currency: str
) -> Iterator[str]:
    (old_problem, old), (new_problem, new) = one, other
    if old is None or new is None:
        if (old is None) != (new is None):
            yield "no design meets it any more" if new is None else "a design now meets it"
        return
    changed = _payload_changes(old_problem, old, new_problem, new)
    if changed:
        yield "payload changes (" + "; ".join(changed) + ")"
    sums = evaluate(old_problem, old), evaluate(new_problem, new)
    for resource in RESOURCES:
        amounts = [found.amount(resource) for found in sums]
        if amounts[0] is not None and amounts[1] is not None and amounts[0] != amounts[1]:
            step = amounts[1] - amounts[0]
            sign = "+" if step > 0 else "-"
            yield f"{sign}{amount_text(abs(step), resource, currency)}"
    if sums[0].error_m != sums[1].error_m:
        yield f"error {length_text(sums[0].error_m)} to {length_text(sums[1].error_m)}"


def _payload_changes(
    old_problem: Problem, old: Design, new_problem: Problem, new: Design
) -> list[str]:
    before = {
        (table.stage_name, table.role): option
        for table, option in zip(old_problem.roles, chosen_options(old_problem, old), strict=True)
    }
    out = []
    for table, option in zip(new_problem.roles, chosen_options(new_problem, new), strict=True):
        was = before.get((table.stage_name, table.role))
        if was is None or was.names == option.names:
            continue
        where = f"{table.role} of {table.stage_name}"
        if was.sensor != option.sensor:
            out.append(f"{where} {was.sensor} to {option.sensor}")
        else:
            out.append(f"{where} stamped by {was.method} to {option.method}")
    return out
