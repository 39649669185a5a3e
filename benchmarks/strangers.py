"""How often a watch says of an alike run that it is unlike the others, and of a strange one.

    python -m benchmarks.strangers false [--series 200] [--looks 100] [--off S] [--scatter S]
    python -m benchmarks.strangers named [--series 60] [--runs 12]
    python -m benchmarks.strangers later [--series 60]
    python -m benchmarks.strangers dated [--series 200] [--off 1.5]

Statistics of runs are drawn as `benchmarks.campaign series` draws them, from the logs that its
`logs` keeps.  `false`: alike runs, at every look; also whether a look without the runs that were
said to be unlike rings.  `named`: one run, drawn, of which one effect or all of them are others, at
the look after the last.  `later`: a run whose effects are all others among the first ten, and a
change of five bounds from the 11th on; how late it is heard.  `dated`: one effect is another from
the 8th of 12 runs on; which run is said to be the first, and between which, on that day and later.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.campaign import (
    BOUNDS,
    _lasting,
    _off,
    _rings,
    _unrest,
    _values,
    drawn,
    logs_of,
    share,
)
from syncline_design.campaign.changes import Changes
from syncline_design.campaign.compared_runs import ComparedRuns
from syncline_design.campaign.pool import Pool, pool_of
from syncline_design.campaign.standing import standing
from syncline_design.campaign.store import Entry, Stored
from syncline_design.campaign.strangers import part_of, strangers
from syncline_design.diagnosis.sufficient import Sufficient
from tests.watched_series import run_of

ONE = (5.0, 8.0, 12.0)  # bounds of a run by which one effect is another
SIZES = (5.0, 8.0, 20.0, 60.0)  # bounds of a run by which one effect changes
CHANGED, DATED = 8, (8, 9, 10, 12)  # the run that has it first, and looks at it
ALL = (1.5, 3.0, 6.0)  # standard deviation of all parameters, in bounds of a run


def alike(
    asked: argparse.Namespace, series: int, runs: int, group: list[Sufficient]
) -> tuple[list[Sufficient], np.ndarray, np.random.Generator]:
    """Runs of one vehicle, and the values (L, P) that they have."""
    rng = np.random.default_rng([17, series])
    picks = [group[i] for i in rng.integers(len(group), size=runs)]
    return picks, _unrest(picks, rng, asked.scatter, 0.0) + _off(picks, rng, asked.off), rng


def run_pool(
    picks: list[Sufficient], values: np.ndarray, rng: np.random.Generator, asked: argparse.Namespace
) -> Pool:
    lasts = _lasting(rng, len(picks), asked)
    runs = [drawn(s, rng, *own) for s, *own in zip(picks, values, lasts, strict=True)]
    return pool_of(runs, range(len(runs)))


def first(changes: Changes, look: int) -> Changes:
    return part_of(changes, np.arange(look))


def rings_without(changes: Changes) -> tuple[list[int], bool]:
    """Places that are said to be unlike, and whether the others ring then."""
    found = standing(changes, strangers(changes))
    odd, alone = [one.run for one in found.strange], found.alone
    rest = np.delete(np.arange(changes.pool.count), alone)
    return odd, bool(alone) and _rings(part_of(changes, rest), len(rest))


def false(asked: argparse.Namespace, vehicles: list[list[Sufficient]]) -> None:
    said, rung = [], []
    for k in range(asked.series):
        picks, values, rng = alike(asked, k, asked.looks + 1, vehicles[k % len(vehicles)])
        changes = Changes(run_pool(picks, values, rng, asked))
        looks = [rings_without(first(changes, n)) for n in range(3, len(picks) + 1)]
        said.append(any(odd for odd, _ in looks))
        rung.append(any(rings for _, rings in looks))
        print(k, [(n, odd) for n, (odd, _) in enumerate(looks, 3) if odd][:3], flush=True)
    print(f"{asked.looks} looks, off {asked.off:g}, scatter {asked.scatter:g}: said of alike runs "
          f"in {share(sum(said), len(said))} of {len(said)} series, rings without them in "
          f"{share(sum(rung), len(rung))}")  # fmt: skip


def named(asked: argparse.Namespace, vehicles: list[list[Sufficient]]) -> None:
    for sizes, every in ((ONE, False), (ALL, True)):
        for size in sizes:
            right = others = effects = 0
            for k in range(asked.series):
                picks, values, rng = alike(asked, k, asked.runs, vehicles[k % len(vehicles)])
                pool, odd = pool_of(picks, range(len(picks))), int(rng.integers(len(picks)))
                term = pool.terms[int(rng.integers(len(pool.terms)))]
                one = np.zeros(len(pool.labels))
                one[term.index] = size / BOUNDS * _values(pool, term, rng)
                place = [pool.labels.index(label) for label in picks[0].labels]
                values[odd] += _off(picks, rng, size) if every else one[place]
                changes = Changes(run_pool(picks, values, rng, asked))
                found = standing(changes, strangers(changes)).strange
                own = [d.term.label for s in found if s.run == odd for d in s.departures]
                right += bool(own)
                others += any(s.run != odd for s in found)
                effects += term.label in own
            what = f"all effects, {size:g} bounds" if every else f"one effect, {size:g} bounds"
            by = "" if every else f", by its own name {share(effects, asked.series)}"
            print(f"{what}: named {share(right, asked.series)}{by}; another run "
                  f"{share(others, asked.series)}", flush=True)  # fmt: skip


def later(asked: argparse.Namespace, vehicles: list[list[Sufficient]]) -> None:
    """The 11th run and those after it are changed."""
    heard: dict[str, list[int]] = {"without a strange run": [], "all": [], "but for it": []}
    for k in range(asked.series):
        picks, values, rng = alike(asked, k, 31, vehicles[k % len(vehicles)])
        pool = pool_of(picks, range(len(picks)))
        term = pool.terms[int(rng.integers(len(pool.terms)))]
        moved = np.zeros(len(pool.labels))
        moved[term.index] = 5.0 / BOUNDS * _values(pool, term, rng)
        place = [pool.labels.index(label) for label in picks[0].labels]
        values[10:] += moved[place]
        odd = int(rng.integers(1, 9))
        strange = _off(picks, rng, 20.0)
        seed = int(rng.integers(2**32))
        for name in heard:
            own = values.copy()
            own[odd] += 0.0 if name == "without a strange run" else strange
            changes = Changes(run_pool(picks, own, np.random.default_rng(seed), asked))
            heard[name].append(_heard(changes, name == "but for it"))
    for name, found in heard.items():
        print(f"{name}: heard with its run {np.median(found):.0f} in the median, "
              f"{np.quantile(found, 0.9):.0f} in 90 % ({asked.series} series)")  # fmt: skip


def _heard(changes: Changes, apart: bool) -> int:
    for n in range(11, changes.pool.count + 1):
        own = first(changes, n)
        if rings_without(own)[1] if apart else _rings(own, n):
            return n - 10
    return changes.pool.count - 9


def dated(asked: argparse.Namespace, vehicles: list[list[Sufficient]]) -> None:
    """Of series that ring at a look, how many are dated rightly, and how wide the intervals are."""
    for size in SIZES:
        told: dict[int, list[tuple[int, int, int, bool]]] = {look: [] for look in DATED}
        for k in range(asked.series):
            picks, values, rng = alike(asked, k, max(DATED), vehicles[k % len(vehicles)])
            pool = pool_of(picks, range(len(picks)))
            term = pool.terms[int(rng.integers(len(pool.terms)))]
            moved = np.zeros(len(pool.labels))
            moved[term.index] = size / BOUNDS * _values(pool, term, rng)
            place = [pool.labels.index(label) for label in picks[0].labels]
            values = values + np.zeros((len(picks), 1))
            values[CHANGED - 1 :] += moved[place]
            lasts = _lasting(rng, len(picks), asked)
            runs = [drawn(s, rng, *own) for s, *own in zip(picks, values, lasts, strict=True)]
            for look in DATED:
                told[look] += _since(runs[:look])
        for look, every in told.items():
            right = sum(k == CHANGED for _, k, _, _ in every)
            held = sum(low <= CHANGED <= high for low, _, high, _ in every)
            width = np.mean([high - low + 1 for low, _, high, _ in every] or [0])
            odd = sum(alone for *_, alone in every)
            print(f"change of {size:g} bounds with run {CHANGED}, after run {look}: "
                  f"{len(every)} of {asked.series} ring; its run is said in "
                  f"{share(right, len(every))}, the interval holds it in "
                  f"{share(held, len(every))} ({width:.2f} runs wide), another run is said to "
                  f"stand alone in {share(odd, len(every))}", flush=True)  # fmt: skip


def _since(found: list[Sufficient]) -> list[tuple[int, int, int, bool]]:
    """Of runs that ring: numbers of the first run that is said to have the change and of those
    between which it is, and whether a run is said to stand alone."""
    entries = tuple(
        Entry(k + 1, f"#{k + 1}", run_of(one, k), one, f"{k:064d}") for k, one in enumerate(found)
    )
    changes = Changes(pool_of(found, range(len(found))))
    alone = standing(changes, strangers(changes)).alone
    runs = tuple(entry for k, entry in enumerate(entries) if k not in alone)
    stored = Stored(Path("store"), "car", {}, entries, (), {}, (), 0, "", b"")
    seen = ComparedRuns(stored, runs, float(np.log(20.0))).seen
    ends = [(one.low, one.change.k, one.high) for one in seen[:1]]
    return [(*(runs[k].number for k in own), bool(alone)) for own in ends]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["false", "named", "later", "dated"])
    parser.add_argument("--series", type=int, default=60)
    parser.add_argument("--looks", type=int, default=100)
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--off", type=float, default=0.0)
    parser.add_argument("--scatter", type=float, default=0.0)
    asked = parser.parse_args()
    vehicles = list(logs_of("georeference", is_foreign=False).values())
    told = {"false": false, "named": named, "later": later, "dated": dated}
    told[asked.what](asked, vehicles)


if __name__ == "__main__":
    main()
