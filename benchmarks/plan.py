"""Plans driven in a world of their own, with effects hidden in it, and diagnosed.

    python -m benchmarks.plan --plans 20 [--first 0] [--store FILE]

Every shipped platform gets a payload.  Plans 0 to 83 ask every platform for the twelve things of
ASKED and PAIRS in turn, 84 to 167 the same at 0.8 of the platform's distance, 168 to 251 at 0.65 of
it.  The path of a plan is driven by `tests/world`, which shares no code with the package: true
splines, sensors that read them where they really sit and when they really measured.  Counted:
(found - true) / predicted sigma of every parameter asked for, and whether the class is resolved:
the hidden effect named, without the other one of the pair among its aliases.  The number of a plan
is the seed of what is hidden and of the noise.

Findings are those of `diagnose`, by its own search and weighing (`examined`, `weigh`); what else it
says (the gap by unseen rows, maps, plots) is not computed, nor are the field's line plans.  The
tables of docs/plan.md are what this prints.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.study_scoring import proportion
from syncline_design.diagnosis import DiagnosisSettings
from syncline_design.diagnosis.consequence import promise_of
from syncline_design.diagnosis.run import WeighedUp, weigh
from syncline_design.diagnosis.searched import examined
from syncline_design.diagnosis.system import measured, pinned_system
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.model.system import System
from syncline_design.planning.run import plan
from syncline_design.planning.setup import PlanRequest
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import EffectPair, PlanError, PlanWanted, named
from syncline_design.spec.case import Case
from syncline_design.spec.load import load
from tests.world.hidden import Hidden, hidden
from tests.world.motions import Sensors
from tests.world.noise import Noise
from tests.world.planned import driven
from tests.world.scenarios import Scenario
from tests.world.worldlog import make_log

STAMPED = "timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}"
LIDAR = "riegl_vux1uav"
# platform: (attitude, ranging, ranging's type for the world, antenna arm, ranging arm, distance)
PAYLOADS: dict[str, tuple[str, str, str, tuple[float, ...], tuple[float, ...], str]] = {
    "uav_fixed_wing": ("sbg_apogee", LIDAR, "lidar", (0.3, 0.0, -0.2), (0.05, 0.0, 0.12), ""),
    "uav_multi_rotor": ("sbg_apogee", LIDAR, "lidar", (0.0, 0.0, -0.25), (0.15, 0.0, 0.05), ""),
    "usv": ("sbg_apogee", LIDAR, "lidar", (-0.8, 0.0, -2.1), (0.6, 0.0, -1.5), ""),
    "car": ("sbg_apogee", LIDAR, "lidar", (-0.4, 0.0, -1.9), (-1.1, 0.0, -2.2), ""),
    "small_sv": ("kongsberg_mru5", "r2sonic_2026", "mbes", (2.0, 0.0, -6.0), (-1.0, 1.0, 2.0),
                 "40 m"),
    "large_sv": ("kongsberg_mru5", "r2sonic_2026", "mbes", (12.0, 0.0, -28.0), (-8.0, 3.0, 7.0),
                 "60 m"),
    "auv": ("kongsberg_mru5", "r2sonic_2026", "mbes", (-1.2, 0.0, -0.4), (0.9, 0.0, 0.3), ""),
}  # fmt: skip
ASKED = (
    ("latency(position)", "lever_arm(position)"),
    ("latency(position)", "boresight(ranging)"),
    ("latency(attitude)", "latency(position)"),
    ("lever_arm(position)", "latency(attitude)"),
    ("boresight(ranging)", "lever_arm(position)"),
    ("range_bias(ranging)", "latency(position)"),
)
PAIRS = (
    ("latency(position)", "lever_arm(position)"),
    ("lever_arm(position)", "latency(position)"),
    ("latency(attitude)", "latency(position)"),
    ("lever_arm(position)", "datum_offset(target)"),
    ("range_bias(ranging)", "range_scale(ranging)"),
    ("boresight(ranging)", "lever_arm(position)"),
)
DISTANCES = (1.0, 0.8, 0.65)  # of the platform's
ROUND = 84  # every platform asked for everything
STRONG = (8.0, 40.0)  # predicted sigmas that a hidden parameter measures


def spec_text(platform: str, distance: str) -> str:
    attitude, ranging, _, antenna, arm, own = PAYLOADS[platform]
    stated = distance or own
    motion = f"{{use: {platform}, distance: {stated}}}" if stated else platform

    def metres(values: tuple[float, ...]) -> str:
        return "[" + ", ".join(f"{v:g} m" for v in values) + "]"

    return "\n".join(
        [
            "syncline: 1", f"name: {platform}",
            "requirements: [{id: ACC-1, kind: accuracy, limit: 20 m}]",
            "stages:", "  - name: vehicle", f"    platform: {motion}",
            f"    position: {{sensor: ublox_f9p_rtk, primitive: pps, {STAMPED}, "
            f"lever_arm: {metres(antenna)}}}",
            f"    attitude: {{sensor: {attitude}, primitive: pps, {STAMPED}}}",
            f"    ranging: {{sensor: {ranging}, primitive: pps, {STAMPED}, "
            f"lever_arm: {metres(arm)}}}",
        ]
    )  # fmt: skip


def scenario_of(run: PlanRun, platform: str, system: System, seed: int) -> Scenario:
    """The plan as a run of the world."""
    stage, states, aims = system.stages[0], run.driven.states[0], run.driven.aims
    assert stage.position is not None
    assert stage.attitude is not None
    assert stage.ranging is not None
    assert aims is not None
    _, _, kind, antenna, arm, _ = PAYLOADS[platform]
    sensors = Sensors(
        stage.position.sigma, stage.attitude.sigma, stage.ranging.sigma, antenna, arm, kind
    )  # type: ignore[arg-type]
    limits = (stage.platform.v_max_mps, stage.platform.omega_max_radps, stage.platform.distance_m)
    return driven(
        platform, seed, states.time_s, states.position_m, states.euler_rad, aims.targets_m,
        aims.aimed, sensors, limits,
    )  # fmt: skip


def drawn(
    run: PlanRun,
    effect: str,
    rng: np.random.Generator,
    strong: tuple[float, float] = STRONG,
) -> Hidden:
    """An effect with every parameter some predicted sigmas large."""
    one = named(effect, "")
    sigma = run.result.after[-1].sigma
    values = {
        key.rpartition(".")[2]: float(rng.choice([-1.0, 1.0]) * rng.uniform(*strong) * s)
        for key, s in sigma.items()
        if key.startswith(f"{effect}.") and math.isfinite(s)
    }
    if one.effect == "latency":
        values = {k: abs(v) for k, v in values.items()}
    return hidden(one.effect, one.sensor, **values)


def case_of(number: int, platform: str, folder: Path) -> Case:
    """The platform's payload, later rounds nearer to what they measure."""
    spec = folder / f"{platform}.yaml"
    spec.write_text(spec_text(platform, ""), encoding="utf-8")
    share = DISTANCES[number // ROUND]
    if share < 1.0:
        usual = pinned_system(load(spec)).stages[0].platform.distance_m
        spec.write_text(spec_text(platform, f"{share * usual:g} m"), encoding="utf-8")
    return load(spec)


def asked_of(number: int) -> tuple[str, bool, tuple[str, str]]:
    """Platform, whether a pair is to be told apart, and the two effects."""
    platforms = list(PAYLOADS)
    turn = number % ROUND // len(platforms)
    separate = bool(turn % 2)
    return platforms[number % len(platforms)], separate, (PAIRS if separate else ASKED)[turn // 2]


def one_plan(number: int, folder: Path) -> dict[str, object]:
    """One plan, its drive, and what the diagnosis made of it."""
    rng = np.random.default_rng([number, 77])
    platform, separate, names = asked_of(number)
    case = case_of(number, platform, folder)
    first, second = (named(n, "") for n in names)
    asked = (
        PlanWanted((), (EffectPair(first, second),))
        if separate
        else PlanWanted(((first, None), (second, None)))
    )
    begun = time.process_time()
    known: dict[str, object] = {"number": number, "platform": platform, "asked": names}
    try:
        run = plan(case, PlanRequest(asked, minutes=30.0, line_plans=False))
    except PlanError as error:
        return known | {"refused": str(error)}
    planned = time.process_time()
    drive = hashlib.sha256(np.round(run.path.position_m, 3).tobytes()).hexdigest()[:16]
    found = known | {
        "separate": separate, "reached": run.result.reached, "drive": drive,
        "duration_s": run.result.duration_s, "plan_cpu_s": planned - begun,
        "legs": [leg.name for leg in run.result.legs],
    }  # fmt: skip
    if not run.result.reached:
        return found
    truth = [drawn(run, n, rng) for n in (names[:1] if separate else names)]
    scenario = scenario_of(run, platform, pinned_system(case), number)
    path = make_log(scenario, truth, Noise()).to_csv(folder / "drive.csv")
    answer = named_in(case, path, number)
    found |= {"diagnose_cpu_s": time.process_time() - planned, "rows": len(scenario.stamps_s),
              "verdict": answer.verdict, "truth": [str(one) for one in truth], "findings": [
                  (f.effect, f.sensor, f.kind, f.material, {
                      k: (v.value, v.standard_uncertainty) for k, v in f.parameters.items()},
                   [(a.effect, a.sensor) for a in f.aliases])
                  for f in answer.findings]}  # fmt: skip
    return found | scored(run, truth, answer, second if separate else None)


def named_in(case: Case, path: Path, seed: int) -> WeighedUp:
    """What `diagnose` names in a log."""
    with one_thread():
        one = examined(measured(case, [path]), DiagnosisSettings(seed=seed))
        return weigh(one, promise_of(case))


def scored(run: PlanRun, truth, answer, rival) -> dict[str, object]:  # type: ignore[no-untyped-def]
    """z of every hidden parameter that was named, and whether every effect was, without a rival."""
    zs, resolved = [], []
    for one in truth:
        match = next((f for f in answer.findings
                      if (f.effect, f.sensor) == (one.effect, one.sensor)), None)  # fmt: skip
        if match is None:
            resolved.append(False)
            continue
        others = {(a.effect, a.sensor) for a in match.aliases}
        if rival is None:
            rivals = {(o.effect, o.sensor) for o in truth if o is not one}
        else:
            rivals = {(rival.effect, rival.sensor)}
        resolved.append(not (others & rivals))
        for name, value in one.parameters:
            sigma = run.result.after[-1].sigma[f"{one.effect}({one.sensor}).{name}"]
            found = match.parameters[name]
            zs.append((f"{one.effect}.{name}", (float(found.value) - float(value)) / sigma,
                       float(found.standard_uncertainty or math.nan) / sigma))  # fmt: skip
    return {"z": zs, "resolved": resolved}


def summary(rows: list[dict[str, Any]]) -> str:
    """The table: by platform and all together."""
    lines = [
        "| platform | plans | reached | resolved | z: number | z: standard deviation | 2 sigma |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in (*PAYLOADS, "all"):
        own = [r for r in rows if name in (r["platform"], "all")]
        ran = [r for r in own if "z" in r]
        z = [[v for _, v, _ in r["z"]] for r in ran]
        every = np.array([v for r in z for v in r])
        done = [v for r in ran for v in r["resolved"]]
        reached = sum(bool(r.get("reached")) for r in own)
        if every.size:
            inside = f"{float(np.mean(np.abs(every) < 2.0)):.0%}"
            cells = (name, len(own), reached, f"{sum(done)} of {len(done)}", every.size,
                     spread_of(z), inside)  # fmt: skip
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join([*lines, "", *_words(rows)])


def spread_of(z: list[list[float]]) -> str:
    """Standard deviation about zero, 95 % by bootstrap over plans."""

    def of(some: list[list[float]]) -> float:
        return float(np.sqrt(np.mean(np.square([v for own in some for v in own]))))

    rng = np.random.default_rng(5)
    full = [own for own in z if own]
    drawn = [of([full[i] for i in rng.integers(len(full), size=len(full))]) for _ in range(2000)]
    low, high = np.quantile(drawn, [0.025, 0.975])
    return f"{of(full):.2f} [{low:.2f}, {high:.2f}]"


def _words(rows: list[dict[str, Any]]) -> Iterator[str]:
    ran = [r for r in rows if "z" in r]
    done = [v for r in ran for v in r["resolved"]]
    pairs = [v for r in ran if r["separate"] for v in r["resolved"]]
    yield f"{len(ran)} verified, {len({r['drive'] for r in ran})} distinct drives"
    yield f"resolved {proportion(done)}, pairs {proportion(pairs)}"
    missed = [r["number"] for r in ran if not all(r["resolved"])]
    far = [(r["number"], k, round(v, 1)) for r in ran for k, v, _ in r["z"] if abs(v) > 3.0]
    yield f"not resolved in {missed}; beyond 3 sigma {far}"
    cpu = [r["plan_cpu_s"] + r["diagnose_cpu_s"] for r in ran]
    yield f"processor time {np.median(cpu):.1f} s in the median"


def stored(path: Path | None) -> Iterator[dict[str, Any]]:
    if path is not None and path.exists():
        yield from (json.loads(line) for line in path.read_text("utf-8").splitlines())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=14)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--store", type=Path)
    options = parser.parse_args()
    rows = list(stored(options.store))
    known = {row["number"] for row in rows}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.first, options.first + options.plans):
            if number in known:
                continue
            rows.append(one_plan(number, Path(folder)))
            print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
            if options.store is not None:
                with options.store.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(rows[-1]) + "\n")
    print(summary(rows))


if __name__ == "__main__":
    main()
