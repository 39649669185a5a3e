"""A fast yardstick of `diagnose` in noise that is not the model's, on measured and on made logs.

    python -m benchmarks.foreign_noise [--measured FOLDER] [--only TEXT] [--seeds N] [--made no]

FOLDER holds measured logs (NAME.yaml with NAME*.csv).  Prints a line a log, then a table: verdicts,
false causes on clean logs (material and immaterial apart), names and classes hit, coverage of the
stated intervals, processor time.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.study_scoring import proportion
from tests.world import SILENT, Hidden, Noise, hidden, make_log, scenario
from tests.world.foreign import KINDS, WHITE, foreign

PLATFORMS = ("multirotor_lines", "car_stops", "vessel_figure_eights", "fixed_wing_circuits")
STOCHASTIC = ("noise_understated", "correlated_noise", "heavy_tails", "height_drift")
SIZE = 0.5  # own RMS of a hidden effect, over the RMS of a clean log

# (effect, sensor): {parameter: true value}; an empty one is named without a known size
TRUTHS: dict[str, dict[tuple[str, str], dict[str, float]]] = {
    "woods_natural": {
        ("latency", "ranging"): {"latency_s": 0.068},
        ("range_scale", "ranging"): {"scale": 0.013},
        ("range_bias", "ranging"): {"bias_m": -0.038},
        ("scan_distortion", "ranging"): {},
        ("azimuth_bias", "ranging"): {},
        # by this much the arm in the spec of woods_clean, where all is taken out, is another
        ("lever_arm", "position"): {"x_m": -0.00392, "y_m": -0.01748},
    },
    "woods_clean": {("latency", "ranging"): {}, ("scan_distortion", "ranging"): {}},
    "euroc_natural": {
        ("lever_arm", "position"): {"x_m": -0.0093, "y_m": 0.0417, "z_m": 0.0057},
        ("latency", "position"): {"latency_s": -0.0045},
    },
    "euroc_clean": {},
    "asl_natural": {("latency", "ranging"): {}},
    "asl_no_lever": {
        ("lever_arm", "ranging"): {"x_m": 0.0852, "y_m": -0.0344, "z_m": 0.0031},
    },
}
WANTED = {
    "woods_natural": 4, "euroc_natural": 2, "asl_natural": 1, "asl_no_lever": 1,
}  # fmt: skip
EFFECTS: tuple[Hidden, ...] = (
    hidden("latency", "position", latency_s=0.01),
    hidden("lever_arm", "position", x_m=0.02, y_m=-0.01, z_m=0.01),
    hidden("range_scale", "ranging", scale=0.001),
    hidden("heading_bias", "attitude", bias_rad=0.001),
    hidden("latency", "ranging", latency_s=0.01),
    hidden("lever_arm", "ranging", x_m=0.02, y_m=-0.01, z_m=0.01),
    hidden("range_bias", "ranging", bias_m=0.01),
    hidden("boresight", "ranging", x_rad=0.001, y_rad=-0.002, z_rad=0.001),
)


@dataclass(frozen=True)
class Task:
    """One log: where it is, or how it is made."""

    name: str
    family: str
    folder: str = ""
    kind: str = ""
    platform: str = ""
    effect: Hidden | None = None
    seed: int = 0


def made(seeds: int) -> Iterator[Task]:
    """Clean and hidden-effect logs of every kind of noise, platforms and effects in turn."""
    for seed in range(seeds):
        for index, kind in enumerate(("white", *KINDS)):
            turn = index + seed
            for part in range(2):
                platform = PLATFORMS[(turn + 2 * part) % len(PLATFORMS)]
                name = f"{kind} / {platform} / {seed}"
                yield Task(f"clean / {name}", f"clean, {kind}", "", kind, platform, None, seed)
                one = EFFECTS[(turn + 3 * part) % len(EFFECTS)]
                label = f"{one.effect} ({one.sensor})"
                yield Task(f"{label} / {name}", f"hidden, {kind}", "", kind, platform, one, seed)


def written(task: Task, folder: Path) -> tuple[Path, list[Path], Any]:
    """(spec, logs, truth) of a task; truth as in TRUTHS."""
    if task.folder:
        found = Path(task.folder)
        return (
            found / f"{task.name}.yaml",
            sorted(found.glob(f"{task.name}*.csv")),
            TRUTHS[task.name],
        )
    run = scenario(task.platform, 400 + task.seed, 150.0)
    effects: tuple[Hidden, ...] = ()
    if task.effect is not None:
        shown = make_log(run, (task.effect,), SILENT).error()
        own = float(
            np.sqrt(np.mean(np.sum((shown - make_log(run, (), SILENT).error()) ** 2, axis=1)))
        )
        clean = make_log(run, (), Noise()).error()
        times = SIZE * float(np.sqrt(np.mean(np.sum(clean**2, axis=1)))) / own
        sized = {name: times * float(value) for name, value in task.effect.parameters}
        effects = (task.effect.with_values(sized),)
    log = make_log(run, effects, Noise() if task.kind == "white" else WHITE)
    if task.kind != "white":
        log = foreign(log, task.kind)
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    truth = {(e.effect, e.sensor): dict(e.parameters) for e in log.truth}
    return spec, [log.to_csv(folder / "log.csv")], truth


def solve(task: Task) -> dict[str, Any]:
    from syncline_design.diagnosis import diagnose

    with tempfile.TemporaryDirectory() as folder:
        spec, logs, truth = written(task, Path(folder))
        start = time.process_time()
        found = diagnose(spec, logs).to_json()
    return {**scored(task, found, truth), "seconds": time.process_time() - start}


def scored(task: Task, found: dict[str, Any], truth: Any) -> dict[str, Any]:
    """What of the truth was named, what else was named as a cause, which intervals hold."""
    hit, in_class, false, covered = set(), set(), [], []
    for one in found["findings"]:
        own = (one["effect"], one["sensor"])
        names = {own, *((a["effect"], a["sensor"]) for a in one["aliases"])}
        in_class |= names & set(truth)
        if own in truth:
            hit.add(own)
            covered += [
                (name, *_interval(one["parameters"][name]), value)
                for name, value in truth[own].items()
                if one["parameters"][name]["seen"]
            ]
        elif not names & set(truth) and one.get("kind", _kind(one)) == "cause":
            false.append((*own, one.get("material", True)))
    wanted = WANTED.get(task.name, 0) if task.folder else len(truth)
    return {
        "name": task.name,
        "family": task.family,
        "verdict": found["verdict"],
        "clean": not wanted,
        "named": len(hit) >= wanted,
        "class": len(in_class) >= wanted,
        "false": false,
        "covered": [low <= value <= high for _, low, high, value in covered],
        "intervals": covered,
        "found": [_shown(one) for one in found["findings"]],
        "remaining": {k: found["remaining"].get(k) for k in ("size_m", "spec_m", "material", "p")},
    }


def _kind(finding: dict[str, Any]) -> str:
    return "noise" if finding["effect"] in STOCHASTIC else "cause"


def _interval(estimate: dict[str, Any]) -> tuple[float, float]:
    if estimate.get("interval95"):
        return estimate["interval95"][0], estimate["interval95"][1]
    spread = estimate["standard_uncertainty"]
    spread = float("inf") if spread is None else spread
    return estimate["value"] - 1.96 * spread, estimate["value"] + 1.96 * spread


def _shown(finding: dict[str, Any]) -> str:
    values = ", ".join(p["text"] for p in finding["parameters"].values())
    kind = finding.get("kind", "")
    mark = "" if finding.get("material", True) else " (immaterial)"
    return f"{finding['effect']} ({finding['sensor']}) {values} {kind}{mark}".strip()


def line(row: dict[str, Any]) -> str:
    rest = row["remaining"]
    left = "" if rest["size_m"] is None else f" left {rest['size_m']:.2g} of {rest['spec_m']:.2g} m"
    marks = "".join(
        [
            " CLASS" if row["class"] and not row["named"] else "" if row["named"] else " MISSED",
            " FALSE" if row["false"] else "",
            " OUTSIDE" if not all(row["covered"]) else "",
        ]
    )
    return f"{row['seconds']:5.1f} s {row['name']}: {row['verdict']}{left}{marks}\n        " + (
        "; ".join(row["found"]) or "nothing"
    )


def table(rows: list[dict[str, Any]]) -> str:
    """A line a family, and one over all."""
    heads = (
        "| logs | n | agrees / explained / unexplained | false material | false immaterial "
        "| named | class | covered | s |"
    )
    lines = [heads, "|---" * 9 + "|"]
    families = [*dict.fromkeys(row["family"] for row in rows)]
    groups = [(f, [r for r in rows if r["family"] == f]) for f in families]
    groups += [
        ("all clean", [r for r in rows if r["clean"]]),
        ("all hidden", [r for r in rows if not r["clean"]]),
        ("all", rows),
    ]
    for name, part in groups:
        if not part:
            continue
        words = ("agrees", "explained", "unexplained")
        verdicts = " / ".join(str(sum(r["verdict"] == w for r in part)) for w in words)
        material = proportion(any(f[2] for f in r["false"]) for r in part)
        other = proportion(any(not f[2] for f in r["false"]) for r in part)
        named, classes = (
            proportion(r[k] for r in part if not r["clean"]) for k in ("named", "class")
        )
        inside = proportion(c for r in part for c in r["covered"])
        cost = np.mean([r["seconds"] for r in part])
        lines.append(
            f"| {name} | {len(part)} | {verdicts} | {material} | {other} | {named} | {classes} "
            f"| {inside} | {cost:.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--measured", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--made", default="yes", choices=("yes", "no"))
    parser.add_argument("--processes", type=int, default=1)
    given = parser.parse_args()
    tasks = list(made(given.seeds)) if given.made == "yes" else []
    if given.measured:
        tasks = [Task(n, "measured", str(given.measured)) for n in TRUTHS] + tasks
    tasks = [t for t in tasks if given.only in t.name]
    rows = []
    with ProcessPoolExecutor(given.processes) as pool:
        for row in pool.map(partial(solve), tasks):
            rows.append(row)
            print(line(row), file=sys.stderr, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
