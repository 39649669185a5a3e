"""The Syncline's formulas for plain numbers: sensor error, sync rate, tau_crit, the curve.

Source of all equations: E. R. Jellum et al., "The Syncline Model", arXiv:2209.01136v2; the names
in brackets are its equation labels.  Units SI: m, s, rad.  Shapes: scalars, except where `tau_s`
may be a NumPy array of any shape, which the result then has too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

from syncline_design.model.roles import RoleName

if TYPE_CHECKING:
    from numpy import float64
    from numpy.typing import NDArray

    Tau = TypeVar("Tau", float, NDArray[float64])
else:
    Tau = TypeVar("Tau")

Sigma = tuple[float, float, float]

SIGMA_P = "sigma_p"
SIGMA_THETA_D = "sigma_Theta*d"
SIGMA_R = "sigma_r"
SIGMA_U_D = "sigma_u*d"


def sensor_error_terms(
    role: RoleName, sigma: Sigma, distance_m: float
) -> tuple[tuple[str, float], ...]:
    """One sensor's terms of the sensor-induced error [m], by name.

    position: sigma_p = |(s_north, s_east, s_down)|, s in m; attitude: sigma_Theta d with
    sigma_Theta = |(s_roll, s_pitch, s_yaw)|, s in rad; ranging: sigma_r, and sigma_u d with
    sigma_u = |(s_azimuth, s_elevation)|, s in rad.  [eq:sensor_error_ub]; that sigma means the
    Euclidean norm over the axes is the reading that gives the printed tau_crit tables.
    """
    if role == "position":
        return ((SIGMA_P, math.hypot(*sigma)),)
    if role == "attitude":
        return ((SIGMA_THETA_D, math.hypot(*sigma) * distance_m),)
    return (
        (SIGMA_R, float(sigma[0])),
        (SIGMA_U_D, math.hypot(sigma[1], sigma[2]) * distance_m),
    )


def sensor_error_m(role: RoleName, sigma: Sigma, distance_m: float) -> float:
    """One sensor's part of the roof's error [m]: the sum of its terms [eq:sensor_error_ub]."""
    return math.fsum(value for _, value in sensor_error_terms(role, sigma, distance_m))


def sync_rate_mps(v_max_mps: float, omega_max_radps: float, distance_m: float) -> float:
    """v_max + d omega_max [m/s], the sync-induced error per second of tau [eq:sync_error_ub]."""
    return v_max_mps + distance_m * omega_max_radps


def position_rate_mps(v_max_mps: float, omega_max_radps: float, lever_arm_m: float) -> float:
    """v_max + b omega_max [m/s]: how fast an antenna on a lever arm b can move.

    The bound of |v + omega x l| in the position measurement [eq:meas_gnss]; the paper's Syncline
    leaves the second term out.
    """
    return v_max_mps + lever_arm_m * omega_max_radps


def tau_crit_s(error_m: float, rate_mps: float) -> float:
    """error / rate [s], where the sync-induced error equals the sensor's [eq:t_crit].

    inf when nothing moves (rate 0): then no timestamp error costs anything.
    """
    return error_m / rate_mps if rate_mps != 0.0 else math.inf


def sensor_rate_mps(
    role: RoleName, v_max_mps: float, omega_max_radps: float, distance_m: float
) -> float:
    """The rate [m/s] a sensor's own tau_crit is taken against.

    position: v_max; attitude and ranging: v_max + d omega_max.  This is the reading that gives
    the printed tables (tab:georef_tau, tab:survey_tau).
    """
    if role == "position":
        return float(v_max_mps)
    return sync_rate_mps(v_max_mps, omega_max_radps, distance_m)


def sync_error_m(tau_s: Tau, rate_mps: float) -> Tau:
    """Sync-induced error rate * tau [m] [eq:sync_error_ub]; tau_s a scalar or an array."""
    return tau_s * rate_mps


def syncline_m(tau_s: Tau, sensor_error: float, rate_mps: float) -> Tau:
    """Syncline(tau) = rate * tau + sensor error [m] [eq:syncline]; tau_s a scalar or an array."""
    return tau_s * rate_mps + sensor_error


def accuracy_per_m(error_m: Tau) -> Tau:
    """1 / error [1/m], the vertical axis of a Syncline plot; of the sensor error, its roof."""
    return 1.0 / error_m
