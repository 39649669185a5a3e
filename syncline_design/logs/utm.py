"""Eastings and northings of the universal transverse Mercator grid to latitude and longitude.

Krueger's series to the sixth order of the third flattening n (Karney 2011, Transverse Mercator with
an accuracy of a few nanometers, eqs. 11 to 36), on WGS 84:

    xi' + i eta' = zeta - sum_j beta_j sin(2 j zeta),  zeta = (N - N0 + i (E - 500 km)) / (k0 A)
    tan chi = sin xi' / hypot(sinh eta', cos xi'),     tan dlambda = sinh eta' / cos xi'

with chi the conformal latitude, from which latitude follows by Newton's steps.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.effects.record import Array

_A_M, _F = 6_378_137.0, 1.0 / 298.257_223_563
_K0, _EAST_M, _SOUTH_M = 0.9996, 500_000.0, 10_000_000.0
_N: Final = _F / (2.0 - _F)
_E: Final = float(np.sqrt(_F * (2.0 - _F)))
_RADIUS_M: Final = _A_M / (1.0 + _N) * (1.0 + _N**2 / 4 + _N**4 / 64 + _N**6 / 256)
_BETA: Final = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360 - 81 * _N**5 / 512
    + 96_199 * _N**6 / 604_800,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440 + 46 * _N**5 / 105 - 1_118_711 * _N**6 / 3_870_720,
    17 * _N**3 / 480 - 37 * _N**4 / 840 - 209 * _N**5 / 4480 + 5569 * _N**6 / 90_720,
    4397 * _N**4 / 161_280 - 11 * _N**5 / 504 - 830_251 * _N**6 / 7_257_600,
    4583 * _N**5 / 161_280 - 108_847 * _N**6 / 3_991_680,
    20_648_693 * _N**6 / 638_668_800,
)  # fmt: skip
_STEPS: Final = 5  # of Newton, which converges quadratically


def zone_of(longitude_rad: float) -> int:
    """The zone of a longitude; those about Norway and Svalbard that differ are not made out."""
    return int(np.floor((np.degrees(longitude_rad) + 180.0) / 6.0)) % 60 + 1


def utm_to_geodetic(east_m: Array, north_m: Array, zone: int, *, south: bool) -> Array:
    """Latitude and longitude [rad] (n, 2)."""
    zeta = (north_m - (_SOUTH_M if south else 0.0) + 1j * (east_m - _EAST_M)) / (_K0 * _RADIUS_M)
    sphere = zeta - sum(b * np.sin(2 * (j + 1) * zeta) for j, b in enumerate(_BETA))
    xi, eta = sphere.real, sphere.imag
    conformal = np.sin(xi) / np.hypot(np.sinh(eta), np.cos(xi))
    tau = conformal.copy()
    for _ in range(_STEPS):
        root = np.sqrt(1.0 + tau**2)
        sigma = np.sinh(_E * np.arctanh(_E * tau / root))
        reached = tau * np.sqrt(1.0 + sigma**2) - sigma * root
        slope = (1.0 + (1.0 - _E**2) * tau**2) / ((1.0 - _E**2) * np.sqrt(1.0 + reached**2) * root)
        tau = tau + (conformal - reached) * slope
    longitude = np.arctan2(np.sinh(eta), np.cos(xi)) + np.radians(6.0 * zone - 183.0)
    return np.stack([np.arctan(tau), longitude], axis=1)
