"""Days of a vehicle watched by the command, end to end: false alarms, and delays.

    python -m benchmarks.days [--series 10] [--first 0] [--days 10] [--moved 6] [--bounds 5]
        [--store FILE] [--keep FOLDER] [--after FOLDER]

Every series is a vehicle of the hidden world (tests/world) with another drive every day and white
noise of the spec's size; with the day after `moved` one effect is another by so many bounds of one
log.  `watch STORE SPEC DAY.csv` is called every day, as a user calls it; docs/joint.md has the
table that this prints.  Stores stay in FOLDER where one is named; those that an earlier call kept
are gone on with from the day of the change where `after` names their folder, so that changes of
other sizes need no more quiet days.  Every change that is told of the parameter that was moved is
held against its true size: z is its error in standard uncertainties.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from typer.testing import CliRunner

from syncline_design.cli.app import app
from tests.world import make_log, scenario
from tests.world.hidden import Hidden, hidden
from tests.world.worldlog import WorldLog, write_columns

PLATFORMS = ("multirotor_lines", "car_stops", "vessel_figure_eights", "fixed_wing_circuits")
EFFECTS = (
    ("latency", "position", "latency_s"),
    ("lever_arm", "position", "x_m"),
    ("latency", "attitude", "latency_s"),
    ("range_bias", "ranging", "bias_m"),
    ("boresight", "ranging", "z_rad"),
)
SECONDS, HZ, DAY_S = 30.0, 5.0, 86_400.0
FIRST_S = 1_790_000_000.0  # 2026-09-21


def day_log(series: int, day: int, values: dict[str, float] | None) -> WorldLog:
    """A log of one day; values: of the effect that the series is about, None: without it."""
    effect, sensor, _ = EFFECTS[series % len(EFFECTS)]
    run = scenario(PLATFORMS[series % len(PLATFORMS)], 5000 + 100 * series + day, SECONDS, HZ)
    acting: tuple[Hidden, ...] = () if values is None else (hidden(effect, sensor, **values),)
    return make_log(run, acting)


def own_name(series: int) -> str:
    return f"series{series + 1}"


def bound(series: int) -> float:
    """What the first day's log tells of the parameter: its Cramer-Rao bound, by the world's own."""
    _, _, name = EFFECTS[series % len(EFFECTS)]
    return day_log(series, 0, {name: 0.0}).cramer_rao()[0, name]


def watched(folder: Path, series: int, day: int, log: WorldLog) -> dict[str, object]:
    """One day's call and what it said."""
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    dated = log.columns | {"time_s": log.columns["time_s"] + FIRST_S + DAY_S * day}
    path = write_columns(folder / f"day{day + 1:02d}.csv", dated)
    words = ["watch", folder / "store.jsonl", folder / "spec.yaml", path, "-q"]
    words += ["-o", f"json:{folder / 'watch.json'}"]
    begun = time.process_time()
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exit_code not in (0, 1):
        raise RuntimeError(done.output + done.stderr)
    found = json.loads((folder / "watch.json").read_text("utf-8"))
    alarms = [
        {
            "names": [f"{a['effect']}({a['sensor']})",
                      *(f"{o['effect']}({o['sensor']})" for o in a["aliases"])],
            "since": a["since"]["run"], "low": a["since"]["low"], "high": a["since"]["high"],
            "parameter": a["parameter"], "change": a["change"], "interval95": a["interval95"],
        }
        for a in found["alarms"]
    ]  # fmt: skip
    return {
        "series": series, "day": day + 1, "exit": done.exit_code, "e_value": found["e_value"],
        "alarms": alarms, "cpu_s": time.process_time() - begun,
    }  # fmt: skip


def quiet_days(kept: Path, moved: int) -> bytes:
    """The lines of a store up to the last look before the change."""
    found: list[bytes] = []
    runs = 0
    for line in kept.read_bytes().splitlines(keepends=True):
        runs += json.loads(line)["body"]["kind"] == "run"
        if runs > moved:
            return b"".join(found)
        found.append(line)
    raise ValueError(f"{kept}: {runs} runs, expected more than {moved}")


