"""The systems behind the paper's figures, built from a catalog, and the Synclines they plot.

Source: E. R. Jellum et al., arXiv:2209.01136v2.  Where a caption does not name the payload, the
one chosen here is said in the figure's note.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.model import syncline
from syncline_design.model.budget import budget
from syncline_design.model.horizon import Horizon
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.worst_case import worst_cases
from syncline_design.spec.catalog import Catalog, SensorEntry

Payload = tuple[str, str, str]  # position, attitude, ranging

FIGURE_1_SENSOR_ERROR_M = 0.1  # arbitrary, says the paper
FIGURE_2_PAYLOAD: Payload = ("ublox_f9p_rtk", "kongsberg_mru5", "riegl_vux1uav")
FIGURE_4_PAYLOADS: tuple[Payload, ...] = (
    FIGURE_2_PAYLOAD,
    ("ublox_f9p_pvt", "kongsberg_mru5", "riegl_vux1uav"),
    ("ublox_f9p_rtk", "sbg_ellipse", "riegl_vux1uav"),
    ("ublox_f9p_rtk", "kongsberg_mru5", "velodyne_alpha_prime"),
)
# Surveys: GNSS, INS and USBL of the vessel; the AUV has the same INS.
SURVEY_PAYLOAD: Payload = ("trimble_r12_rtk", "kongsberg_mru5", "sonardyne_usbl7000")
SURVEY_SONAR = "r2sonic_2026"
FIGURE_6_PAYLOADS: tuple[Payload, ...] = (
    ("ublox_f9p_rtk", "sbg_ellipse", "kongsberg_hipap502"),
    ("trimble_r12_rtk", "sbg_ellipse", "kongsberg_hipap502"),
    ("ublox_f9p_rtk", "kongsberg_mru5", "kongsberg_hipap502"),
    ("ublox_f9p_rtk", "sbg_ellipse", "sonardyne_usbl7000"),
)
FIGURE_7_PAYLOAD: Payload = ("ublox_f9p_rtk", "kongsberg_mru5", "kongsberg_hipap502")
LEVEL = Horizon(tilt_rad=0.0)  # the paper simulates level vehicles
FREE_CHOICE = "The paper does not name the payloads; these are chosen here."


@dataclass(frozen=True, slots=True)
class Curve:
    """One Syncline: error(tau) = sensor_error_m + sync_rate_mps * tau; system None in figure 1."""

    label: str
    sensor_error_m: float
    sync_rate_mps: float
    system: System | None

    @property
    def tau_crit_s(self) -> float:
        """Where the sync error equals the sensor error [s]."""
        return syncline.tau_crit_s(self.sensor_error_m, self.sync_rate_mps)

    def error_m(self, tau_s: Sequence[float]) -> tuple[float, ...]:
        """Error [m] at each tau [s]."""
        return tuple(
            syncline.syncline_m(tau, self.sensor_error_m, self.sync_rate_mps) for tau in tau_s
        )


@dataclass(frozen=True, slots=True)
class PaperPlot:
    """One figure of the paper; simulated: the paper sets its curve beside a simulation."""

    number: int
    title: str
    curves: tuple[Curve, ...]
    simulated: bool = False
    note: str = ""

    def tau_grid_s(self, points: int = 61) -> tuple[float, ...]:
        """Logarithmic grid [s], two decades around the extreme tau_crit of the curves."""
        ends = sorted(curve.tau_crit_s for curve in self.curves)
        low, high = math.log10(ends[0]) - 2.0, math.log10(ends[-1]) + 2.0
        return tuple(10.0 ** (low + (high - low) * i / (points - 1)) for i in range(points))


@dataclass(frozen=True, slots=True)
class PlottedCurve(Record):
    """One Syncline as numbers; error_m: at each tau of its figure."""

    label: str
    sensor_error_m: float
    sync_rate_mps: float
    tau_crit_s: float
    error_m: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class SimulatedPoint(Record):
    """The worst case found at tau over the Syncline there.

    The paper finds no significant deviation of the ratio from 1.
    """

    tau_s: float
    worst_case_m: float
    ratio_to_syncline: float


@dataclass(frozen=True, slots=True)
class PlottedFigure(Record):
    """A figure of the paper as numbers; simulated: empty where there is no simulation beside it."""

    number: int
    title: str
    note: str
    tau_s: tuple[float, ...]
    curves: tuple[PlottedCurve, ...]
    simulated: tuple[SimulatedPoint, ...]


def plotted(figure: PaperPlot, simulated: tuple[SimulatedPoint, ...]) -> PlottedFigure:
    """A figure with its curves over its own grid."""
    grid = figure.tau_grid_s()
    curves = tuple(
        PlottedCurve(c.label, c.sensor_error_m, c.sync_rate_mps, c.tau_crit_s, c.error_m(grid))
        for c in figure.curves
    )
    return PlottedFigure(figure.number, figure.title, figure.note, grid, curves, simulated)


def compare(figure: PaperPlot, points: int = 13, *, seed: int) -> tuple[SimulatedPoint, ...]:
    """The simulated points of a figure: nonlinear chain, magnitudes bounded, directions free.

    Empty for a figure that the paper does not set beside a simulation.  Lever arms of the length
    of the platform's baseline take part, as in the paper's simulator, so that the worst case may
    exceed the Syncline, which leaves them out.
    """
    if not figure.simulated:
        return ()
    (curve,) = figure.curves
    if curve.system is None:
        raise ValueError(f"figure {figure.number} has no system to simulate")
    grid = figure.tau_grid_s(points)
    found = worst_cases(curve.system, np.array(grid), seed)
    return tuple(
        SimulatedPoint(tau, worst.value_m, worst.value_m / error)
        for tau, worst, error in zip(grid, found, curve.error_m(grid), strict=True)
    )


def sigma_axes(entry: SensorEntry) -> tuple[float, float, float]:
    """Standard deviations per axis; a single figure holds for every axis."""
    if entry.modality == "ranging":
        bearing = entry.sigma_bearing
        azimuth, elevation = bearing if isinstance(bearing, tuple) else (bearing, bearing)
        return _three((entry.sigma_range, azimuth, elevation))
    value = entry.sigma_position if entry.modality == "position" else entry.sigma_attitude
    return _three(value if isinstance(value, tuple) else (value, value, value))


def platform_of(catalog: Catalog, name: str) -> Platform:
    """A catalog's platform in SI."""
    entry = catalog.platforms[name]
    figures = (entry.v_max, entry.omega_max, entry.distance, entry.baseline)
    return Platform(*(float(figure) for figure in figures))


