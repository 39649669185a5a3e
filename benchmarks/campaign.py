"""How much many logs tell together, and how often a watch rings for nothing.

    python -m benchmarks.campaign logs [--count N] [--foreign] [--kind position] [--seconds S]
    python -m benchmarks.campaign power [--sets N] [--foreign]
    python -m benchmarks.campaign series [--series N] [--looks N] [--scatter S] [--drift D]
        [--constants N] [--off S] [--days FOLDER] [--store FILE]
    python -m benchmarks.campaign delays [--series N] [--scatter S] [--days FOLDER] [--store FILE]
    python -m benchmarks.campaign quiet [--foreign]
    python -m benchmarks.campaign cover [--sets N] [--foreign]

`logs` makes clean logs of the hidden world (tests/world) and keeps their statistics under out/.
`power` takes sets of them, adds an effect of three bounds of each log (every parameter, sign
drawn) and asks what is named.  The effect is added to the statistics, along the slopes; whole logs
with such an effect are in tests/test_joint.py.  `series` draws statistics of runs like these from
the normal law and watches them, with one effect drawn from the dictionary that differs from run to
run by S bounds of a run, or that drifts by D bounds over all runs, and N effects of 20 bounds in
all runs; with --off every parameter of every effect is a constant, normal about 0 with so many
bounds of a run, and the runs last between half and twice as long; every series is of one vehicle,
as a store is.  `delays` moves one effect with the 11th
run.  FOLDER: stores that `benchmarks.days --keep` left, of which the first six days are clean; else
the logs are those that were kept.  FILE keeps a row a series; what it has is not run again.
`quiet` watches the clean logs themselves, platform by platform.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.study_scoring import proportion
from syncline_design.campaign.changes import Changes
from syncline_design.campaign.naming import Naming
from syncline_design.campaign.pool import Pool, Scoped, Term, fitted, pool_of
from syncline_design.campaign.store import read_store
from syncline_design.diagnosis.fitting import finely, fit
from syncline_design.diagnosis.searched import prepared
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.diagnosis.sufficient import Less, Sufficient, sufficient
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.world import Noise, make_log, scenario
from tests.world.foreign import KINDS, WHITE, foreign

PLATFORMS = ("multirotor_lines", "car_stops", "vessel_figure_eights", "fixed_wing_circuits")
OUT = Path("out")
SIZES = (1, 2, 4, 9)
BOUNDS = 3.0
CONSTANT = 20.0  # bounds of a run, of what all runs have
CLEAN_DAYS = 6
DELAYED = (3.0, 5.0, 8.0)  # bounds
SECONDS, HZ = 120.0, 5.0
SHIPPED = ("white", "wandering")


def made(platform: str, seed: int, kind: str, noise: str, seconds: float = SECONDS) -> Sufficient:
    """Statistics of one clean log, read from its file, its noise fitted, nothing looked for."""
    run = scenario(platform, seed, seconds, HZ, kind)
    wander = Noise(wander_share=0.6, wander_time_s=15.0)
    if noise in SHIPPED:
        log = make_log(run, (), Noise() if noise == "white" else wander)
    else:
        log = foreign(make_log(run, (), WHITE), noise)
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        case = load(spec)
        inputs = measured(case, [log.to_csv(Path(folder) / "log.csv")])
    data = prepared(inputs, inputs.log)
    return sufficient(data, fit(finely(data)), slow_states(data))


def kept(kind: str, *, is_foreign: bool) -> Path:
    return OUT / f"campaign_{kind}_{'foreign' if is_foreign else 'model'}.pickle"


def make_logs(count: int, kind: str, seconds: float, *, is_foreign: bool) -> None:
    """Logs of every platform, noises in turn; goes on where it was stopped."""
    path = kept(kind, is_foreign=is_foreign)
    path.parent.mkdir(exist_ok=True)
    found = pickle.loads(path.read_bytes()) if path.exists() else {}
    noises = tuple(KINDS) if is_foreign else SHIPPED
    for seed in range(count):
        for index, platform in enumerate(PLATFORMS):
            key = platform, seed
            if key not in found:
                noise = noises[(seed + index) % len(noises)]
                found[key] = made(platform, 2000 + seed, kind, noise, seconds)
                path.write_bytes(pickle.dumps(found))
    print(f"{len(found)} logs in {path}")


def logs_of(kind: str, *, is_foreign: bool) -> dict[str, list[Sufficient]]:
    """Kept logs by platform."""
    found = pickle.loads(kept(kind, is_foreign=is_foreign).read_bytes())
    return {p: [s for (own, _), s in sorted(found.items()) if own == p] for p in PLATFORMS}


def with_effect(pool: Pool, term: Term, values: np.ndarray) -> Pool:
    """The pool with an effect in every log."""
    at = term.index
    moved = pool.normal[:, :, at] @ values
    less = tuple(
        tuple(replace(part, score=part.score + part.normal[:, :, at] @ values) for part in own)
        for own in pool.less
    )
    return replace(pool, score=pool.score + moved, less=less)


def power(sets: int, *, is_foreign: bool) -> None:
    """Sets of 1, 2, 4 and 9 logs, with and without an effect of three bounds."""
    logs = logs_of("georeference", is_foreign=is_foreign)
    rng = np.random.default_rng(7)
    print("| logs | named, or its class | another named | clean sets with a name |")
    print("|---|---|---|---|")
    for size in [n for n in SIZES if n <= min(map(len, logs.values()))]:
        right = wrong = clean = 0
        for k in range(sets):
            own = logs[PLATFORMS[k % len(PLATFORMS)]]
            chosen = [own[i] for i in rng.choice(len(own), size, replace=False)]
            pool = pool_of(chosen, range(size))
            clean += bool(Naming(pool, 0.05, 4).named().terms)
            term = pool.terms[int(rng.integers(len(pool.terms)))]
            found = Naming(with_effect(pool, term, _values(pool, term, rng)), 0.05, 4).named()
            names = [{n.scoped.term.label, *(b.term.label for b in n.rivals)} for n in found.terms]
            right += any(term.label in own for own in names)
            wrong += any(term.label not in own for own in names)
        print(f"| {size} | {share(right, sets)} | {share(wrong, sets)} | {share(clean, sets)} |",
              flush=True)  # fmt: skip


def share(hits: int, of: int) -> str:
    """Per cent with its 95 % interval."""
    return proportion([k < hits for k in range(of)])


def _values(pool: Pool, term: Term, rng: np.random.Generator) -> np.ndarray:
    """Every parameter at three bounds of a log of the set, on average, its sign drawn."""
    normal = pool.normal.mean(axis=0)[np.ix_(term.index, term.index)]
    spread = np.sqrt(np.diag(np.linalg.pinv(normal, rcond=1e-9, hermitian=True)))
    signs = [rng.choice([-1.0, 1.0]) if p.signed else 1.0 for p in term.effect.slopes()]
    return BOUNDS * spread * np.array(signs)


def drawn(
    one: Sufficient, rng: np.random.Generator, values: np.ndarray, lasts: float = 1.0
) -> Sufficient:
    """Statistics of a run driven like this one, so many times as long, drawn from the normal law,
    part by part."""
    (less, *_) = one.less
    parts, scores = [], []
    for part in lasts * (one.normal - less.normal):
        size, turned = np.linalg.eigh(part)
        size = np.maximum(size, 0.0)
        whole = (turned * size) @ turned.T
        parts.append(whole)
        scores.append(whole @ values + turned @ (np.sqrt(size) * rng.standard_normal(len(size))))
    normal, score = np.sum(parts, axis=0), np.sum(scores, axis=0)
    left = Less(normal - np.array(parts), score - np.array(scores), np.zeros(len(parts)))
    return Sufficient(one.labels, normal, score, 0.0, one.gram, (left,))


def vehicles_of_days(folder: Path) -> list[list[Sufficient]]:
    """Statistics of the clean days of watches end to end, by vehicle: a store is of one system."""
    found: dict[str, list[Sufficient]] = {}
    for path in sorted(folder.glob("*/store.jsonl")):
        stored = read_store(path)
        if stored is not None:
            own = found.setdefault(stored.name, [])
            own += [one.found for one in stored.entries[:CLEAN_DAYS]]
    return list(found.values())


def series(vehicles: Sequence[Sequence[Sufficient]], asked: argparse.Namespace) -> None:
    """False alarms over all looks."""
    rows = _rows(asked.store)
    name = f"scatter {asked.scatter:g} drift {asked.drift:g} of {asked.constants} {asked.looks}"
    name += f" off {asked.off:g}" if asked.off else ""
    known = {row["series"]: row["rung"] for row in rows if row["what"] == name}
    for k in range(asked.series):
        if k not in known:
            rng = np.random.default_rng([11, k])
            group = vehicles[k % len(vehicles)]
            picks = [group[i] for i in rng.integers(len(group), size=asked.looks + 1)]
            values = _unrest(picks, rng, asked.scatter, asked.drift)
            values += _constants(picks, rng, asked.constants)
            values, lasts = values + _off(picks, rng, asked.off), _lasting(rng, len(picks), asked)
            runs = [drawn(s, rng, *own) for s, *own in zip(picks, values, lasts, strict=True)]
            changes = Changes(pool_of(runs, range(len(runs))))
            known[k] = _first_ring(changes, range(2, len(runs) + 1))
            _keep(asked.store, {"what": name, "series": k, "rung": known[k]})
    rung = sorted(one for one in known.values() if one is not None)
    print(
        f"{name} looks: {len(known)} series, rung {share(len(rung), len(known))}, with run {rung}"
    )


def delays(vehicles: Sequence[Sequence[Sufficient]], asked: argparse.Namespace) -> None:
    """How late changes of three, five and eight bounds are heard after ten runs."""
    rows = _rows(asked.store)
    for bounds in DELAYED:
        name = f"delay {bounds:g} scatter {asked.scatter:g}"
        name += f" off {asked.off:g}" if asked.off else ""
        known = {row["series"]: row["delay"] for row in rows if row["what"] == name}
        for k in range(asked.series):
            if k not in known:
                rng = np.random.default_rng([13, k])
                group = vehicles[k % len(vehicles)]
                picks = [group[i] for i in rng.integers(len(group), size=31)]
                known[k] = _delay(picks, rng, bounds, asked)
                _keep(asked.store, {"what": name, "series": k, "delay": known[k]})
        heard = np.array(list(known.values()))
        middle, late = np.quantile(heard, [0.5, 0.9])
        print(f"change of {bounds:g} bounds after 10 runs, scatter {asked.scatter:g}: heard with "
              f"its run number {middle:.0f} in the median, {late:.0f} in 90 % ({len(heard)} "
              f"series; {np.sum(heard > 20)} not within 20 runs)")  # fmt: skip


def _rows(path: Path | None) -> list[dict[str, Any]]:
    if path is None or not path.exists():
        return []
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def _keep(path: Path | None, row: dict[str, Any]) -> None:
    if path is not None:
        with path.open("a", encoding="utf-8") as out:
            out.write(json.dumps(row) + "\n")


def _constants(picks: Sequence[Sufficient], rng: np.random.Generator, count: int) -> np.ndarray:
    """Values of all parameters that every run has, (P,): of so many effects, of 20 bounds."""
    pool = pool_of(picks, range(len(picks)))
    found = np.zeros(len(pool.labels))
    for k in rng.choice(len(pool.terms), count, replace=False):
        found[pool.terms[k].index] = CONSTANT / BOUNDS * _values(pool, pool.terms[k], rng)
    return found[[pool.labels.index(label) for label in picks[0].labels]]


def _off(picks: Sequence[Sufficient], rng: np.random.Generator, bounds: float) -> np.ndarray:
    """Values of all parameters that every run has, (P,): each normal with so many bounds."""
    if not bounds:
        return np.zeros(len(picks[0].labels))
    told = np.mean([np.diag(one.normal) for one in picks], axis=0)
    spread = np.where(told > 0.0, told, np.inf) ** -0.5
    return np.asarray(bounds * spread * rng.standard_normal(len(spread)))


def _lasting(rng: np.random.Generator, runs: int, asked: argparse.Namespace) -> np.ndarray:
    return rng.uniform(0.5, 2.0, runs) if asked.off else np.ones(runs)


def _unrest(
    picks: Sequence[Sufficient], rng: np.random.Generator, scatter: float, drift: float
) -> np.ndarray:
    """Values of all parameters by run, (L, P): one effect's differ by bounds of a run."""
    found = np.zeros((len(picks), len(picks[0].labels)))
    if not scatter and not drift:
        return found
    pool = pool_of(picks, range(len(picks)))
    term = pool.terms[int(rng.integers(len(pool.terms)))]
    normal = pool.normal.mean(axis=0)[np.ix_(term.index, term.index)]
    size, turned = np.linalg.eigh(np.linalg.pinv(normal, rcond=1e-9, hermitian=True))
    root = turned * np.sqrt(np.maximum(size, 0.0))
    away = scatter * rng.standard_normal((len(picks), term.size)) @ root.T
    grown = np.linspace(0.0, drift, len(picks))[:, None] * root.sum(axis=1)
    place = [picks[0].labels.index(pool.labels[i]) for i in term.index]
    found[:, place] = away + grown
    return found


