"""Plans driven in a world of their own, with effects hidden in it, and diagnosed.

    OMP_NUM_THREADS=1 python -m benchmarks.plan --plans 20 [--first 0] [--only car] [--store FILE]

Every shipped platform gets a payload; every plan asks for other effects.  The path of the plan is
driven by `tests/world`, which shares no code with the package: true splines, sensors that read them
where they really sit and when they really measured.  Counted: (found - true) / predicted sigma of
every parameter asked for, and whether the class is resolved: the hidden effect named, without the
other one of the pair among its aliases.  The table of docs/plan.md is what this prints.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.system import pinned_system
from syncline_design.model.system import System
from syncline_design.planning.run import plan
from syncline_design.planning.setup import PlanRequest
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import EffectPair, PlanError, PlanWanted, named
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
STRONG = (8.0, 40.0)  # predicted sigmas that a hidden parameter measures


def spec_text(platform: str) -> str:
    attitude, ranging, _, antenna, arm, distance = PAYLOADS[platform]
    motion = f"{{use: {platform}, distance: {distance}}}" if distance else platform

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


def drawn(run: PlanRun, effect: str, rng: np.random.Generator) -> Hidden:
    """An effect with every parameter some predicted sigmas large."""
    one = named(effect, "")
    sigma = run.result.after[-1].sigma
    values = {
        key.rpartition(".")[2]: float(rng.choice([-1.0, 1.0]) * rng.uniform(*STRONG) * s)
        for key, s in sigma.items()
        if key.startswith(f"{effect}.") and math.isfinite(s)
    }
    if one.effect == "latency":
        values = {k: abs(v) for k, v in values.items()}
    return hidden(one.effect, one.sensor, **values)


def one_plan(number: int, folder: Path, only: str) -> dict[str, object] | None:
    """One plan, its drive, and what the diagnosis made of it."""
    rng = np.random.default_rng([number, 77])
    platforms = [p for p in PAYLOADS if not only or p == only]
    platform = platforms[number % len(platforms)]
    separate = bool((number // len(platforms)) % 2)
    names = (PAIRS if separate else ASKED)[int(rng.integers(len(PAIRS if separate else ASKED)))]
    spec = folder / f"{platform}.yaml"
    spec.write_text(spec_text(platform), encoding="utf-8")
    case = load(spec)
    first, second = (named(n, "") for n in names)
    asked = (
        PlanWanted((), (EffectPair(first, second),))
        if separate
        else PlanWanted(((first, None), (second, None)))
    )
    begun = time.process_time()
    try:
        run = plan(case, PlanRequest(asked, minutes=30.0))
    except PlanError as error:
        return {"number": number, "platform": platform, "asked": names, "refused": str(error)}
    planned = time.process_time()
    found: dict[str, object] = {
        "number": number, "platform": platform, "asked": names, "separate": separate,
        "reached": run.result.reached, "duration_s": run.result.duration_s,
        "plan_cpu_s": planned - begun, "legs": [leg.name for leg in run.result.legs],
        "lines_s": min((60.0 * s.minutes for s in run.result.standard if s.minutes), default=None),
    }  # fmt: skip
    if not run.result.reached:
        return found
    truth = [drawn(run, n, rng) for n in (names[:1] if separate else names)]
    scenario = scenario_of(run, platform, pinned_system(case), number)
    log = make_log(scenario, truth, Noise())
    path = log.to_csv(folder / f"{number}.csv")
    answer = diagnose(case, [path], DiagnosisSettings(seed=number))
    found |= {"diagnose_cpu_s": time.process_time() - planned, "rows": len(scenario.stamps_s),
              "verdict": answer.verdict, "findings": [
                  (f.effect, f.sensor, f.kind, f.material,
                   [(a.effect, a.sensor) for a in f.aliases])
                  for f in answer.findings]}  # fmt: skip
    return found | scored(run, truth, answer, second if separate else None)


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


def summary(rows: list[dict[str, object]]) -> str:
    """The table: by platform and all together."""
    lines = ["| platform | plans | reached | resolved | z: number | z: std | 2 sigma |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    platforms = [*PAYLOADS, "all"]
    for name in platforms:
        own = [r for r in rows if name in (r["platform"], "all")]
        ran = [r for r in own if "z" in r]
        z = np.array([v for r in ran for _, v, _ in r["z"]])  # type: ignore[attr-defined]
        done = [v for r in ran for v in r["resolved"]]  # type: ignore[attr-defined]
        reached = sum(bool(r.get("reached")) for r in own)
        if own:
            std = f"{float(np.sqrt(np.mean(z**2))):.2f}" if z.size else ""
            inside = f"{float(np.mean(np.abs(z) < 2.0)):.0%}" if z.size else ""
            share = f"{sum(done)} of {len(done)}" if done else ""
            cells = (name, len(own), reached, share, z.size, std, inside)
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def stored(path: Path | None) -> Iterator[dict[str, object]]:
    if path is not None and path.exists():
        yield from (json.loads(line) for line in path.read_text().splitlines())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=14)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--store", type=Path)
    options = parser.parse_args()
    rows = list(stored(options.store))
    known = {row["number"] for row in rows}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.first, options.first + options.plans):
            if number in known:
                continue
            row = one_plan(number, Path(folder), options.only)
            if row is None:
                continue
            rows.append(row)
            print(json.dumps(row), file=sys.stderr, flush=True)
            if options.store is not None:
                with options.store.open("a") as out:
                    out.write(json.dumps(row) + "\n")
    print(summary(rows))


if __name__ == "__main__":
    main()
