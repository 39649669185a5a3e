"""What a family buys: each mission's pieces once, shared hardware as often as one of them needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from syncline_design.choice.outcome import NoVerdict
from syncline_design.verdict.bill import total
from syncline_design.verdict.family_named import Sums
from syncline_design.verdict.named import BillLine, NamedDesign, SharedHardware
from syncline_design.verdict.recheck_sums import BUDGETS
from syncline_design.verdict.tree import Verdict


def bill_of(verdicts: Sequence[tuple[str, Verdict]]) -> tuple[BillLine, ...]:
    """What is bought for all missions (name, verdict): each piece once, shared hardware as often
    as one needs; what only some of them take says which.

    Timestamping belongs to its sensor: two sensors of one role are stamped by two pieces.
    """
    lines: dict[tuple[str, ...], BillLine] = {}
    takers: dict[tuple[str, ...], list[str]] = {}
    for name, verdict in verdicts:
        sensors: dict[str, str] = {}
        for line in verdict.bill_of_materials or ():
            role, _, part = line.use.partition(" ")
            if part == "sensor":
                sensors[f"{line.stage} {role}"] = line.entry
            stamped = sensors.get(f"{line.stage} {role}", "") if part == "timestamping" else ""
            key = (line.stage, line.use, line.entry, stamped)
            takers.setdefault(key, []).append(name)
            if key not in lines or lines[key].quantity < line.quantity:
                lines[key] = line
    return tuple(
        line if len(takers[key]) == len(verdicts) else replace(line, missions=tuple(takers[key]))
        for key, line in lines.items()
    )


def bought(
    design: NamedDesign,
    designs: Sequence[NamedDesign | None],
    sums: Sums,
    bill: tuple[BillLine, ...],
) -> NamedDesign:
    """A mission's design with what the whole family buys."""
    boards: dict[tuple[str, str], SharedHardware] = {}
    for own in designs:
        for board in own.infrastructure if own is not None else ():
            known = boards.get((board.vehicle, board.id))
            if known is None or known.count < board.count:
                boards[board.vehicle, board.id] = board
    cost, mass, power = (None if (a := sums[n]) is None else float(a) for n in BUDGETS)
    if cost is not None and total(bill, "cost") != cost:
        raise NoVerdict("the bill of the family does not add up to what its pieces cost")
    return replace(design, cost=cost, mass=mass, power=power, infrastructure=tuple(boards.values()))
