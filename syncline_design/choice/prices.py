"""What entries cost, weigh and draw together.

Money is that of the spec's currency to the cent, halves up, piece by piece, as a price list in that
currency would have it: fronts, designs and bills of materials then add up alike.
"""

from __future__ import annotations

from fractions import Fraction

from syncline_design.choice.option import ResourceName, Resources
from syncline_design.choice.options import RESOURCES
from syncline_design.model.quantity import Quantity
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import (
    ClockEntry,
    InfrastructureEntry,
    SensorEntry,
    TimestampingEntry,
)
from syncline_design.spec.exact import fraction_of

Priced = SensorEntry | TimestampingEntry | ClockEntry | InfrastructureEntry


def resources_of(case: Case, *entries: Priced | None) -> Resources:
    """Sums over entries; None where one of them does not say."""
    sums: dict[str, Fraction | None] = {}
    for name in RESOURCES:
        amounts = [amount_of(case, name, entry) for entry in entries]
        known = [amount for amount in amounts if amount is not None]
        sums[name] = sum(known, Fraction(0)) if len(known) == len(amounts) else None
    return Resources(**sums)


def amount_of(case: Case, name: ResourceName, entry: Priced | None) -> Fraction | None:
    """What an entry takes; None where it does not say, or in a currency without a rate (loading
    refuses those of a spec's own).  Without an entry: nothing."""
    if entry is None:
        return Fraction(0)
    amount = getattr(entry, name)
    if name == "cost" and isinstance(amount, Quantity):
        if not case.spec.can_convert(amount):
            return None
        return to_the_cent(case.spec.in_currency(amount))
    return None if amount is None else fraction_of(amount)


def to_the_cent(amount: Fraction) -> Fraction:
    """An amount of money as it is charged; half a cent goes up."""
    return Fraction((100 * amount + Fraction(1, 2)).__floor__(), 100)
