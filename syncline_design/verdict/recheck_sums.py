"""What a rechecked design costs, weighs and draws, added up anew from the catalogs' own entries.

What the spec owns costs nothing; any other price is taken in the spec's currency, to the cent with
halves up, piece by piece.  Mass and power are those of every piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case

SummedKind = Literal["cost", "mass", "power"]
BUDGETS: tuple[SummedKind, ...] = ("cost", "mass", "power")


@dataclass(frozen=True, slots=True)
class RecheckedPieces:
    """Pieces of an entry as its catalog has it; name: its id, None where it cannot be owned."""

    name: str | None
    entry: Any
    pieces: int = 1


def sum_of(case: Case, bought: Sequence[RecheckedPieces], of: SummedKind) -> Fraction | None:
    """The sum of a resource; None where one of the entries does not say."""
    total = Fraction(0)
    for one in bought:
        each = _each(case, one, of)
        if each is None:
            return None
        total += one.pieces * each
    return total


def _each(case: Case, one: RecheckedPieces, of: SummedKind) -> Fraction | None:
    """What one piece takes."""
    if of == "cost" and one.name in case.spec.owned:
        return Fraction(0)
    amount = getattr(one.entry, of)
    if amount is None:
        return None
    exact = money(case, amount)
    if of != "cost":
        return exact
    cents, rest = divmod(100 * exact.numerator, exact.denominator)
    return Fraction(cents + (2 * rest >= exact.denominator), 100)


def owned_pieces(case: Case, bought: Sequence[RecheckedPieces]) -> tuple[tuple[str, int], ...]:
    """Every owned entry that is in use, with how many pieces of it there have to be."""
    pieces: dict[str, int] = {}
    for one in bought:
        if one.name is not None and one.name in case.spec.owned:
            pieces[one.name] = pieces.get(one.name, 0) + one.pieces
    return tuple(pieces.items())


def money(case: Case, amount: Any) -> Fraction:
    """An amount as written; money in the spec's currency."""
    exact = Fraction(getattr(amount, "exact", amount))
    currency = getattr(amount, "currency", None)
    if currency in (None, case.spec.currency):
        return exact
    return exact * Fraction(getattr(case.spec.exchange_rates[currency], "exact", 0))
