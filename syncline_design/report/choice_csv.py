"""Designs and the front as CSV: figures in full, choices by the catalogs' names."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction

from syncline_design.choice.evaluate import chosen_clocks, chosen_options, evaluate
from syncline_design.choice.options import ResourceName
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.table import Design, Problem
from syncline_design.verdict.optimise import Optimised

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def optimisation_csv(found: Optimised) -> str:
    """The front with --pareto, else the designs."""
    if found.settings.pareto:
        return front_csv(found.problem, found.points, found.settings.resource)
    return designs_csv(found.problem, found.designs)


def front_csv(problem: Problem, points: Sequence[FrontPoint], resource: ResourceName) -> str:
    """The front as CSV: amount, error in m, then sensor, primitive, method of every role."""
    headers = [resource, "error_m", *_design_headers(problem)]
    rows = [
        [_plain(point.amount), repr(point.error_m), *_design_cells(problem, point.design)]
        for point in points
    ]
    return _csv(headers, rows)


def designs_csv(problem: Problem, designs: Iterable[Design]) -> str:
    """Designs as CSV: cost, mass, power, error in m, then their choices."""
    headers = ["cost", "mass_kg", "power_w", "error_m", *_design_headers(problem)]
    rows = []
    for design in designs:
        found = evaluate(problem, design)
        sums = [_plain(found.cost), _plain(found.mass), _plain(found.power)]
        rows.append([*sums, repr(found.error_m), *_design_cells(problem, design)])
    return _csv(headers, rows)


def _plain(amount: Fraction | float | None) -> str:
    if amount is None:
        return ""
    exact = Fraction(amount)
    return str(exact.numerator) if exact.denominator == 1 else repr(float(exact))


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


def _csv(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Rows as CSV; text that a spreadsheet would run as a formula is quoted by an apostrophe."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([_inert(cell) for cell in headers])
    writer.writerows([_inert(cell) for cell in row] for row in rows)
    return out.getvalue()


def _inert(cell: str) -> str:
    if not cell.startswith(FORMULA_STARTS):
        return cell
    try:
        float(cell)
    except ValueError:
        return "'" + cell
    return cell
