"""The peer as a whole process: one point of the front of a spec by cvxpy and HiGHS.

    python benchmarks/peer_process.py SPEC LIMIT_M [--fair]

Reads a spec of `choice_instances.write_spec` and its catalog as the JSON that they are written in,
works the options' errors, bounds and prices out by formulas of its own, and solves for the cheapest
design whose total is within LIMIT_M.  fair: options that another one of their role makes
superfluous are dropped first.  Prints what it costs.  Nothing of the package is imported.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

Columns = tuple[np.ndarray, np.ndarray, np.ndarray]  # error [m], bound [s], cost [EUR]


def number(text: str) -> float:
    """The figure of `0.05 m`."""
    return float(text.split()[0])


def role_columns(
    catalog: Mapping[str, Any], stage: Mapping[str, Any], role: str, methods: list[str]
) -> Columns:
    """Error, bound and price of every option of a role that keeps its own tau_crit.

    position: |sigma|; attitude: d |sigma|; ranging: sigma_r + sqrt(2) d sigma_u; tau_crit: that
    over v (position) or v + d omega (attitude, ranging).
    """
    platform = stage["platform"]
    distance, speed = number(platform["distance"]), number(platform["v_max"])
    error, cost = [], []
    for name in stage[role]["candidates"]:
        entry = catalog["sensors"][name]
        cost.append(number(entry["cost"]))
        if role == "ranging":
            aside = math.sqrt(2.0) * distance * number(entry["sigma_bearing"])
            error.append(number(entry["sigma_range"]) + aside)
        else:
            arm = 1.0 if role == "position" else distance
            error.append(arm * math.hypot(*map(number, entry[f"sigma_{role}"])))
    offered = [catalog["timestamping"][name] for name in methods]
    taus = np.array([number(one["error"]["high"]) for one in offered])
    prices = np.array([number(one["cost"]) for one in offered])
    rate = speed if role == "position" else speed + distance * number(platform["omega_max"])
    errors = np.repeat(np.array(error), len(taus))
    bounds = np.tile(taus, len(error))
    costs = np.repeat(np.array(cost), len(taus)) + np.tile(prices, len(error))
    keeps = bounds * rate < errors
    return errors[keeps], bounds[keeps], costs[keeps]


def read(path: Path) -> tuple[list[Columns], list[tuple[int, int]], float]:
    """Roles in order, pairs of them whose timestamps meet, and the sync rate [m/s]."""
    spec = json.loads(path.read_text("utf-8"))
    catalog = json.loads((path.parent / spec["catalogs"][0]).read_text("utf-8"))
    methods = spec["timestamping"]["candidates"]
    roles: list[Columns] = []
    pairs, rate, before = [], 0.0, 0
    for stage in spec["stages"]:
        platform = stage["platform"]
        rate += number(platform["v_max"])
        rate += number(platform["distance"]) * number(platform["omega_max"])
        if "position" in stage:
            roles.append(role_columns(catalog, stage, "position", methods))
        both = ("attitude", "ranging")
        roles += [role_columns(catalog, stage, role, methods) for role in both]
        here = len(roles) - 1
        pairs += [(before, here), (here - 1, here)]
        before = here
    return roles, pairs, rate


def undominated(columns: Columns) -> Columns:
    """The options that no other one, no worse in all three figures, makes superfluous."""
    error, bound, cost = columns
    kept: list[int] = []
    for row in np.lexsort((bound, error, cost)).tolist():
        if not ((error[kept] <= error[row]) & (bound[kept] <= bound[row])).any():
            kept.append(row)
    return error[kept], bound[kept], cost[kept]


def solved(
    roles: list[Columns], pairs: list[tuple[int, int]], rate: float, limit_m: float
) -> float:
    """The least price: binaries, a continuous sync error, rows scaled by the limit, no gap."""
    import cvxpy as cp

    x = [cp.Variable(len(cost), boolean=True) for _, _, cost in roles]
    sync = cp.Variable(nonneg=True)
    rows = [cp.sum(one) == 1 for one in x]
    moved = [(rate * bound / limit_m) @ one for (_, bound, _), one in zip(roles, x, strict=True)]
    rows += [moved[one] + moved[other] <= sync for one, other in pairs]
    total = sum((error / limit_m) @ one for (error, _, _), one in zip(roles, x, strict=True))
    rows += [total + sync <= 1.0, sync <= total]
    spent = sum(cost @ one for (_, _, cost), one in zip(roles, x, strict=True))
    program = cp.Problem(cp.Minimize(spent), rows)
    program.solve(solver=cp.HIGHS, mip_rel_gap=0.0, mip_abs_gap=0.0, threads=1)
    if program.status != "optimal":
        raise SystemExit(f"HiGHS says {program.status}")
    return float(program.value)


def main() -> None:
    """Print the least price."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spec", type=Path)
    parser.add_argument("limit_m", type=float)
    parser.add_argument("--fair", action="store_true")
    options = parser.parse_args()
    roles, pairs, rate = read(options.spec)
    if options.fair:
        roles = [undominated(one) for one in roles]
    print(f"{solved(roles, pairs, rate, options.limit_m):.2f}")


if __name__ == "__main__":
    main()