def _delay(
    picks: Sequence[Sufficient],
    rng: np.random.Generator,
    bounds: float,
    asked: argparse.Namespace,
) -> float:
    """Runs with the change until the alarm, the first counted; 21 where it never came."""
    quiet = pool_of(picks, range(len(picks)))
    term = quiet.terms[int(rng.integers(len(quiet.terms)))]
    values = np.zeros(len(quiet.labels))
    values[term.index] = bounds / BOUNDS * _values(quiet, term, rng)
    place = [quiet.labels.index(label) for label in picks[0].labels]
    moved = np.array([(values if k >= 10 else 0.0 * values)[place] for k in range(len(picks))])
    moved += _unrest(picks, rng, asked.scatter, 0.0) + _off(picks, rng, asked.off)
    lasts = _lasting(rng, len(picks), asked)
    runs = [drawn(s, rng, *own) for s, *own in zip(picks, moved, lasts, strict=True)]
    changes = Changes(pool_of(runs, range(len(runs))))
    ring = _first_ring(changes, range(11, len(runs) + 1))
    return 21.0 if ring is None else ring - 10.0


def _first_ring(changes: Changes, looks: range) -> int | None:
    return next((n for n in looks if _rings(changes, n)), None)


def _rings(changes: Changes, look: int) -> bool:
    return bool(changes.log_evidence(look)[0] >= np.log(20.0))


