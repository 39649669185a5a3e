"""The statistical figures against long Monte Carlo, and how often its intervals hold.

`propagation`: random chains of two stages (tests/test_statistical_figures.py), every second with
arms of tens of metres and tilts of up to 60 deg, at a random situation each: six figures of the
budget against as many draws as are asked for of an own chain (SciPy's rotations).  Sampling alone
scatters a root mean square by 0.5 / sqrt(n) and more and a 95 % quantile by about 1 / sqrt(n), so
that deviations are shown in standard errors of the sample too.

`coverage`: repetitions of a Monte Carlo with a seed each; the share of 95 % intervals that hold the
true quantile and the true share within a limit, of a closed form (chi) and of a lidar whose truth
comes from many more samples.

`published`: a maker's table of lateral offsets by heading error, cell by cell; another maker's
budget of a USBL, line by line and in all.

    python benchmarks/figures.py propagation [SYSTEMS] [DRAWS] [SEED]
    python benchmarks/figures.py coverage [REPETITIONS] [SAMPLES] [SEED]
    python benchmarks/figures.py published
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from syncline_design.model.horizon import Horizon
from syncline_design.model.system import Sensor, System
from syncline_design.model.timing import TimingError, Uniform
from syncline_design.simulation.distribution import ErrorValues
from syncline_design.simulation.intervals import proportion_interval
from syncline_design.simulation.run import error_distribution, quantile_estimates
from syncline_design.simulation.sampling import sample_errors
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import Wanted, exact, statistical_figures
from test_statistical_figures import ALL, boat, chain, lidar, plain_errors

QUANTILES = (0.5, 0.95, 0.997)


# https://gocut.tiwri.com/lateralpositionaloffseterrors.htm, read 2026-11-22: lateral offset [m] by
# horizontal range [m] for heading errors [deg]; as printed, with its misprint at 750 m and 1 deg
HEADINGS = (0.5, 1.0, 2.0, 3.0, 5.0)
LATERAL = {
    150: (1.3, 2.6, 5.2, 7.9, 13.1), 300: (2.6, 5.2, 10.5, 15.7, 26.1),
    500: (4.4, 8.7, 17.4, 26.2, 43.6), 750: (6.5, 3.1, 26.2, 39.3, 65.4),
    1000: (8.7, 17.5, 34.9, 52.3, 87.2), 1500: (13.1, 26.2, 52.3, 78.5, 130.7),
    2000: (17.5, 34.9, 69.8, 104.7, 174.3),
}  # fmt: skip


# https://docs.ceruleansonar.com/c/ethernet-rov-locator/accuracy-expectations, read 2026-11-23: what
# a USBL below a vessel errs level: receiver 5 m, compass 5 deg, array 2 deg, range next to nothing,
# in all root(5^2 + (sin 5.2 deg * slant range)^2), printed of the root of 5^2 + 2^2, which is 5.39
RECEIVER_M, COMPASS_DEG, ARRAY_DEG, PRINTED_DEG = 5.0, 5.0, 2.0, 5.2


def published_budget() -> None:
    """Each line alone, then all of them: the level RMS of an object at a slant range."""
    side = RECEIVER_M / math.sqrt(2.0)
    lines = {
        "receiver": ((side, side, 0.0), 0.0, 0.0, lambda d: RECEIVER_M),
        "compass": ((0.0,) * 3, COMPASS_DEG, 0.0, lambda d: d * math.sin(math.radians(5.0))),
        "array": ((0.0,) * 3, 0.0, ARRAY_DEG, lambda d: d * math.sin(math.radians(2.0))),
        "all": (
            (side, side, 0.0), COMPASS_DEG, ARRAY_DEG,
            lambda d: math.hypot(RECEIVER_M, d * math.sin(math.radians(PRINTED_DEG))),
        ),
    }  # fmt: skip
    for name, (position, yaw, azimuth, printed) in lines.items():
        told = []
        for distance in (20.0, 100.0, 300.0):
            one = lidar(position=position, attitude=(0.0, 0.0, math.radians(yaw)),
                        ranging=(0.0, math.radians(azimuth), 0.0))  # fmt: skip
            stage = one.stages[0]
            platform = replace(stage.platform, distance_m=distance)
            system = replace(one, stages=(replace(stage, platform=platform),))
            (found,) = statistical_figures(system, (Wanted("horizontal"),), seed=0)
            told.append(f"{distance:g} m: {found.value_m:.3f} m ({printed(distance):.3f} m)")
        print(f"USBL, {name}, figure (printed): {'; '.join(told)}")


def published() -> None:
    """Heading noise alone: the level RMS of an object at a range."""
    agree = 0
    for distance, row in LATERAL.items():
        for heading, printed in zip(HEADINGS, row, strict=True):
            one = lidar(attitude=(0.0, 0.0, math.radians(heading)))
            stage = one.stages[0]
            platform = replace(stage.platform, distance_m=float(distance))
            system = replace(one, stages=(replace(stage, platform=platform),))
            (found,) = statistical_figures(system, (Wanted("horizontal"),), seed=0)
            a = math.radians(heading)
            as_sine = found.value_m * math.sin(a) / a  # noise acts to first order
            same = abs(as_sine - printed) <= 0.1
            agree += same
            if not same:
                print(f"{distance} m, {heading:g} deg: {found.value_m:.2f} m, printed {printed} m")
    print(f"{agree} of {len(LATERAL) * len(HEADINGS)} cells agree to the printed digit")


def long_armed(seed: int) -> System:
    """The chain of a seed with arms of tens of metres, on vehicles that lean by up to 60 deg."""
    rng, system = np.random.default_rng([seed, 7]), chain(seed)

    def arm() -> tuple[float, float, float]:
        x, y, z = rng.normal(0.0, 25.0, 3).tolist()
        return x, y, z

    def armed(sensor: Sensor | None) -> Sensor | None:
        return None if sensor is None else replace(sensor, lever_arm_m=arm())

    stages = tuple(
        replace(
            stage,
            position=armed(stage.position),
            ranging=armed(stage.ranging),
            transponder_lever_arm_m=arm() if stage.transponder_lever_arm_m else None,
        )
        for stage in system.stages
    )
    return replace(system, stages=stages, horizon=Horizon(tilt_rad=math.radians(60.0)))


def sampled(length: np.ndarray, p: float | None) -> tuple[float, float]:
    """(figure of a sample, its standard error)."""
    n = len(length)
    if p is None:
        square = length**2
        mean = float(np.mean(square))
        return math.sqrt(mean), float(np.std(square)) / math.sqrt(n) / (2.0 * math.sqrt(mean))
    spread = math.sqrt(p * (1.0 - p) / n)
    low, middle, high = np.quantile(length, [p - spread, p, p + spread])
    return float(middle), 0.5 * float(high - low)


def propagation(count: int, draws: int, seed: int) -> None:
    """Six figures of `count` systems."""
    found: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    for number in range(seed, seed + count):
        long = number % 2 == 1
        system = long_armed(number) if long else chain(number)
        situations = Situations(system)
        point = situations.starting_points(number, 1)
        moments = situations.moments(point, situations.nodes(16381))
        error = plain_errors(system, point[:, 0], draws, number)
        for wanted in ALL:
            rows = {"horizontal": error[:2], "vertical": error[2:], "3d": error}[wanted.axis]
            value, scatter = sampled(np.linalg.norm(rows, axis=0), wanted.p)
            budget = exact(moments, wanted, situations.dimensions)
            found[long].append((budget / value - 1.0, scatter / value))
    for long, pairs in found.items():
        if not pairs:
            continue
        off, scatter = np.array(pairs).T
        bound = 0.01 if long else 0.005
        print(
            f"{'arms of tens of metres, 60 deg' if long else 'arms of metres, 17 deg'}: "
            f"{len(pairs) // len(ALL)} systems, {len(pairs)} figures, {draws} draws each from seed "
            f"{seed}: |deviation| median {100 * np.median(np.abs(off)):.3f} %, 95 % "
            f"{100 * np.quantile(np.abs(off), 0.95):.3f} %, largest {100 * np.max(np.abs(off)):.3f}"
            f" %; within {100 * bound:g} %: {100 * np.mean(np.abs(off) <= bound):.2f} %; in "
            f"standard errors of the sample: mean {np.mean(off / scatter):+.2f}, "
            f"std {np.std(off / scatter):.2f}, largest {np.max(np.abs(off / scatter)):.1f}; "
            f"beyond {100 * bound:g} % and 4 of them: "
            f"{int(np.sum((np.abs(off) > bound) & (np.abs(off) > 4 * scatter)))}"
        )


def covered(system: System, truth: dict[float, float], count: int, samples: int, seed: int) -> str:
    """How often intervals of a system's quantiles and of its share within a limit hold."""
    held = dict.fromkeys(QUANTILES, 0)
    within, limit = 0, truth[0.95]
    for number in range(seed, seed + count):
        found = error_distribution(system, SimulationSettings(samples=samples, seed=number))
        for p, one in zip(QUANTILES, quantile_estimates(found, QUANTILES, 0.95), strict=True):
            high = math.inf if one.high_m is None else one.high_m
            held[p] += (one.low_m or 0.0) <= truth[p] <= high
        low, high = proportion_interval(found.within(limit), found.count, 0.95)
        within += low <= 0.95 <= high
    shares = ", ".join(f"{p:g}: {100 * held[p] / count:.1f} %" for p in QUANTILES)
    return f"quantiles {shares}; share within a limit {100 * within / count:.1f} %"


