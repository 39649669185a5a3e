"""Contradictions in the paper that bear on a verdict, told beside it.

Source: comparison of arXiv:2209.01136v2's text with its own tables; docs/theory.md has the full
list with the figures.
"""

from __future__ import annotations

from syncline_design.report.verdict_tables import roles
from syncline_design.report.verdict_words import Json, items, part

_AUV = (
    "The paper prints the AUV's row as 30 m/s and 5 m. Its survey table, its text and both system "
    "\u03c4_crit values only come out with 30 m and 2.0779 m/s; platform auv uses those, "
    "auv_printed the printed row."
)
_ROOF = (
    "The paper's text gives the survey roof as 1.67 m; its own formula and tables give 1.4127 m, "
    "and only that yields the printed 16 ms and 4 ms."
)
_FIXED_WING = (
    "Fixed wing with VUX-1UAV: the printed omega_max of 77.9 deg/s gives 158.06 \u00b5s where the "
    "table prints 157 \u00b5s; 45\u00b7\u221a3 = 77.94 deg/s gives 157.99 \u00b5s."
)
_LEVER_ARM = (
    "The paper's simulator turns the lever arm with the vehicle (v + omega \u00d7 l), its Syncline "
    "does not. This report gives both figures."
)


def relevant(verdict: Json) -> list[str]:
    """Errata that touch this verdict's platforms, sensors or lever arms."""
    platforms = {
        str(part(stage, "platform").get("id")) for stage in items(part(verdict, "spec"), "stages")
    }
    sensors = {str(entry.get("sensor")) for _, _, entry in roles(verdict)}
    found = []
    if platforms & {"auv", "auv_printed"}:
        found += [_AUV, _ROOF]
    if "uav_fixed_wing" in platforms and "riegl_vux1uav" in sensors:
        found.append(_FIXED_WING)
    if part(part(verdict, "syncline"), "lever_arm"):
        found.append(_LEVER_ARM)
    return found