def quiet(kind: str, *, is_foreign: bool) -> None:
    """Clean logs of each platform as one series of runs."""
    for platform, own in logs_of(kind, is_foreign=is_foreign).items():
        changes = Changes(pool_of(own, range(len(own))))
        course = [changes.log_evidence(n)[0] for n in range(2, len(own) + 1)]
        ring = next((n + 2 for n, e in enumerate(course) if e >= np.log(20.0)), None)
        most = float(np.exp(min(max(course), 700.0)))
        print(f"{platform}: {len(own)} runs, largest e-value {most:.2g}, first alarm {ring}")


def cover(sets: int, *, is_foreign: bool) -> None:
    """How often intervals hold in clean logs: of every effect alone, in sets of 1 and 4 logs."""
    logs = logs_of("georeference", is_foreign=is_foreign)
    rng = np.random.default_rng(9)
    for size in (1, min(4, *map(len, logs.values()))):
        held = []
        for k in range(sets):
            own = logs[PLATFORMS[k % len(PLATFORMS)]]
            picks = rng.choice(len(own), size, replace=False)
            pool = pool_of([own[i] for i in picks], range(size))
            for term in pool.terms:
                found = fitted(pool, (Scoped(term, "build"),))
                judged = found.judged(found.place[0][0])
                seen = judged.spread > 0.0
                held += list(np.abs(judged.values) < judged.coverage * judged.spread)[: sum(seen)]
        print(f"{size} logs: {proportion(held)} of {len(held)} intervals hold")