def coverage(count: int, samples: int, seed: int) -> None:
    """A closed form, and a lidar with stamps that matter."""
    sigma = 0.02
    truth = {p: sigma * math.sqrt(chi2.ppf(p, 3)) for p in QUANTILES}
    told = f"{count} repetitions of {samples} samples from seed {seed}"
    found = covered(boat((sigma,) * 3), truth, count, samples, seed)
    print(f"three normal axes, {told}: {found}", flush=True)
    stamp = TimingError(Uniform(-0.01, 0.0))
    system = lidar(position=(0.02, 0.02, 0.04), attitude=(0.001, 0.001, 0.003),
                   ranging=(0.03, 0.001, 0.001), t_position=stamp, t_attitude=stamp)  # fmt: skip
    many = sample_errors(system, SimulationSettings(samples=4_000_000, seed=10**6))
    whole = ErrorValues(np.linalg.norm(many, axis=1))
    ranks = [math.ceil(p * whole.count) for p in QUANTILES]
    truth = dict(zip(QUANTILES, whole.order_statistics(ranks), strict=True))
    found = covered(system, truth, count, samples, seed)
    print(f"lidar with stamps up to 10 ms late, {told}, truth of 4 000 000: {found}", flush=True)


if __name__ == "__main__":
    numbers = [int(one) for one in sys.argv[2:]]
    if sys.argv[1:2] == ["published"]:
        published()
        published_budget()
    elif sys.argv[1:2] == ["coverage"]:
        coverage(*(*numbers, *(500, 20000, 0)[len(numbers) :]))
    else:
        propagation(*(*numbers, *(1000, 200000, 0)[len(numbers) :]))