def one_series(
    series: int, days: int, moved: int, bounds: float, keep: Path | None, after: Path | None
) -> dict[str, object]:
    """All days of a series; of one that is gone on with, those from the change on."""
    effect, sensor, name = EFFECTS[series % len(EFFECTS)]
    size = bounds * bound(series)
    looks = []
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder) if keep is None else keep / own_name(series)
        own.mkdir(parents=True, exist_ok=True)
        if after is not None:
            known = quiet_days(after / own_name(series) / "store.jsonl", moved)
            (own / "store.jsonl").write_bytes(known)
        for day in range(0 if after is None else moved, days):
            log = day_log(series, day, {name: size} if day >= moved else None)
            looks.append(watched(own, series, day, log))
            print(json.dumps(looks[-1]), file=sys.stderr, flush=True)
    return {
        "series": series, "platform": PLATFORMS[series % len(PLATFORMS)], "moved": moved,
        "effect": f"{effect}({sensor})", "parameter": name, "size": size, "looks": looks,
        "quiet": 0 if after is not None else moved,
    }  # fmt: skip


def errors(one: dict) -> list[float]:  # type: ignore[type-arg]
    """(told - true) / standard uncertainty on each day that told what was moved."""
    told = [a for look in one["looks"] for a in look["alarms"]
            if (a["names"][0], a["parameter"]) == (one["effect"], one["parameter"])]  # fmt: skip
    half = [0.5 * (a["interval95"][1] - a["interval95"][0]) for a in told]
    return [1.96 * (a["change"] - one["size"]) / h for a, h in zip(told, half, strict=True)]


def row(one: dict) -> str:  # type: ignore[type-arg]
    """One series as a line of the table."""
    looks, moved, quiet = one["looks"], one["moved"], one["quiet"]
    false = sum(look["exit"] for look in looks[:quiet])
    heard = next((look for look in looks[quiet:] if look["exit"]), None)
    first = "-" if heard is None else f"{heard['day'] - moved}"
    last = looks[-1]["alarms"]
    right = [a for a in last if one["effect"] in a["names"]]
    since = ", ".join(f"{a['since']} ({a['low']} to {a['high']})" for a in right[:1])
    told = "; ".join(" or ".join(a["names"]) for a in last)
    before = f"{false} of {max(quiet - 1, 0)}"
    off = ", ".join(f"{z:.1f}" for z in errors(one))
    cells = (one["series"] + 1, one["platform"], one["effect"], before, first, told, since, off)
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--series", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--days", type=int, default=10)
    parser.add_argument("--moved", type=int, default=6)
    parser.add_argument("--bounds", type=float, default=5.0)
    parser.add_argument("--store", type=Path)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--after", type=Path)
    asked = parser.parse_args()
    rows = []
    if asked.store is not None and asked.store.exists():
        rows = [json.loads(line) for line in asked.store.read_text("utf-8").splitlines()]
    for series in range(asked.first + len(rows), asked.first + asked.series):
        rows.append(
            one_series(series, asked.days, asked.moved, asked.bounds, asked.keep, asked.after)
        )
        if asked.store is not None:
            with asked.store.open("a", encoding="utf-8") as out:
                out.write(json.dumps(rows[-1]) + "\n")
    print("| series | vehicle | what is moved | alarms before | heard with day | told | since run "
          "| z |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    print("\n".join(row(one) for one in rows))
    late = [next((k for k, x in enumerate(r["looks"][r["quiet"] :], 1) if x["exit"]), np.inf)
            for r in rows]  # fmt: skip
    print(f"median: heard with day {np.median(late):g} after the change")
    last = np.array([z for r in rows for z in errors(r)[-1:]])
    print(f"z of the last day: {last.size}, mean {np.mean(last):.2f}, "
          f"root mean square {np.sqrt(np.mean(last**2)):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
