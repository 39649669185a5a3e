"""Designs and the front as CSV: figures in full, choices by the catalogs' names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Any

from syncline_design.choice.evaluate import chosen_clocks, chosen_options, evaluate
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.table import Design, Problem
from syncline_design.report.csv_out import plain_csv
from syncline_design.verdict.optimization import Optimized


def optimization_csv(found: Optimized) -> str:
    """The front with --pareto, else the designs."""
    if found.text is not None:
        return family_csv(found)
    if found.settings.pareto:
        return front_csv(found.problem, found.points, found.settings.resource)
    return designs_csv(found.problem, found.designs)


def family_csv(found: Optimized) -> str:
    """Of several missions the front or the designs, their error the largest of any mission."""
    resource = found.settings.resource
    listed = found.result.front if found.settings.pareto else found.result.designs
    names = [resource] if found.settings.pareto else ["cost", "mass", "power"]
    over = ["figure_m"] if found.result.front_figure is not None else []
    units = {"mass": "mass_kg", "power": "power_w"} if not found.settings.pareto else {}
    headers = [*(units.get(name, name) for name in names), *over, "error_m"]
    rows: list[list[Any]] = []
    for one in listed or ():
        if not rows:
            slots = [f"{s.name} {role}".replace(" ", "_") for s, role, _ in one.design.roles]
            parts = ("sensor", "primitive", "timestamping")
            headers += [f"{slot}_{part}" for slot in slots for part in parts]
        cells = [part for *_, r in one.design.roles
                 for part in (r.sensor, r.primitive, r.timestamping)]  # fmt: skip
        rows.append([*(getattr(one, name) for name in (*names, *over)), one.error_m, *cells])
    return plain_csv(headers, rows)


def front_csv(problem: Problem, points: Sequence[FrontPoint], resource: ResourceName) -> str:
    """The front as CSV: amount, error in m, then sensor, primitive, method of every role."""
    over = [point.figure_m for point in points if point.figure_m is not None]
    headers = [resource, *(["figure_m"] if over else []), "error_m", *_design_headers(problem)]
    rows: list[list[Any]] = [
        [
            _plain(point.amount), *([point.figure_m] if over else []), point.error_m,
            *_design_cells(problem, point.design),
        ]
        for point in points
    ]  # fmt: skip
    return plain_csv(headers, rows)


def designs_csv(problem: Problem, designs: Iterable[Design]) -> str:
    """Designs as CSV: cost, mass, power, error in m, then their choices."""
    headers = ["cost", "mass_kg", "power_w", "error_m", *_design_headers(problem)]
    rows: list[list[Any]] = []
    for design in designs:
        found = evaluate(problem, design)
        sums = [_plain(found.cost), _plain(found.mass), _plain(found.power)]
        rows.append([*sums, found.error_m, *_design_cells(problem, design)])
    return plain_csv(headers, rows)


def _plain(amount: Fraction | float | None) -> int | float | None:
    """Without a point where it is whole."""
    if amount is None:
        return None
    exact = Fraction(amount)
    return exact.numerator if exact.denominator == 1 else float(exact)


def _design_headers(problem: Problem) -> Iterator[str]:
    for roles in problem.roles:
        header = f"{roles.stage_name} {roles.role}".replace(" ", "_")
        for part in ("sensor", "primitive", "timestamping"):
            yield f"{header}_{part}"
    for vehicle in problem.vehicles:
        yield f"{vehicle.name}_clock"


def _design_cells(problem: Problem, design: Design) -> Iterator[str]:
    for option in chosen_options(problem, design):
        yield from option.names
    for clock in chosen_clocks(problem, design):
        yield clock.id or ""
