"""Where along a trajectory's file the simulated errors are large: quantiles, stretch by stretch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.random_numbers import generator
from syncline_design.model.ends import at_ends, distances_of
from syncline_design.model.system import System
from syncline_design.simulation.draws import RandomSource, time_margin_s
from syncline_design.simulation.excursions import follows_a_file
from syncline_design.simulation.kernel import norm
from syncline_design.simulation.results import Along, FlownStretch, FlownWay, MonteCarlo
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.simulation.track import Track
from syncline_design.simulation.trajectory import stage_track, trajectory_errors

ALONG_STREAM = 5  # first word of the stream key, see draws.generator
STRETCHES = 48  # of equal time
SAMPLES = 2000  # a stretch: its 95 % quantile is good to about 2 % (one sigma of Rayleigh errors)
WAY_POINTS = 600  # of a drawn way
MOMENTS = 32  # of a stretch, over which its motion is averaged


def along(found: MonteCarlo, system: System, settings: SimulationSettings) -> Along | None:
    """Errors by stretch of a trajectory file, where the Monte Carlo `found` follows one.

    Of stages with several distances, at those that it was simulated at.
    """
    if not follows_a_file(settings):
        return None
    there = next(
        one for one in at_ends(system)
        if found.distances_m is None or distances_of(system, one) == found.distances_m
    )  # fmt: skip
    tracks = [stage_track(there, settings, index) for index in range(len(there.stages))]
    margin, last = time_margin_s(there), tracks[-1]
    ends = np.linspace(last.time_s[0] + margin, last.time_s[-1] - margin, STRETCHES + 1)
    stretches = []
    for place, (from_s, to_s) in enumerate(pairwise(ends)):
        in_force().check()
        sizes = _errors_m(there, settings, (place / STRETCHES, (place + 1) / STRETCHES))
        stretches.append(_stretch(there, last, (float(from_s), float(to_s)), sizes))
    ways = tuple(_way(stage.name, track) for stage, track in zip(there.stages, tracks, strict=True))
    return Along(SAMPLES, ways, tuple(stretches))


def _errors_m(
    system: System, settings: SimulationSettings, part: tuple[float, float]
) -> Array:  # fmt: skip
    """|error| [m] at random moments of one stretch.

    Every stretch meets the same random numbers: they differ by the motion alone.
    """
    source, apart = (
        RandomSource(generator(settings.seed, ALONG_STREAM, k), SAMPLES) for k in range(2)
    )
    return norm(trajectory_errors(system, settings, source, apart, part))


def _stretch(
    system: System, track: Track, ends_s: tuple[float, float], sizes_m: Array
) -> FlownStretch:
    stage = system.stages[-1]
    moments = np.linspace(*ends_s, MOMENTS)
    middle = track.position(np.array([0.5 * sum(ends_s)]))[0]
    distance = 0.0 if stage.ranging is None else float(stage.platform.distance_m)
    if track.sight is not None and stage.ranging is not None:
        distance = float(np.mean(np.interp(moments, track.time_s, track.sight[0])))
    return FlownStretch(
        from_s=ends_s[0],
        to_s=ends_s[1],
        north_m=float(middle[0]),
        east_m=float(middle[1]),
        quantile95_m=float(np.quantile(sizes_m, 0.95)),
        rms_m=float(np.sqrt(np.mean(sizes_m**2))),
        speed_mps=float(np.mean(np.linalg.norm(track.position(moments, 1), axis=1))),
        turn_rate_radps=float(np.mean(np.linalg.norm(track.rate(moments), axis=1))),
        distance_m=distance,
    )


def _way(stage: str, track: Track) -> FlownWay:
    rows = np.unique(np.linspace(0, track.time_s.shape[0] - 1, WAY_POINTS).round().astype(int))
    north, east = track.position_m[rows, :2].T
    return FlownWay(stage, tuple(map(float, north)), tuple(map(float, east)))
