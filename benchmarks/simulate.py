"""Speed of the simulator, as ratios measured side by side in one run.

    python benchmarks/simulate.py [--long]

1. Plain Monte Carlo against NumPy alone drawing the same number of random variates, in the same
   chunks, on the same cores (target: within 2 times).
2. Time to a standard error of 0.5 % on the 0.95 quantile, against Monte Carlo in NumPy written
   straight from the equations.  Standard errors are measured as the spread over seeds.
3. With --long: 1e8 samples, their time and the largest memory of any process (target: 500 MB).

Times are the best of several repetitions, wall clock; on a machine that does other work ratios of
processor time (also printed) are the steadier figures.
"""

from __future__ import annotations

import argparse
import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import TimingError, Uniform
from syncline_design.simulation import SimulationSettings, cross_check
from syncline_design.simulation.run import error_distribution
from syncline_design.simulation.sampling import JOB, keep_freed_memory
from syncline_design.simulation.worker import Share, count_share, tally

DEG = math.pi / 180.0
TAU_S = 2e-4
TARGET_ERROR = 0.005
QUANTILE = 0.95


def system() -> System:
    """The paper's fixed wing: F9P RTK, MRU5, VUX-1UAV, every timestamp within 0.2 ms."""
    timing = TimingError(Uniform(-TAU_S, TAU_S))
    roles = (
        Sensor("f9p_rtk", "position", (0.01,) * 3, timing, "host:uav", (0.3, 0.0, -0.2)),
        Sensor("mru5", "attitude", (0.002 * DEG,) * 3, timing, "host:uav"),
        Sensor("vux1uav", "ranging", (0.01, 0.006 * DEG, 0.006 * DEG), timing, "host:uav"),
    )
    return System((Stage("uav", "uav", Platform(21.0, 77.9 * DEG, 100.0, 1.0), *roles),))


def best(run: Callable[[], object], repetitions: int = 5) -> tuple[float, float]:
    """(wall, processor) seconds of the fastest repetition, each for itself."""
    walls, cpus = [], []
    for _ in range(repetitions):
        wall, cpu = time.perf_counter(), time.process_time()
        run()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return min(walls), min(cpus)


