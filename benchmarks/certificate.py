"""The certified worst case attacked: random systems, random situations and ascents of an own chain.

Systems of one to three stages: tilt up to 80 deg, arms up to three times as long as the distance,
shifts from 1 ms to 10 s, none to all of the known effects (those that have a largest value) at up
to one and a half times the size of `tests/test_error_bounds.py`.  The chain is that of
`tests/plain_chain.py` (SciPy's rotations, the path in closed form), climbed by L-BFGS from the best
of random situations.  Printed are how many systems were attacked, how many beat the bound, and how
near the best of each came.

    python benchmarks/certificate.py [SYSTEMS] [SEED]
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from syncline_design.simulation.bounds import references
from test_error_bounds import SINGLE, Effects, system_of
from tests.plain_chain import PlainHorizon, PlainStage, chain_error, size

AT_RANDOM, ASCENTS = 600, 2
Array = np.ndarray


def arm(rng: np.random.Generator, d: float) -> tuple[float, float, float]:
    """Up to three times the distance long, in any direction."""
    x, y, z = rng.normal(size=3)
    length = d * 3.0 * rng.random() ** 2 / math.hypot(x, y, z)
    return x * length, y * length, z * length


def effects_drawn(rng: np.random.Generator, share: float) -> Effects:
    """A share of all effects, each at 0.1 to 1.5 times its size; slips and factors as they are."""
    found: Effects = {}
    for (name, role), values in SINGLE.items():
        if rng.random() >= share or name == "filter_lag":  # its quadrature takes seconds
            continue
        fixed = name in ("integer_second_slip", "noise_episode", "noise_understated")
        scale = 1.0 if fixed else float(np.exp(rng.uniform(math.log(0.1), math.log(1.5))))
        found[name, role] = {
            key: value if key in ("time_s", "time_constant_s") else value * scale
            for key, value in values.items()
        }
    return found


def stage_drawn(rng: np.random.Generator, first: bool, share: float) -> PlainStage:
    """A stage with noise of any size, mostly small."""
    d = float(np.exp(rng.uniform(0.0, math.log(200.0))))
    small = np.exp(rng.uniform(math.log(1e-4), math.log(0.2), 4))
    free = rng.random() < 0.3
    return PlainStage(
        v=float(rng.uniform(0.0, 20.0)),
        w=float(np.exp(rng.uniform(math.log(1e-3), math.log(2.0)))),
        d=d, arm=None if free else arm(rng, d), ranging_arm=arm(rng, d),
        b=float(3.0 * d * rng.random()) if free else 0.0,
        position=float(small[0]) if first else 0.0, attitude=float(small[1]),
        range=float(d * small[2]), bearing=float(small[3]), effects=effects_drawn(rng, share),
    )  # fmt: skip


def best_found(stages: list[PlainStage], horizon: PlainHorizon, tau: float, seed: int) -> float:
    """The largest error of random situations and of ascents from the best of them."""
    rng = np.random.default_rng([seed, 1])
    x = rng.standard_normal((AT_RANDOM, size(stages)))
    x[AT_RANDOM // 2 :] *= 0.3
    found = chain_error(stages, horizon, tau, x)
    best, width = float(found.max()), x.shape[1]

    def objective(point: Array) -> tuple[float, Array]:
        steps = np.concatenate([np.zeros((1, width)), 1e-6 * np.eye(width), -1e-6 * np.eye(width)])
        value = -chain_error(stages, horizon, tau, point + steps)
        return float(value[0]), (value[1 : width + 1] - value[width + 1 :]) / 2e-6

    for start in np.argsort(-found)[:ASCENTS]:
        end = minimize(objective, x[start], jac=True, method="L-BFGS-B", options={"maxiter": 40})
        best = max(best, -float(end.fun))
    return best


def main(count: int, seed: int) -> None:
    """One line of figures by kind of system."""
    kinds: dict[str, list[float]] = {}
    beaten, start = 0, time.process_time()
    for number in range(seed, seed + count):
        rng = np.random.default_rng(number)
        share = float(rng.choice([0.0, 0.1, 1.0], p=[0.4, 0.4, 0.2]))
        stages = [stage_drawn(rng, k == 0, share) for k in range(int(rng.choice([1, 1, 2, 3])))]
        tilt = math.radians(80.0) * float(rng.choice([0.0, rng.random(), 1.0]))
        horizon = PlainHorizon(600.0, 300.0, tilt)
        tau = float(np.exp(rng.uniform(math.log(1e-3), math.log(10.0))))
        bound = references(system_of(stages, horizon), tau)[0]
        ratio = best_found(stages, horizon, tau, number) / bound
        kind = {0.0: "no effects", 0.1: "some effects", 1.0: "all effects"}[share]
        kinds.setdefault(f"{kind}, {'one stage' if len(stages) == 1 else 'chains'}", []).append(
            ratio
        )
        if ratio > 1.0 + 1e-9:
            beaten += 1
            print(f"seed {number}: {ratio:.9f} of the bound ({kind}, tau {tau:g} s)", flush=True)
    for kind, found in sorted(kinds.items()):
        print(f"{kind}: {len(found)} systems, found over bound median {np.median(found):.3f}, "
              f"largest {max(found):.6f}")  # fmt: skip
    print(f"{count} systems from seed {seed}: {beaten} above the bound; "
          f"{time.process_time() - start:.0f} s of processor time")  # fmt: skip


if __name__ == "__main__":
    numbers = [int(one) for one in sys.argv[1:3]]
    main(*(*numbers, *(300, 0)[len(numbers) :]))
