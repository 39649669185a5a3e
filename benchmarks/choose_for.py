"""Interval of the probability that `choose_for: 0.95` decides by, against its closed form.

    python benchmarks/choose_for.py [--runs 100] [--seed 0]

A position and a range with figures uniform in their intervals, attitude without one: the error is
a U + b V + c, so that the probability of keeping the accuracy limit is an area under a line in the
unit square.  Limits are set for probabilities on both sides of the one asked for.  For each, runs
with other random numbers: how often the interval holds the true probability, how often the answer
is wrong, how often it is left open, how many samples it took.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from family_specs import written
from syncline_design.choice.problem import build_problem, sole_design
from syncline_design.spec.load import load
from syncline_design.verdict.likely import likelihood_of

ASKED = 0.95
PROBABILITIES = (0.93, 0.948, 0.949, 0.951, 0.952, 0.97)
SPAN_P, SPAN_R = (0.02, 0.06), (0.01, 0.05)  # sigma of position on each axis, of range [m]
FIXED_M = 30.0 * (math.sqrt(3) * math.radians(0.02) + math.sqrt(2) * math.radians(0.001))
CAUSED_M = (2.0 + 30.0 * math.radians(10.0)) * 2e-6  # rate times both bounds of 1 us


def below(limit_m: float) -> float:
    """P(sqrt(3) sigma_p + sigma_r + fixed <= limit): area of the unit square under a line."""
    a, b = math.sqrt(3) * (SPAN_P[1] - SPAN_P[0]), SPAN_R[1] - SPAN_R[0]
    c = limit_m - FIXED_M - CAUSED_M - math.sqrt(3) * SPAN_P[0] - SPAN_R[0]
    corners = sum(
        sign * max(0.0, c - x) ** 2 for sign, x in ((1, 0.0), (-1, a), (-1, b), (1, a + b))
    )
    return corners / (2.0 * a * b)


def limit_of(probability: float) -> float:
    """The limit [m] that is kept with a probability, by halving."""
    low, high = 0.0, 1.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) < probability else (low, middle)
    return high


def spec_of(limit_m: float) -> tuple[dict, dict]:
    sensors = {
        "fix": {"modality": "position",
                "sigma_position": f"{SPAN_P[0]} m .. {SPAN_P[1]} m"},
        "gyro": {"modality": "attitude", "sigma_attitude": "0.02 deg"},
        "beam": {"modality": "ranging", "sigma_bearing": "0.001 deg",
                 "sigma_range": f"{SPAN_R[0]} m .. {SPAN_R[1]} m"},
    }  # fmt: skip
    for one in sensors.values():
        one |= {"type": "made", "primitives": ["pps"], "cost": "1 EUR"}
    error = {"distribution": "uniform", "low": "-0.000001 s", "high": "0.000001 s"}
    method = {"primitives": ["pps"], "cost": "0 EUR", "error": error}
    stage = {
        "name": "uav",
        "platform": {"v_max": "2 m/s", "omega_max": "10 deg/s", "distance": "30 m",
                     "baseline": "1 m"},
        "position": {"candidates": ["fix"]}, "attitude": {"candidates": ["gyro"]},
        "ranging": {"candidates": ["beam"]},
    }  # fmt: skip
    spec = {
        "syncline": 1, "name": "probability", "catalogs": ["parts.yaml"], "choose_for": ASKED,
        "requirements": [{"id": "A", "kind": "accuracy", "limit": f"{limit_m:.15f} m"}],
        "stages": [stage], "timestamping": {"candidates": ["stamp"]},
    }  # fmt: skip
    return spec, {"sensors": sensors, "timestamping": {"stamp": method}}


def study(folder: Path, probability: float, runs: int, first: int) -> str:
    """A row of the table."""
    spec, parts = spec_of(limit_of(probability))
    case = load(written(folder, spec, parts))
    problem = build_problem(case)
    sole = sole_design(problem)
    assert sole is not None, json.dumps(spec)
    holds = wrong = left_open = samples = 0
    for seed in range(first, first + runs):
        found = likelihood_of([case], ASKED, seed).of([sole[0]], [sole[1]])
        holds += found.low <= probability <= found.high
        wrong += found.status == ("fail" if probability > ASKED else "pass")
        left_open += found.status == "indeterminate"
        samples += found.samples
    return f"| {probability} | {holds} of {runs} | {wrong} | {left_open} | {samples // runs} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    start = time.process_time()
    print("| true probability | interval holds it | wrong | left open | samples, mean |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for probability in PROBABILITIES:
            print(study(Path(folder), probability, asked.runs, asked.seed), flush=True)
    print(f"{time.process_time() - start:.0f} s of processor time")


if __name__ == "__main__":
    main()
