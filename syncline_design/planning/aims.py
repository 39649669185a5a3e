"""Where surveyed targets have to be along a drive, and which one is aimed at when.

Where the targets are known, the drive is laid beside them: to the place from which most of them
are in sight most of the time.

Targets are placed by greedy cover: at every second of the drive one has to be in sight in each
quarter of the horizon, at a spread of distances.  They are aimed at in turn.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.vehicle import FAR, STEEP_RAD, Vehicle

NEAR = 0.15  # of the range d: targets are looked for from there on, up to FAR
SPACING = 0.3  # of d: of the places that are tried
LEVELS = (-0.04, 0.0, 0.04)  # of d: targets are not all at one height
QUARTERS = 4
MOST_PLACES = 4000
MOST_SAMPLES = 400
FEW_SAMPLES = 40
SHIFTS = 11  # each way, that are tried where targets are fixed
Seen = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Aims:
    """Targets (m, 3) [m] NED and, by moment, which one is aimed at (n,); -1: none in sight."""

    targets_m: Array
    aimed: NDArray[np.int64]

    @property
    def aimed_m(self) -> Array:
        """The place aimed at by moment, (n, 3); NaN where none is in sight."""
        found = np.full((self.aimed.shape[0], 3), np.nan)
        known = self.aimed >= 0
        found[known] = self.targets_m[self.aimed[known]]
        return found


def aims(vehicle: Vehicle, time_s: Array, place_m: Array, dwell_s: float,
         surveyed: Array | None = None) -> Aims:  # fmt: skip
    """Targets for a path of the last stage (n, 3), and the order in which they are aimed at."""
    seconds = math.ceil(float(time_s[-1] - time_s[0])) + 1
    count = min(len(time_s), seconds, MOST_SAMPLES)
    sampled = np.linspace(0, len(time_s) - 1, count).astype(int)
    if surveyed is None:
        surveyed = _placed(vehicle, place_m[sampled])
    return Aims(surveyed, _turns(vehicle, time_s, place_m, surveyed, dwell_s))


def _placed(vehicle: Vehicle, path_m: Array) -> Array:
    """A small set of places that covers every quarter of the horizon from everywhere."""
    places = _grid(vehicle, path_m)
    needs = np.moveaxis(_quarters(vehicle, path_m, places), 1, 0).reshape(len(places), -1)
    wanted = np.any(needs, axis=0)  # what any place can give
    gain = np.sum(needs, axis=1)
    chosen: list[int] = []
    while np.any(wanted):
        best = int(np.argmax(gain))
        chosen.append(best)
        fresh = np.flatnonzero(wanted & needs[best])
        gain = gain - np.sum(needs[:, fresh], axis=1)
        wanted[fresh] = False
    return places[chosen]


def beside(vehicle: Vehicle, path_m: Array, targets_m: Array) -> Array:
    """By how much to shift a path (n, 3) so that targets are in sight: north, east, down [m].

    Counted are the moments from which each quarter of the horizon shows one.  The vehicle keeps its
    height over the targets' mean level.
    """
    few = path_m[np.linspace(0, len(path_m) - 1, min(len(path_m), FEW_SAMPLES)).astype(int)]
    middle = 0.5 * (path_m.min(axis=0) + path_m.max(axis=0))
    shift = np.mean(targets_m, axis=0) - middle
    shift[2] = np.mean(targets_m[:, 2]) - vehicle.depth_m - np.mean(path_m[:, 2])
    away = 0.5 * np.ptp(targets_m[:, :2], axis=0) + 0.5 * np.ptp(path_m[:, :2], axis=0)
    away = away + FAR * vehicle.distance_m
    steps = [np.linspace(-a, a, SHIFTS) for a in away]
    tried = [np.array([north, east, 0.0]) for north in steps[0] for east in steps[1]]
    tried.sort(key=lambda one: float(np.hypot(one[0], one[1])))  # of equal ones the nearest
    seen = [
        int(np.sum(np.any(_quarters(vehicle, few + shift + one, targets_m), axis=1)))
        for one in tried
    ]
    found: Array = shift + tried[int(np.argmax(seen))]
    return found


def _grid(vehicle: Vehicle, path_m: Array) -> Array:
    """Places that are tried: a staggered grid around the path, at three levels."""
    d = vehicle.distance_m
    low, high = path_m[:, :2].min(axis=0) - FAR * d, path_m[:, :2].max(axis=0) + FAR * d
    spacing = max(SPACING * d, math.sqrt(float(np.prod(high - low)) / MOST_PLACES))
    north, east = (np.arange(a, b, spacing) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1)
    grid[:, 1::2, 0] += 0.5 * spacing
    flat = grid.reshape(-1, 2)
    level = float(np.mean(path_m[:, 2])) + vehicle.depth_m
    heights = level + d * np.resize(LEVELS, flat.shape[0])
    return np.column_stack([flat, heights])


def _in_sight(vehicle: Vehicle, offset_m: Array) -> Seen:
    """Whether offsets (..., 3) from the vehicle are in reach and not too steep."""
    level = np.hypot(offset_m[..., 0], offset_m[..., 1])
    distance = np.hypot(level, offset_m[..., 2])
    d = vehicle.distance_m
    steep = np.abs(offset_m[..., 2]) > math.tan(STEEP_RAD) * level
    return np.asarray((distance <= FAR * d) & (level >= NEAR * d) & ~steep)


def _quarters(vehicle: Vehicle, path_m: Array, places_m: Array) -> Seen:
    """Which place covers which quarter of the horizon from which moment."""
    offset = places_m[None, :, :] - path_m[:, None, :]
    seen = _in_sight(vehicle, offset)
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    quarter = np.floor((angle + math.pi) / (2.0 * math.pi) * QUARTERS).astype(int) % QUARTERS
    return np.asarray(seen[..., None] & (quarter[..., None] == np.arange(QUARTERS)))


def _turns(
    vehicle: Vehicle, time_s: Array, place_m: Array, targets_m: Array, dwell_s: float
) -> NDArray[np.int64]:
    """Which target is aimed at: of those in sight the one aimed at longest ago."""
    aimed = np.full(len(time_s), -1, dtype=np.int64)
    if not len(targets_m):
        return aimed
    last = np.full(len(targets_m), -np.inf)
    held, until = -1, -np.inf
    seen = _in_sight(vehicle, targets_m[None, :, :] - place_m[:, None, :])
    for k, now in enumerate(time_s):
        if held < 0 or now >= until or not seen[k, held]:
            known = np.flatnonzero(seen[k])
            held = int(known[np.argmin(last[known])]) if known.size else -1
            until = now + dwell_s - 1e-9
        if held >= 0:
            last[held] = now
            aimed[k] = held
    return aimed
