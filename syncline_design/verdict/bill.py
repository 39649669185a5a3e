"""The bill of materials of a design: what to buy, line by line, in the names of the catalogs.

It is made from the entries themselves, not from the sums of the choice, so that it can be held
against them.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from syncline_design.choice.evaluate import chosen_clocks, chosen_options, evaluate
from syncline_design.choice.table import Design, Problem
from syncline_design.model.quantity import Quantity
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import Product
from syncline_design.verdict.named import BillLine

_RESOURCES = ("cost", "mass", "power")


def bill_of_materials(case: Case, problem: Problem, design: Design) -> tuple[BillLine, ...]:
    """Sensors with their timestamping stage by stage, then what each vehicle shares."""
    return tuple(_line(case, *one) for one in _bought(case, problem, design))


def total(lines: tuple[BillLine, ...], name: str) -> float | None:
    """The sum of a column, exact in what the lines say; None where a line does not say."""
    amounts = [getattr(line, name) for line in lines]
    if any(amount is None for amount in amounts):
        return None
    return float(sum((Fraction(repr(amount)) for amount in amounts), Fraction(0)))


# Stage or vehicle, use, id, entry, quantity, and whether it is owned already.
Purchase = tuple[str, str, str, Product, int, bool]


def _bought(case: Case, problem: Problem, design: Design) -> Iterator[Purchase]:
    for table, option in zip(problem.roles, chosen_options(problem, design), strict=True):
        role = case.stages[table.stage].role(table.role)
        assert role is not None
        for sensor in (one for one in role.sensors if one.id == option.sensor):
            use = f"{table.role} sensor"
            yield table.stage_name, use, option.sensor, sensor.entry, 1, sensor.owned
        method = role.method(option.method)
        if method is not None:
            yield table.stage_name, f"{table.role} timestamping", option.method, method, 1, False
    for units in evaluate(problem, design).units:
        identity = problem.infrastructure[units.infrastructure].id
        place = problem.vehicles[units.vehicle].name
        item = case.hardware[identity]
        yield place, "shared hardware", identity, item.entry, units.count, item.owned
    for vehicle, clock in zip(problem.vehicles, chosen_clocks(problem, design), strict=True):
        for one in (one for one in case.clocks(vehicle.name) if one.id == clock.id):
            yield vehicle.name, "host clock", one.id, one.entry, 1, one.owned


def _line(
    case: Case, place: str, use: str, identity: str, entry: Product, count: int, owned: bool
) -> BillLine:
    cost, mass, power = (_amount(case, getattr(entry, name), count) for name in _RESOURCES)
    basis = _basis(entry, owned)
    return BillLine(place, use, entry.name or identity, identity, count, cost, mass, power, basis)


def _amount(case: Case, each: Quantity | None, count: int) -> float | None:
    """All pieces of a line together; money in the spec's currency, each to the cent, halves up."""
    if each is None:
        return None
    if each.currency is None:
        return float(each.exact * count)
    cents = case.spec.in_currency(each) * 100
    return float(Fraction((cents + Fraction(1, 2)).__floor__() * count, 100))


def _basis(entry: Product, owned: bool) -> str:
    """What cost, mass and power stand on: `source`, `stated` where an entry names none, or which of
    them on what else.

    Nothing weighs nothing and needs no source.  Of what is owned: `owned`, and what else its mass
    and power stand on.
    """
    stated = {name: getattr(entry, name) for name in _RESOURCES}
    told = [name for name, each in stated.items() if each is not None and each.exact != 0]
    told = told or [name for name, each in stated.items() if each is not None]
    own = "source" if entry.source else "stated"
    kinds = {name: entry.basis_of(name) or own for name in told}
    if owned:
        rest = (f"{k}: {kind}" for k, kind in kinds.items() if (k, kind) != (k, "source"))
        return ", ".join(("owned", *(one for one in rest if not one.startswith("cost"))))
    if len(set(kinds.values())) <= 1:
        return next(iter(kinds.values()), "unknown")
    return ", ".join(f"{name}: {kind}" for name, kind in kinds.items())
