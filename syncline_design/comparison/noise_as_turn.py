"""Noise of bearings that looks like that of an attitude, and the other way round.

An attitude whose noise is alike in all directions moves every beam across itself as bearings do
that are alike across the beam.  Where its readings' factors are unlike just so that they come to
one standard deviation, and bearings are left far less than their figure, the split has taken the
noise of one for that of the other, and no direction tells which.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from syncline_design.comparison.departing import Departing
from syncline_design.diagnosis.noise_split import NoiseFactors
from syncline_design.diagnosis.result import Estimate, Finding
from syncline_design.diagnosis.unlike_readings import READINGS
from syncline_design.effects import registry
from syncline_design.model.figure_text import to_digits
from syncline_design.model.normal import NORMAL_95

ALIKE: Final = 1.25  # largest standard deviation over the least that is one and the same
FAR_BELOW: Final = 0.5  # of their figure, that no bearings are better than


def either(
    found: Finding, factors: Mapping[str, NoiseFactors]
) -> tuple[Departing, Departing] | None:
    """The noise of an attitude that was found, and that of bearings that would do in its place;
    None where none would."""
    attitude = factors.get(f"{found.stage}/attitude")
    ranging = factors.get(f"{found.stage}/ranging")
    if found.sensor != "attitude" or registry()[found.effect].opens != "factor":
        return None
    if attitude is None or ranging is None or not _alike(attitude):
        return None
    bearings = next((p for p in ranging.parts if "azimuth" in p.readings), None)
    if bearings is None or bearings.value >= FAR_BELOW:
        return None
    loud = attitude.loudest
    own = attitude.sigma[READINGS["attitude"].index(loud.readings[0])]
    across = math.hypot(*ranging.sigma[1:]) / math.sqrt(2.0)
    more = [math.hypot(math.sqrt(max(f**2 - 1.0, 0.0)) * own / across, bearings.value)
            for f in (loud.value, loud.low, loud.high)]  # fmt: skip
    return _of(found, "attitude", loud.value, loud.low, loud.high), _of(found, "ranging", *more)


def _of(found: Finding, role: str, value: float, low: float, high: float) -> Departing:
    told = Estimate(value, (high - low) / (2.0 * NORMAL_95), "", True, to_digits(value, 3),
                    (low, high))  # fmt: skip
    name = registry()[found.effect].parameters[0].name
    return Departing(found.effect, (role,), found.stage, {name: told})


def _alike(attitude: NoiseFactors) -> bool:
    """Whether unlike factors of an attitude's readings come to one standard deviation."""
    if len(attitude.parts) < 2 or len(attitude.sigma) != len(READINGS["attitude"]):
        return False
    of = {name: part.value for part in attitude.parts for name in part.readings}
    both = zip(READINGS["attitude"], attitude.sigma, strict=True)
    sigmas = [of[name] * sigma for name, sigma in both]
    return max(sigmas) <= ALIKE * min(sigmas)