def georeferencing_system(catalog: Catalog, platform: str, payload: Payload) -> System:
    """One vehicle with GNSS, INS and LiDAR, perfectly synchronised (example 1)."""
    position, attitude, ranging = (_sensor(catalog, name) for name in payload)
    figures = platform_of(catalog, platform)
    stage = Stage(platform, platform, figures, position, attitude, ranging)
    return System((stage,), horizon=LEVEL)


def survey_system(
    catalog: Catalog, vessel: str, payload: Payload, sonar: str = SURVEY_SONAR, auv: str = "auv"
) -> System:
    """Surface vessel, then AUV with the vessel's kind of INS and a multibeam sonar (example 2)."""
    (first,) = georeferencing_system(catalog, vessel, payload).stages
    second = Stage(
        auv, auv, platform_of(catalog, auv), None, first.attitude, _sensor(catalog, sonar)
    )
    return System((first, second), horizon=LEVEL)


def plots(catalog: Catalog) -> tuple[PaperPlot, ...]:
    """All seven plots of the paper."""
    return (*_georeferencing_figures(catalog), *_survey_figures(catalog))


def _georeferencing_figures(catalog: Catalog) -> tuple[PaperPlot, ...]:
    car = platform_of(catalog, "car")
    rate = syncline.sync_rate_mps(car.v_max_mps, car.omega_max_radps, car.distance_m)
    first = Curve(catalog.platforms["car"].name, FIGURE_1_SENSOR_ERROR_M, rate, None)
    platforms = ("usv", "car", "uav_multi_rotor", "uav_fixed_wing")
    by_platform = {
        name: georeferencing_system(catalog, name, FIGURE_2_PAYLOAD) for name in platforms
    }
    named = {name: catalog.platforms[name].name for name in platforms}
    fixed_wing = _curve(named["uav_fixed_wing"], by_platform["uav_fixed_wing"])
    return (
        PaperPlot(1, "A Syncline: a car with sensors good for 0.1 m", (first,)),
        PaperPlot(
            2,
            f"Direct georeferencing with {_payload_label(catalog, FIGURE_2_PAYLOAD)}",
            tuple(_curve(named[name], system) for name, system in by_platform.items()),
        ),
        PaperPlot(
            3,
            "UAV fixed wing, Syncline and simulation",
            (fixed_wing,),
            simulated=True,
            note="The paper does not name the payload; figure 2's is taken.",
        ),
        PaperPlot(
            4,
            "UAV fixed wing with different payloads",
            tuple(
                _curve(
                    _payload_label(catalog, payload),
                    georeferencing_system(catalog, "uav_fixed_wing", payload),
                )
                for payload in FIGURE_4_PAYLOADS
            ),
            note=FREE_CHOICE,
        ),
    )


def _survey_figures(catalog: Catalog) -> tuple[PaperPlot, ...]:
    vessels = {name: catalog.platforms[name].name for name in ("large_sv", "small_sv")}
    return (
        PaperPlot(
            5,
            f"Underwater survey with {_payload_label(catalog, SURVEY_PAYLOAD)}",
            tuple(
                _curve(label, survey_system(catalog, name, SURVEY_PAYLOAD))
                for name, label in vessels.items()
            ),
        ),
        PaperPlot(
            6,
            f"{vessels['large_sv']} and AUV with different payloads",
            tuple(
                _curve(
                    _payload_label(catalog, payload), survey_system(catalog, "large_sv", payload)
                )
                for payload in FIGURE_6_PAYLOADS
            ),
            note=FREE_CHOICE,
        ),
        PaperPlot(
            7,
            f"{vessels['small_sv']} and AUV, Syncline and simulation",
            (_curve(vessels["small_sv"], survey_system(catalog, "small_sv", FIGURE_7_PAYLOAD)),),
            simulated=True,
        ),
    )


def _sensor(catalog: Catalog, name: str) -> Sensor:
    entry = catalog.sensors[name]
    role: RoleName = entry.modality
    return Sensor(name, role, sigma_axes(entry), NO_ERROR, type=entry.type)


def _curve(label: str, system: System) -> Curve:
    figures_of = budget(system)
    return Curve(label, figures_of.sensor_error_m, figures_of.sync_rate_mps, system)


def _payload_label(catalog: Catalog, payload: Payload) -> str:
    return ", ".join(catalog.sensors[name].name or name for name in payload)


def _three(values: Sequence[float | None]) -> tuple[float, float, float]:
    """Three figures as plain floats; the catalog's own checks exclude a missing one."""
    x, y, z = (math.nan if value is None else float(value) for value in values)
    return x, y, z