def _commands() -> Iterator[str]:
    yield from ("logs", "power", "series", "delays", "quiet", "cover")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=list(_commands()))
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--sets", type=int, default=100)
    parser.add_argument("--series", type=int, default=200)
    parser.add_argument("--looks", type=int, default=100)
    parser.add_argument("--scatter", type=float, default=0.0)
    parser.add_argument("--drift", type=float, default=0.0)
    parser.add_argument("--constants", type=int, default=0)
    parser.add_argument("--off", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--days", type=Path)
    parser.add_argument("--store", type=Path)
    parser.add_argument("--kind", default="georeference", choices=["georeference", "position"])
    parser.add_argument("--foreign", action="store_true")
    asked = parser.parse_args()
    if asked.what == "logs":
        make_logs(asked.count, asked.kind, asked.seconds, is_foreign=asked.foreign)
    elif asked.what == "power":
        power(asked.sets, is_foreign=asked.foreign)
    elif asked.what == "cover":
        cover(asked.sets, is_foreign=asked.foreign)
    elif asked.what in ("series", "delays"):
        vehicles = (
            list(logs_of(asked.kind, is_foreign=False).values())
            if asked.days is None
            else vehicles_of_days(asked.days)
        )
        (series if asked.what == "series" else delays)(vehicles, asked)
    else:
        quiet(asked.kind, is_foreign=asked.foreign)


if __name__ == "__main__":
    main()
