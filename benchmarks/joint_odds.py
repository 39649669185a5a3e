"""Whether the chances that a joint diagnosis tells of a class come true.

    python -m benchmarks.campaign logs --count 6 --seconds 18     # and --kind position
    python -m benchmarks.joint_odds [--sets N]

Sets of three of the kept logs of every platform, drawn anew from the normal law with one effect in
all of them: the commoner the likelier (exp(-rarity / 40)), its size alike likely by its logarithm
over what is usual, its direction any, of those sizes that come to 4 to 12 standard uncertainties.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from benchmarks.campaign import PLATFORMS, drawn, logs_of
from syncline_design.campaign.naming import Naming
from syncline_design.campaign.pool import Pool, Term, pool_of
from syncline_design.diagnosis.candidates import commonness
from syncline_design.diagnosis.finding import odds
from syncline_design.diagnosis.sufficient import Sufficient

LOGS, TRIES = 3, 200
SEEN = (4.0, 12.0)  # standard uncertainties
TOLD = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
Label = tuple[str, str, int]


def sets(each: int) -> Iterator[tuple[Term, Pool]]:
    """Pools with what is hidden in them."""
    rng = np.random.default_rng(11)
    for kind in ("position", "georeference"):
        for logs in logs_of(kind, is_foreign=False).values():
            for _ in range(each):
                yield from _one(logs, rng)


def _one(logs: list[Sufficient], rng: np.random.Generator) -> Iterator[tuple[Term, Pool]]:
    chosen = [logs[i] for i in rng.choice(len(logs), LOGS, replace=False)]
    clean = pool_of(chosen, range(LOGS))
    hidden = _hidden(clean, rng)
    if hidden is None:
        return
    term, values = hidden
    place = {label: k for k, label in enumerate(clean.labels)}
    full = [drawn(one, rng, values[[place[label] for label in one.labels]]) for one in chosen]
    yield term, pool_of(full, range(LOGS))


def _hidden(pool: Pool, rng: np.random.Generator) -> tuple[Term, np.ndarray] | None:
    """An effect and the values of all parameters; None where none came to be seen so well."""
    weights = np.array([math.exp(-min(commonness(t.label)[0], 150) / 40.0) for t in pool.terms])
    normal = pool.normal.sum(axis=0)
    for _ in range(TRIES):
        term = pool.terms[int(rng.choice(len(weights), p=weights / weights.sum()))]
        first, *_ = slopes = term.effect.slopes()
        way = rng.standard_normal(len(slopes))
        size = math.exp(rng.uniform(math.log(first.low), math.log(min(first.high, first.usual))))
        own = size * way / float(np.linalg.norm(way))
        own = own if first.signed else np.abs(own)
        seen = math.sqrt(max(float(own @ normal[np.ix_(term.index, term.index)] @ own), 0.0))
        if SEEN[0] <= seen <= SEEN[1]:
            values = np.zeros(len(pool.labels))
            values[term.index] = own
            return term, values
    return None


def chances(pool: Pool) -> list[dict[Label, float]]:
    """Of every finding, the members of its class with their chances, the named one first."""
    found = []
    for one in Naming(pool, 0.05, 4).named().terms:
        weights = {one.scoped.term.label: 1.0} | {b.term.label: odds(b.worse) for b in one.rivals}
        total = sum(weights.values())
        found.append({label: weight / total for label, weight in weights.items()})
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=60)
    asked = parser.parse_args()
    made = named = first = inside = 0
    told: list[tuple[float, bool]] = []
    for term, pool in sets(asked.sets):
        made += 1
        classes = chances(pool)
        if not classes:
            continue
        named += 1
        first += any(next(iter(one)) == term.label for one in classes)
        inside += any(term.label in one for one in classes)
        told += [(chance, label == term.label) for label, chance in classes[0].items()]
    print(f"{made} sets of {len(PLATFORMS)} platforms, {named} named something: "
          f"first {first / named:.3f}, in a class {inside / named:.3f}")  # fmt: skip
    print("| told | members | on average | were it |\n|---|---|---|---|")
    for low, high in pairwise(TOLD):
        own = np.array([t for t in told if low <= t[0] < high or t[0] == high == 1.0], dtype=float)
        if len(own):
            print(f"| {low:g} to {high:g} | {len(own)} | {own[:, 0].mean():.3f} "
                  f"| {own[:, 1].mean():.3f} |")  # fmt: skip


if __name__ == "__main__":
    main()
