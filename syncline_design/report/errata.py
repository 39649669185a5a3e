"""Which of the paper's documented errata bear on a verdict, told beside it."""

from __future__ import annotations

from typing import Final

from syncline_design.paper.errata import ERRATA
from syncline_design.report.verdict_tables import roles
from syncline_design.report.verdict_words import Json, items, part

# erratum -> catalog entries that must all be in the design for it to matter
NEEDED: Final[dict[str, frozenset[str]]] = {
    "auv_row": frozenset({"auv"}),
    "auv_speed_digits": frozenset({"auv", "kongsberg_m3"}),
    "survey_roof": frozenset({"auv"}),
    "fixed_wing_rate": frozenset({"uav_fixed_wing", "riegl_vux1uav"}),
}


def relevant(verdict: Json) -> list[str]:
    """Reasons of the errata that touch this verdict's platforms, sensors or lever arms."""
    present = {str(entry.get("sensor")) for _, _, entry in roles(verdict)}
    for stage in items(part(verdict, "spec"), "stages"):
        present.add(str(part(stage, "platform").get("id")).replace("auv_printed", "auv"))
    with_lever_arm = bool(part(part(verdict, "syncline"), "lever_arm"))
    return [
        f"{erratum.where[:1].upper()}{erratum.where[1:]}: {erratum.reason}"
        for erratum in ERRATA
        if (erratum.id in NEEDED and present >= NEEDED[erratum.id])
        or (erratum.id == "lever_arm" and with_lever_arm)
    ]