def draw_only(samples: int) -> None:
    """NumPy drawing what `system` needs, in chunks: 9 normals and 10 uniforms a sample."""
    stream = np.random.Generator(np.random.Philox(1))
    normals, uniforms = np.empty((9, JOB)), np.empty((10, JOB))
    for _ in range(samples // JOB):
        stream.standard_normal(out=normals)
        stream.random(out=uniforms)


def straight_from_the_equations(samples: int, seed: int) -> np.ndarray:
    """|error| of every sample: the same chain as arrays over all samples, nothing clever."""
    rng = np.random.default_rng(seed)
    stage = system().stages[0]
    v_max, omega_max = stage.platform.v_max_mps, stage.platform.omega_max_radps
    d = stage.platform.distance_m

    def isotropic() -> np.ndarray:
        vector = rng.normal(size=(samples, 3))
        return vector / np.linalg.norm(vector, axis=1, keepdims=True)

    def matrix(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
        cy, sy = np.cos(yaw), np.sin(yaw)
        rows = [
            [cp * cy, -cr * sy + sr * sp * cy, sr * sy + cr * sp * cy],
            [cp * sy, cr * cy + sr * sp * sy, -sr * cy + cr * sp * sy],
            [-sp, sr * cp, cr * cp],
        ]
        return np.moveaxis(np.array(rows), -1, 0)

    def rodrigues(vector: np.ndarray) -> np.ndarray:
        angle = np.linalg.norm(vector, axis=1)[:, None, None]
        k = np.zeros((samples, 3, 3))
        k[:, 0, 1], k[:, 0, 2], k[:, 1, 2] = -vector[:, 2], vector[:, 1], -vector[:, 0]
        k -= np.swapaxes(k, 1, 2)
        return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k

    velocity, rate, sight = v_max * isotropic(), omega_max * isotropic(), isotropic()
    mu = rng.uniform(-TAU_S, TAU_S, (3, samples))
    shift_p, shift_a = mu[0] - mu[2], mu[1] - mu[2]
    zero = np.zeros(samples)
    true = matrix(zero, zero, rng.uniform(0, 2 * np.pi, samples))
    half = rodrigues(rate * (0.5 * shift_p)[:, None])  # mid-point rule: exact to tau cubed here
    moved = np.einsum("nij,njk,nk->ni", true, half, velocity * shift_p[:, None])
    arm = np.array(stage.position.lever_arm_m)
    antenna = moved + np.einsum("nij,njk,k->ni", true, rodrigues(rate * shift_p[:, None]), arm)
    antenna += rng.normal(size=(samples, 3)) * stage.position.sigma
    turned = true @ rodrigues(rate * shift_a[:, None])
    noise = rng.normal(size=(3, samples)) * np.array(stage.attitude.sigma)[:, None]
    measured = matrix(
        np.arctan2(turned[:, 2, 1], turned[:, 2, 2]) + noise[0],
        -np.arcsin(turned[:, 2, 0]) + noise[1],
        np.arctan2(turned[:, 1, 0], turned[:, 0, 0]) + noise[2],
    )
    sigma_r, sigma_az, sigma_el = stage.ranging.sigma
    azimuth = np.arctan2(sight[:, 1], sight[:, 0]) + rng.normal(size=samples) * sigma_az
    elevation = -np.arcsin(sight[:, 2]) + rng.normal(size=samples) * sigma_el
    distance = d + rng.normal(size=samples) * sigma_r
    seen = distance[:, None] * np.stack(
        [
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            -np.sin(elevation),
        ],
        axis=-1,
    )
    estimate = antenna + np.einsum("nij,nj->ni", measured, seen - arm)
    error = estimate - np.einsum("nij,nj->ni", true, d * sight)
    return np.linalg.norm(error, axis=1)


def spread(estimate: Callable[[int], float], seeds: int) -> float:
    """Relative standard error of an estimate: its spread over seeds."""
    found = np.array([estimate(seed) for seed in range(seeds)])
    return float(found.std(ddof=1) / found.mean())


def throughput() -> None:
    samples = 100 * JOB
    settings = SimulationSettings(samples)
    share = Share(system(), settings, 0, samples, math.inf, 0, 1)
    keep_freed_memory()
    simulated = best(lambda: count_share(share))
    drawn = best(lambda: draw_only(samples))
    print(f"1. plain Monte Carlo, one core: {simulated[0] / samples * 1e9:.0f} ns a sample;")
    print(f"   NumPy drawing as many variates: {drawn[0] / samples * 1e9:.0f} ns")
    print(f"   ratio {simulated[0] / drawn[0]:.2f} (processor time {simulated[1] / drawn[1]:.2f})")


def both_cores() -> None:
    samples = 6_000_000 // JOB * JOB
    one, two = (
        best(
            lambda w=w: tally(system(), SimulationSettings(samples, workers=w), 0, samples, 1.0), 3
        )
        for w in (1, 2)
    )
    print(f"   {samples} samples: 1 worker {one[0]:.2f} s, 2 workers {two[0]:.2f} s, ")
    print(f"   {one[0] / two[0]:.2f} times faster")
    script = "import sys; sys.path.insert(0, 'benchmarks'); import simulate; simulate.draw_only"
    command = [sys.executable, "-c", f"{script}({samples // 2})"]

    def draw_on_both() -> None:
        children = [subprocess.Popen(command) for _ in range(2)]
        for child in children:
            child.wait()

    drawn = best(draw_on_both, 3)[0]
    print(f"   NumPy drawing as many variates on two processes: {drawn:.2f} s")
    print(f"   ratio on both cores {two[0] / drawn:.2f}")


def time_to_precision() -> None:
    """Both draw the same distribution, so the same number of samples is as good."""
    samples = 8192

    def straight(seed: int) -> float:
        return float(np.quantile(straight_from_the_equations(samples, seed), QUANTILE))

    needed = round(samples * (spread(straight, 40) / TARGET_ERROR) ** 2)
    straight_time = best(lambda: np.quantile(straight_from_the_equations(needed, 0), QUANTILE), 7)
    settings = SimulationSettings(needed)

    def ours() -> float:
        errors = error_distribution(system(), settings)
        return errors.order_statistics([round(QUANTILE * needed)])[0]

    own_time = best(ours, 7)
    print(f"2. 0.5 % standard error on the {QUANTILE} quantile: {needed} samples")
    print(f"   straight from the equations {straight_time[0] * 1e3:.1f} ms")
    print(
        f"   the simulator {own_time[0] * 1e3:.1f} ms, {straight_time[0] / own_time[0]:.1f} times "
        f"shorter (processor time {straight_time[1] / own_time[1]:.1f})"
    )


def agreement() -> None:
    found = cross_check(system(), SimulationSettings(1_000_000)).quantile(QUANTILE)
    naive = np.quantile(straight_from_the_equations(400_000, 1), QUANTILE)
    low, high = found.low_m * 1e3, found.high_m * 1e3
    print("   both agree on the 0.95 quantile:")
    print(f"     the simulator {found.value_m * 1e3:.3f} mm [{low:.3f}, {high:.3f}]")
    print(f"     straight from the equations {naive * 1e3:.3f} mm")


def long_run() -> None:
    start = time.perf_counter()
    found = cross_check(system(), SimulationSettings(100_000_000))
    took = time.perf_counter() - start
    own, children = (
        resource.getrusage(who).ru_maxrss / 1024
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    q = found.quantile(QUANTILE)
    print(f"3. 1e8 samples: {took:.1f} s, 0.95 quantile {q.value_m:.6f} m")
    print(f"   largest memory: parent {own:.0f} MB, each child at most {children:.0f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--long", action="store_true", help="also run 1e8 samples")
    long = parser.parse_args().long
    if long:
        long_run()
    throughput()
    both_cores()
    time_to_precision()
    agreement()


if __name__ == "__main__":
    main()
