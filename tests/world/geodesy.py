"""Local north-east-down places to WGS 84, by way of the earth-centred frame."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.world.trajectory import Array

# WGS 84 defining constants (NIMA TR8350.2, third edition, table 3.1)
AXIS_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
SQUARED = FLATTENING * (2.0 - FLATTENING)


def to_ecef(latitude_rad: Array, longitude_rad: Array, height_m: Array) -> Array:
    normal = AXIS_M / np.sqrt(1.0 - SQUARED * np.sin(latitude_rad) ** 2)
    out = (normal + height_m) * np.cos(latitude_rad)
    up = (normal * (1.0 - SQUARED) + height_m) * np.sin(latitude_rad)
    return np.stack([out * np.cos(longitude_rad), out * np.sin(longitude_rad), up], axis=-1)


def from_ecef(place: Array) -> Array:
    """Latitude, longitude [rad] and height [m] (n, 3) by fixed-point iteration to rounding."""
    x, y, z = place.T
    out = np.hypot(x, y)
    latitude = np.arctan2(z, out * (1.0 - SQUARED))
    for _ in range(8):
        normal = AXIS_M / np.sqrt(1.0 - SQUARED * np.sin(latitude) ** 2)
        latitude = np.arctan2(z + SQUARED * normal * np.sin(latitude), out)
    normal = AXIS_M / np.sqrt(1.0 - SQUARED * np.sin(latitude) ** 2)
    height = out * np.cos(latitude) + z * np.sin(latitude) - AXIS_M**2 / normal
    return np.stack([latitude, np.arctan2(y, x), height], axis=-1)


def to_geodetic(place_m: Array, origin: tuple[float, float, float]) -> Array:
    """Latitude, longitude [deg] and height [m] (n, 3) of NED places about a WGS 84 origin."""
    latitude, longitude = np.radians(origin[0]), np.radians(origin[1])
    start = to_ecef(np.array(latitude), np.array(longitude), np.array(origin[2]))
    axes = Rotation.from_euler("ZY", [longitude, -latitude - np.pi / 2.0])
    result = from_ecef(start + axes.apply(place_m))
    result[:, :2] = np.degrees(result[:, :2])
    return result
