"""Where the Syncline paper contradicts itself: the documented errata.

Source: arXiv:2209.01136v2, its text and tables held against each other; the arithmetic is in
docs/theory.md and in the tests of `reproduce`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record

Key = tuple[str, str, str]  # table, row, column of printed.PRINTED


@dataclass(frozen=True, slots=True)
class Erratum(Record):
    """A place where the paper contradicts itself; cells: the printed figures that it explains."""

    id: str
    where: str
    reason: str
    cells: tuple[Key, ...] = ()


# What the explained figures come out at instead, in the cell's display unit; half a unit of the
# last digit is the tolerance.
COMES_OUT_AT: Final[Mapping[Key, str]] = {
    ("platforms", "auv", "v_max"): "2.0779",
    ("platforms", "auv", "distance"): "30",
    ("tau_crit_survey", "kongsberg_m3", "auv"): "82.7771",
    ("text", "survey_roof", "both_sv"): "1.4127",
    ("tau_crit_georeferencing", "riegl_vux1uav", "uav_fixed_wing"): "158.06",
}
ERRATA: Final = (
    Erratum(
        "auv_row",
        "table Robot platform parameters, AUV",
        "Printed v_max 30 m/s and d 5 m. The survey table, the text (30 m above the sea floor) and "
        "both system tau_crit only come out with d 30 m and v_max 2.0779 m/s. The catalog's auv "
        "is corrected, auv_printed is as printed.",
        (("platforms", "auv", "v_max"), ("platforms", "auv", "distance")),
    ),
    Erratum(
        "auv_speed_digits",
        "table Critical synchronization error, M3 Sonar on the AUV",
        "The corrected speed, 2.0779 m/s, is itself cut: the six AUV cells together ask for "
        "2.07795 to 2.07800 m/s, and 2.07797 m/s gives 82.776 ms.",
        (("tau_crit_survey", "kongsberg_m3", "auv"),),
    ),
    Erratum(
        "survey_roof",
        "text on the survey Synclines",
        "Printed 1.67 m. The paper's own formula and tables give 1.4127 m, and only 1.4127 m gives "
        "the printed system tau_crit of 16 and 4 ms.",
        (("text", "survey_roof", "both_sv"),),
    ),
    Erratum(
        "fixed_wing_rate",
        "table Minimum synchronization error, VUX-1 on the fixed wing",
        "77.9 deg/s is a rounding of 45 sqrt(3) = 77.94 deg/s, which gives 157.99 us; the printed "
        "rate gives 158.06 us.",
        (("tau_crit_georeferencing", "riegl_vux1uav", "uav_fixed_wing"),),
    ),
    Erratum(
        "superscripts",
        "GNSS and AUV INS measurement equations",
        "The sync error of the GNSS equation carries the superscript of the INS, that of the AUV's "
        "INS the one of the surface vessel; the GNSS and the AUV are meant. No figure changes.",
    ),
    Erratum(
        "lever_arm",
        "Syncline equation",
        "The lever arm enters the simulator (v + omega x l) but not the Syncline. For the large "
        "surface vessel b omega = 3.9 m/s exceeds v_max = 2.5 m/s, so its position tau_crit is "
        "optimistic by a factor of 2.6. Both values are shown by check.",
    ),
)
