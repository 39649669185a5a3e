"""What a reader has to know of entries that the spec owns: how many pieces that takes, if any."""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.spec.case import Case
from syncline_design.verdict.tree import Caution
from syncline_design.verdict.verified import Verified


def owned_cautions(case: Case, verified: Verified) -> Iterator[Caution]:
    """Several pieces of what is owned, each at no cost; what is owned and cannot be used."""
    for name, pieces in verified.exact.owned:
        if pieces > 1:
            yield Caution(
                "owned-pieces",
                f"the design takes {pieces} of {name}, each at no cost because {name} is owned: "
                "make sure that so many are there",
                entry=name,
            )
    usable = set(_usable(case))
    for name in case.spec.owned:
        if name not in usable:
            yield Caution(
                "owned-unused",
                f"{name} is owned, but no role or vehicle of the spec may use it: add it to the "
                "candidates, or take it out of owned",
                entry=name,
            )


def _usable(case: Case) -> Iterator[str]:
    for stage in case.stages:
        for role in stage.roles:
            yield from (one.id for one in role.sensors)
        yield from (one.id for one in stage.clocks)
    yield from case.hardware
