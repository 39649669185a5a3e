"""Which of the paper's documented errata bear on a verdict, told beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from syncline_design.paper.errata import ERRATA

if TYPE_CHECKING:
    from syncline_design.verdict.tree import Verdict

# erratum -> catalog entries that must all be in the design for it to matter
NEEDED: Final[dict[str, frozenset[str]]] = {
    "auv_row": frozenset({"auv"}),
    "auv_speed_digits": frozenset({"auv", "kongsberg_m3"}),
    "survey_roof": frozenset({"auv"}),
    "fixed_wing_rate": frozenset({"uav_fixed_wing", "riegl_vux1uav"}),
}


def relevant(verdict: Verdict) -> list[str]:
    """Reasons of the errata that touch this verdict's platforms, sensors or lever arms."""
    design = verdict.design
    present = set() if design is None else {entry.sensor for _, _, entry in design.roles}
    present |= {s.platform.id.replace("auv_printed", "auv") for s in verdict.spec.stages}
    return [
        f"{erratum.where[:1].upper()}{erratum.where[1:]}: {erratum.reason}"
        for erratum in ERRATA
        if (erratum.id in NEEDED and present >= NEEDED[erratum.id])
        or (erratum.id == "lever_arm" and verdict.syncline is not None)
    ]
