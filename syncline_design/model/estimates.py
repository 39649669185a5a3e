"""Estimates for people: a value with its standard uncertainty in the unit that reads best.

The one formatter of what `diagnose` finds: console, JSON (`text`), HTML and Markdown all print its
words, so that a finding reads the same wherever it stands.
"""

from __future__ import annotations

import math

LADDERS: dict[str, tuple[tuple[str, float], ...]] = {
    "s": (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)),
    "m": (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)),
    "rad": (("deg", math.pi / 180.0), ("mdeg", math.pi / 180e3)),
    "rad/s": (("deg/s", math.pi / 180.0), ("deg/h", math.pi / 648e3)),
    "m/(m/s2)": (("m/(m/s2)", 1.0), ("mm/(m/s2)", 1e-3)),
    "": (("", 1.0), ("ppm", 1e-6)),
}


def figure(value: float, uncertainty: float | None = None, unit: str = "") -> str:
    """`87.1 ± 0.3 ms`: the uncertainty to one or two figures, the value to the same place."""
    name, scale = _rung(abs(value), unit)
    shown = value / scale
    if uncertainty is None or not uncertainty > 0.0 or not math.isfinite(uncertainty):
        return f"{shown:.4g} {name}".strip()
    spread = uncertainty / scale
    mantissa, exponent = f"{spread:.1e}".split("e")
    digits = 1 if float(mantissa) < 3.0 else 0  # two figures of 1.0 to 2.9, else one
    places = max(0, digits - int(exponent))
    return f"{shown:.{places}f} ± {spread:.{places}f} {name}".strip()


def _rung(size: float, unit: str) -> tuple[str, float]:
    ladder = LADDERS.get(unit, ((unit, 1.0),))
    for name, scale in ladder:
        if size >= scale:
            return name, scale
    return ladder[-1] if size > 0.0 else ladder[0]
