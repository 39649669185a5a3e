"""Choices as plain-text tables and CSV; numbers only, the words come from the catalogs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction

from syncline_design.choice.acceptable import judgement
from syncline_design.choice.evaluate import chosen_clocks, chosen_options, evaluate
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.prices import Step
from syncline_design.choice.slack import Slack
from syncline_design.choice.table import Design, Problem, ResourceName
from syncline_design.model.quantity import Dimension, format_quantity

DIMENSIONS: dict[ResourceName, Dimension] = {
    "cost": Dimension.MONEY,
    "mass": Dimension.MASS,
    "power": Dimension.POWER,
}
UNITS = {
    "m": Dimension.LENGTH,
    "s": Dimension.TIME,
    "m/s": Dimension.SPEED,
    "rad/s": Dimension.ANGULAR_RATE,
}
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def amount_text(amount: Fraction | float | None, resource: ResourceName, currency: str) -> str:
    """`59 862.35 EUR`, `1.2 kg`; `unknown` where a catalog entry does not say."""
    if amount is None:
        return "unknown"
    return format_quantity(float(amount), DIMENSIONS[resource], 5, currency)


def length_text(value_m: float) -> str:
    """`29.45 mm`: a length with four figures."""
    return format_quantity(value_m, Dimension.LENGTH)


def target_text(value_m: float) -> str:
    """A length rounded up to four figures: a target that the printed price does buy."""
    if not value_m > 0.0 or not math.isfinite(value_m):
        return length_text(value_m)
    scale = Fraction(10) ** (3 - math.floor(math.log10(value_m)))
    return length_text(float(math.ceil(Fraction(value_m) * scale) / scale))


def role_headers(problem: Problem) -> list[str]:
    """`uav position` and so on, one per role."""
    return [f"{table.stage_name} {table.role}" for table in problem.roles]


def role_cells(problem: Problem, design: Design) -> list[str]:
    """`ublox_f9p_rtk by pps, gpio` per role."""
    return [
        f"{option.sensor} by {option.primitive}, {option.method}"
        for option in chosen_options(problem, design)
    ]


def front_table(
    problem: Problem, points: Sequence[FrontPoint], resource: ResourceName, currency: str
) -> list[str]:
    """The Pareto front, one line per point; a point that simulation leaves open says so."""
    left_open = any(point.undecided for point in points)
    rows = [
        [
            amount_text(point.amount, resource, currency),
            length_text(point.error_m),
            *role_cells(problem, point.design),
            *([_open_text(point.undecided)] if left_open else []),
        ]
        for point in points
    ]
    heads = [resource, "error", *role_headers(problem), *(["simulation"] if left_open else [])]
    return table(heads, rows)


def _open_text(requirements: Sequence[str]) -> str:
    """Simulated requirements that samples leave open for a design."""
    return f"{', '.join(requirements)} undecided" if requirements else ""


def designs_table(problem: Problem, designs: Iterable[Design], currency: str) -> list[str]:
    """Designs one per line, best first, with what they cost and reach, and what is left open."""
    designs = list(designs)
    undecided = [judgement(problem, design).undecided for design in designs]
    left_open = any(undecided)
    rows = []
    for place, design in enumerate(designs, 1):
        found = evaluate(problem, design)
        rows.append(
            [
                str(place),
                amount_text(found.cost, "cost", currency),
                amount_text(found.mass, "mass", currency),
                amount_text(found.power, "power", currency),
                length_text(found.error_m),
                *role_cells(problem, design),
                *([_open_text(undecided[place - 1])] if left_open else []),
            ]
        )
    heads = ["", "cost", "mass", "power", "error", *role_headers(problem)]
    return table([*heads, *(["simulation"] if left_open else [])], rows)


def staircase_lines(
    steps: Sequence[Step], currency: str, resource: ResourceName = "cost"
) -> list[str]:
    """The price of accuracy in words, loosest target first."""
    out = []
    for step in steps:
        price = amount_text(step.amount, resource, currency)
        line = f"{price} buys any target from {target_text(step.tightest_m)}"
        if step.looser_than_m is not None:
            line += f" up to {target_text(step.looser_than_m)}"
        if step.extra is not None:
            line += f" ({amount_text(step.extra, resource, currency)} more)"
        out.append(line)
    return out


def slack_table(rows: Sequence[Slack]) -> list[str]:
    """The slack ledger, one line per term."""
    return table(
        ["term", "now", "verdict fails at", "because of", "payload changes at"],
        [
            [
                f"{row.stage} {row.term}",
                format_quantity(row.value, UNITS[row.unit]),
                _figure(row, row.fails_at, "verdict"),
                row.limited_by or "",
                _figure(row, row.payload_changes_at, "payload"),
            ]
            for row in rows
        ],
    )


def _figure(row: Slack, value: float | None, what: str) -> str:
    if value is not None:
        return format_quantity(value, UNITS[row.unit])
    if what in row.never:
        return "never"
    if row.searched_to is None:
        return "not known"
    return f"not up to {format_quantity(row.searched_to, UNITS[row.unit])}"


def table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns aligned to the left, two spaces apart."""
    cells = [list(headers), *[list(row) for row in rows]]
    widths = [max(len(row[k]) for row in cells) for k in range(len(headers))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
    return [line.rstrip() for line in lines]


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
    for header in role_headers(problem):
        for part in ("sensor", "primitive", "timestamping"):
            yield f"{header.replace(' ', '_')}_{part}"
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
