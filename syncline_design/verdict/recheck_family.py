"""What a family's payload costs, weighs and draws, added up anew from the names of what was chosen.

Shares no code with the tables or the merge: every piece is named, what several missions use counts
once, and shared hardware counts for the mission that needs most channels of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

from syncline_design.spec.case import Case
from syncline_design.spec.catalog import ClockEntry, TimestampingEntry
from syncline_design.spec.selection import Selection
from syncline_design.verdict.recheck_sums import BUDGETS, RecheckedPieces, SummedKind, sum_of

Piece = tuple[str, ...]  # what a piece is for, and which entry it is


def family_sums(
    missions: Sequence[tuple[Case, Selection]],
) -> dict[SummedKind, Fraction | None]:
    """Cost, mass and power of all that the missions need together."""
    bought: dict[Piece, RecheckedPieces] = {}
    boards: dict[Piece, RecheckedPieces] = {}
    for case, selection in missions:
        channels: Counter[tuple[str, str]] = Counter()
        vehicles = {stage.choice.name: stage.choice.vehicle_name for stage in case.stages}
        for picked in selection.roles:
            stage = next(one for one in case.stages if one.choice.name == picked.stage)
            role = stage.role(picked.role)
            if role is None:
                raise ValueError(f"{picked.stage} has no {picked.role}")
            slot = (picked.stage, picked.role, picked.sensor)
            bought[("sensor", *slot)] = RecheckedPieces(picked.sensor, role.sensor(picked.sensor))
            method = role.method(picked.method)
            if method is None:
                continue
            bought[("method", *slot, picked.method)] = RecheckedPieces(None, method)
            _connect(channels, vehicles[picked.stage], method)
        for clock in selection.clocks:
            entry = case.clock(clock.vehicle, clock.id)
            if entry is None or clock.id is None:
                continue
            bought["clock", clock.vehicle, clock.id] = RecheckedPieces(clock.id, entry)
            _connect(channels, clock.vehicle, entry)
        for (vehicle, item), count in channels.items():
            board = case.hardware[item].entry
            pieces = (count + board.channels - 1) // board.channels
            if pieces and pieces > getattr(boards.get((vehicle, item)), "pieces", 0):
                boards[vehicle, item] = RecheckedPieces(item, board, pieces)
    everything = [*bought.values(), *boards.values()]
    return {name: sum_of(missions[0][0], everything, name) for name in BUDGETS}


def _connect(
    channels: Counter[tuple[str, str]], vehicle: str, entry: TimestampingEntry | ClockEntry
) -> None:
    """The channels of shared hardware that a method or clock takes on a vehicle."""
    for item, count in entry.requires.items():
        channels[vehicle, item] += count
