"""The words of the results, each once: what a code of ours is called wherever a person reads it."""

from __future__ import annotations

import re
from typing import Final

from syncline_design.model.quantity import split_suffix
from syncline_design.report.document import Outcome

OUTCOMES: Final[dict[str, Outcome]] = {
    "meets": Outcome("good", "\u2713", "Meets every requirement"),
    "fails": Outcome("bad", "\u2717", "Does not meet its requirements"),
    "infeasible": Outcome("bad", "\u2298", "Infeasible: no design meets the requirements"),
    "indeterminate": Outcome("warn", "?", "No verdict"),
    "refused": Outcome("bad", "!", "Refused: the spec cannot be read"),
}
BRIEF: Final[dict[str, Outcome]] = {  # the same in a cell or a legend
    "meets": Outcome("good", "\u2713", "meets"),
    "fails": Outcome("bad", "\u2717", "does not meet"),
    "infeasible": Outcome("bad", "\u2298", "infeasible"),
    "indeterminate": Outcome("warn", "?", "no verdict"),
}
QUALIFYING: Final[dict[str, str]] = {
    "worst-case-above-limit": "its certified worst case at one sigma",
    "quantile-above-limit": "its 95 % quantile",
}
STATUSES: Final[dict[str, Outcome]] = {
    "pass": Outcome("good", "\u2713", "pass"),
    "fail": Outcome("bad", "\u2717", "fail"),
    "waived": Outcome("warn", "\u25d0", "waived"),
    "indeterminate": Outcome("warn", "?", "no verdict"),
}
SINCE: Final[dict[str, Outcome]] = {
    "worse": Outcome("bad", "\u2717", "worse"),
    "new": Outcome("warn", "+", "new"),
    "same": Outcome("good", "=", "no worse"),
    "better": Outcome("good", "\u2713", "better"),
    "gone": Outcome("warn", "-", "no longer required"),
}
KINDS: Final[dict[str, str]] = {
    "accuracy": "Syncline error",
    "sync": "\u03c4 / \u03c4_crit, largest",
    "cost": "cost",
    "mass": "mass",
    "power": "power",
    "monte_carlo": "simulated error, quantile",
    "worst_case": "certified worst case",
    "thu": "horizontal error, quantile (THU)",
    "tvu": "vertical error, quantile (TVU)",
    "rmse": "root mean square error",
    "quantile": "error, quantile",
    "sample_spacing": "ground between two samples",
    "failing_share": "share of figures that fail",
    "feasible": "entries that cannot work where they stand",
}
AXES: Final[dict[str, str]] = {"horizontal": "horizontal", "vertical": "vertical", "3d": "3D"}
TERMS: Final[dict[str, str]] = {
    "sigma_p": "position noise \u03c3_p",
    "sigma_Theta*d": "attitude noise \u03c3_\u0398\u00b7d",
    "sigma_r": "range noise \u03c3_r",
    "sigma_u*d": "bearing noise \u03c3_u\u00b7d",
    "(v_max+d*omega_max)*2d/c": "sound under way (v_max + d\u00b7\u03c9_max)\u00b72d/c",
    "v_object*2d/c": "sound under way to a vehicle that moves v_object\u00b72d/c",
    "a_max*T^2/8": "interpolated position a_max\u00b7T\u00b2/8",
    "alpha_max*T^2/8*d": "interpolated attitude \u03b1_max\u00b7T\u00b2/8\u00b7d",
    "v_max*tau": "translation v_max\u00b7\u03c4",
    "d*omega_max*tau": "rotation d\u00b7\u03c9_max\u00b7\u03c4",
}
PRIMITIVES: Final[dict[str, str]] = {
    "pps": "1PPS input",
    "network": "network time",
    "tov": "time-of-validity pulse",
    "trigger": "trigger",
    "arrival": "on arrival",
}
# A spec or a case as the subject of a sentence: of one, of several.
VERBS: Final[dict[str, tuple[str, str]]] = {
    "meets": ("meets its requirements", "meet their requirements"),
    "fails": ("does not meet them", "do not meet them"),
    "infeasible": ("is infeasible", "are infeasible"),
    "indeterminate": ("got no verdict", "got no verdict"),
    "refused": ("is refused", "are refused"),
}
ENVELOPES: Final[dict[str, str]] = {
    "limits": "speed and turn rate at their limits, directions free",
    "inside": "speed and turn rate uniform up to their limits, directions free",
    "trajectory": "along the trajectory",
}
OBJECTIVES: Final[dict[str, str]] = {
    "error": "smallest error",
    "cost": "least cost",
    "mass": "least mass",
    "power": "least power",
}
TIMELINES: Final[dict[str, str]] = {"utc": "UTC", "host": "host clock"}
LEDGER_KINDS: Final[dict[str, str]] = {
    "sensor": "sensor",
    "sync": "synchronisation",
    "systematic": "known effect",
    "underway": "between samples",
}
SYNC_MODELS: Final[dict[str, str]] = {
    "syncline": "Syncline (the paper's)",
    "per_sensor": "per sensor (tighter)",
}


def effect_words(text: str) -> str:
    """`lever_arm(position): x_m, z_m` as `lever arm (position): x, z`: as the field says it."""
    name, colon, parts = text.partition(": ")
    shown = re.sub(r"(?<=\w)\(", " (", name).replace("_", " ")
    stems = ", ".join(split_suffix(part)[0].replace("_", " ") for part in parts.split(", "))
    return f"{shown}{colon}{stems}"
