"""Study of `diagnose` in noise of many kinds: false causes, names, intervals, verdicts.

    python -m benchmarks.study_noise [--seeds N] [--first-seed S] [--minutes M] [--misses]
                                     [--measured FOLDER] [--write docs/study.md]

One process.  Every seed has, of each kind of noise, a clean log, a log with one effect at ten
bounds (computed with the noise that made the log) and a log whose effect is not in the dictionary.
The block that nothing sees only judges what was found, so it is left out to save time.
Finished logs are kept in out/ for as long as the code stays the same, so a stopped study goes on.
With --measured, effects are planted in measured logs as well.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import syncline_design
from benchmarks.study_cases import DELETED, GEOREFERENCE, ONE_SIGN, PLATFORMS, _one
from benchmarks.study_diagnosis import ROOT, digest
from benchmarks.study_planted import PLANTED, planted
from benchmarks.study_scoring import exact, names_of, proportion, stands_for
from tests.world import Hidden, Noise, Scenario, WorldLog, make_log, scenario
from tests.world.bound import fitted_keys
from tests.world.foreign import AS_MEASURED, KINDS, WHITE, foreign
from tests.world.foreign_bound import information_in

KEPT = ROOT / "out" / "study_noise.jsonl"
CODE = ("tests/world/*.py", "benchmarks/study_*.py", "syncline_design/diagnosis/*.py",
        "syncline_design/effects/*.py")  # fmt: skip
MODEL = ("white", "wandering")
FAMILIES = (*MODEL, *KINDS, *AS_MEASURED)
WANDER = Noise(wander_share=0.6, wander_time_s=20.0)
BOUNDS = {"hidden": 10.0, "deleted": 60.0}
DURATION_S, RATE_HZ = 150.0, 10.0
STEP_AT_S = 70.0
START, END = "<!-- noise study: start -->", "<!-- noise study: end -->"
Row = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """One log: kind of noise, what is asked of it, and the row of the effects' table."""

    family: str
    asked: str  # clean, hidden or deleted
    seed: int
    platform: str
    effect: int = -1
    exclude: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        return "-" if self.effect < 0 else "{} ({})".format(*GEOREFERENCE[self.effect][:2])

    @property
    def id(self) -> str:
        return f"{self.family}/{self.asked}/{self.label}/{self.platform}/{self.seed}"


def cases(first: int, seeds: int) -> Iterator[Case]:
    """Seed by seed, so that a part of the study is a fair sample of it."""
    usable = [k for k, row in enumerate(GEOREFERENCE) if set(row[3]) & set(PLATFORMS)]
    for seed in range(first, first + seeds):
        for index, family in enumerate(FAMILIES):
            turn = seed + index
            yield Case(family, "clean", seed, PLATFORMS[turn % len(PLATFORMS)])
            row = usable[(7 * seed + 5 * index) % len(usable)]
            where = [p for p in GEOREFERENCE[row][3] if p in PLATFORMS]
            yield Case(family, "hidden", seed, where[turn % len(where)], row)
            if turn % 2 == 0:
                row, names = DELETED[(seed + index // 2) % len(DELETED)]
                where = [p for p in GEOREFERENCE[row][3] if p in PLATFORMS]
                yield Case(family, "deleted", seed, where[turn % len(where)], row, names)


def sized(case: Case, run: Scenario) -> tuple[Hidden, ...]:
    """The effect at so many bounds, in the noise that the log will have."""
    if case.effect < 0:
        return ()
    effect = _one(case.effect)
    if (
        effect.effect == "timestamp_step"
    ):  # the table's own instant is near the end of so short a log
        effect = effect.with_values({"time_s": STEP_AT_S})
    keys = fitted_keys((effect,))
    # the bound takes Gauss-Markov noise of the model as white of half its variance: a little large
    kind = "white" if case.family in MODEL else case.family
    bound = np.sqrt(np.diag(np.linalg.inv(information_in(run, (effect,), kind, keys))))
    if case.family == "wandering":
        bound = np.sqrt(np.diag(np.linalg.inv(_wandering(run, effect, keys))))
    signs = np.random.default_rng([case.seed, 59]).choice([-1.0, 1.0], len(keys))
    if effect.effect in ONE_SIGN:
        signs = np.ones(len(keys))
    sizes = BOUNDS[case.asked] * signs * bound
    return (effect.with_values({n: float(v) for (_, n), v in zip(keys, sizes, strict=True)}),)


def _wandering(run: Scenario, effect: Hidden, keys: list[Any]) -> Any:
    from tests.world.bound import information

    return information(run, (effect,), WANDER, keys)


def made(case: Case) -> WorldLog:
    run = scenario(case.platform, case.seed, DURATION_S, RATE_HZ)
    effects = sized(case, run)
    if case.family in MODEL:
        return make_log(run, effects, Noise() if case.family == "white" else WANDER)
    return foreign(make_log(run, effects, WHITE), case.family)


def solve(case: Case) -> Row:
    """Make the log, diagnose it, score it; a failure of the diagnosis is a result too."""
    from syncline_design.diagnosis import DiagnosisSettings, diagnose

    base = {"id": case.id, "family": case.family, "asked": case.asked, "label": case.label}
    log = made(case)
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        data = log.to_csv(Path(folder) / "log.csv")
        began = time.process_time()
        try:
            settings = DiagnosisSettings(
                case.seed, exclude_effects=case.exclude, unseen_block=False
            )
            found = diagnose(spec, [data], settings).to_json()
        except Exception as error:
            return {**base, "error": f"{type(error).__name__}: {error}"}
    return {**base, **scored(log, found), "seconds": time.process_time() - began}


def scored(log: WorldLog, found: Row) -> Row:
    """Names, false causes, intervals, and what is left."""
    truth, findings = log.truth, found["findings"]
    right = [f for f in findings if any(stands_for(log, e, f) for e in truth)]
    named = all(any(stands_for(log, e, f) for f in findings) for e in truth) if truth else None
    causes = [f for f in findings if f["kind"] == "cause" and f not in right]
    covered = [
        bool(interval[0] <= e.number(name) <= interval[1])
        for e in truth
        for f in findings
        if exact(e, f)
        for _, name in fitted_keys((e,))
        if (interval := f["parameters"][name].get("interval95")) is not None
    ]
    return summary(found, named, causes, covered)


def summary(found: Row, named: bool | None, causes: list[Row], covered: list[bool]) -> Row:
    findings, rest = found["findings"], found["remaining"]
    return {
        "verdict": found["verdict"],
        "named": named,
        "false": [(f["effect"], f["sensor"], f["material"]) for f in causes],
        "covered": covered,
        "found": [
            f"{f['effect']} ({f['sensor']}) {f['kind']}{'' if f['material'] else ', immaterial'}"
            for f in findings
        ],
        "left": [rest["size_m"], rest["spec_m"], rest["material"]],
    }


def solve_planted(measured: Path, name: str) -> Row:
    """An effect planted in a measured log."""
    from syncline_design.diagnosis import diagnose

    base = {"id": f"measured/{name}", "family": "planted in measured logs", "asked": "hidden",
            "label": name}  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        spec, logs, wanted, truth = planted(measured, name, Path(folder))
        began = time.process_time()
        try:
            found = diagnose(spec, logs).to_json()
        except Exception as error:
            return {**base, "error": f"{type(error).__name__}: {error}"}
    findings = found["findings"]
    right = [f for f in findings if wanted & names_of(f)]
    causes = [f for f in findings if f["kind"] == "cause" and f not in right]
    covered = [
        bool(interval[0] <= value <= interval[1])
        for f in findings
        if (f["effect"], f["sensor"]) in wanted
        for key, value in truth.items()
        if (interval := f["parameters"].get(key, {}).get("interval95")) is not None
    ]
    row = summary(found, bool(right), causes, covered)
    return {**base, **row, "seconds": time.process_time() - began}


def kept_rows(code: str) -> dict[str, Row]:
    """Rows of earlier runs of the same code; a torn last line is left out."""
    rows: dict[str, Row] = {}
    for line in KEPT.read_text(encoding="utf-8").splitlines() if KEPT.exists() else []:
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if row["code"] == code:
            rows[row["id"]] = row
    return rows


def run_all(wanted: list[Case], measured: Path | None, minutes: float | None) -> list[Row]:
    """Solve every case not yet kept, until the minutes are used up."""
    code = digest(*CODE)
    rows = kept_rows(code)
    deadline = None if minutes is None else time.monotonic() + 60.0 * minutes
    tasks: list[tuple[str, Any]] = [(case.id, (solve, (case,))) for case in wanted]
    if measured is not None:
        own = [(f"measured/{n}", (solve_planted, (measured, n))) for n in PLANTED]
        tasks = [*tasks[:20], *own, *tasks[20:]]
    KEPT.parent.mkdir(exist_ok=True)
    with KEPT.open("a", encoding="utf-8") as file:
        for name, (work, given) in tasks:
            if deadline is not None and time.monotonic() > deadline:
                break
            if name not in rows:
                rows[name] = {**work(*given), "code": code}
                file.write(json.dumps(rows[name]) + "\n")
                file.flush()
    return [rows[name] for name, _ in tasks if name in rows]


def table(rows: list[Row]) -> str:
    """A line a kind of noise, then model noise, foreign noise and all together."""
    head = (
        "| noise | logs | clean: false material cause | clean: false immaterial cause "
        "| clean: agrees or explained | at ten bounds: named | beside it: false material cause "
        "| intervals that hold | not in the dictionary: unexplained or stand-ins |"
    )
    lines = [head, "|---" * 9 + "|"]
    good = [row for row in rows if "error" not in row]
    families = list(dict.fromkeys(row["family"] for row in good))
    groups = [(f, [r for r in good if r["family"] == f]) for f in families]
    made_up = [r for r in good if r["family"] in FAMILIES]
    groups.append(("**model noise**", [r for r in made_up if r["family"] in MODEL]))
    groups.append(("**foreign noise**", [r for r in made_up if r["family"] not in MODEL]))
    groups.append(("**all made logs**", made_up))
    return "\n".join([*lines, *(_line(name, part) for name, part in groups)])


def _line(name: str, rows: list[Row]) -> str:
    asked = {
        kind: [r for r in rows if r["asked"] == kind] for kind in ("clean", "hidden", "deleted")
    }
    clean, hidden, deleted = (asked[k] for k in ("clean", "hidden", "deleted"))
    cells = [
        f"{len(clean)} + {len(hidden)} + {len(deleted)}",
        proportion(any(f[2] for f in r["false"]) for r in clean),
        proportion(any(not f[2] for f in r["false"]) for r in clean),
        proportion(r["verdict"] != "unexplained" for r in clean),
        proportion(bool(r["named"]) for r in hidden),
        proportion(any(f[2] for f in r["false"]) for r in hidden),
        proportion(c for r in hidden for c in r["covered"]),
        proportion(honest(r) for r in deleted),
    ]
    return f"| {name} | " + " | ".join(cells) + " |"


def honest(row: Row) -> bool:
    """No cause is claimed for an effect that is not there to be named, or its kin is named."""
    return row["verdict"] == "unexplained" or not any(f[2] for f in row["false"])


def missed(row: Row) -> bool:
    if "error" in row:
        return True
    if row["asked"] == "clean":
        return bool(row["false"]) or row["verdict"] == "unexplained"
    if row["asked"] == "deleted":
        return not honest(row)
    return not row["named"] or any(f[2] for f in row["false"]) or not all(row["covered"])


def by_label(rows: list[Row]) -> str:
    """How often each effect was named at ten bounds, of those that were missed or not alone."""
    lines = ["| hidden effect at ten bounds | named | false beside it |", "|---|---|---|"]
    own = [r for r in rows if r["asked"] == "hidden" and "error" not in r]
    bad = {r["label"] for r in own if not r["named"] or any(f[2] for f in r["false"])}
    others = [r for r in own if r["label"] not in bad]
    own = [r for r in own if r["label"] in bad]
    for label in sorted({r["label"] for r in own}):
        part = [r for r in own if r["label"] == label]
        false = sorted({f"{f[0]} ({f[1]})" for r in part for f in r["false"] if f[2]})
        named = f"{sum(bool(r['named']) for r in part)} of {len(part)}"
        lines.append(f"| {label} | {named} | {', '.join(false) or 'nothing'} |")
    if others:
        kinds = len({r["label"] for r in others})
        lines.append(f"| {kinds} others | {len(others)} of {len(others)} | nothing |")
    return "\n".join(lines)


def report(rows: list[Row], asked: int, first: int) -> str:
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    errors = sum("error" in row for row in rows)
    seconds = np.mean([row["seconds"] for row in rows if "seconds" in row])
    head = (
        f"syncline-design {syncline_design.__version__}, {day}, seeds from {first}; {len(rows)} of "
        f"{asked} wanted logs, {errors} ended in an error, {seconds:.1f} s of processor time a log."
    )
    return f"{head}\n\n{table(rows)}\n\n{by_label(rows)}\n"


def write(path: Path, text: str) -> None:
    """Put the report between the marks of a page."""
    page = path.read_text(encoding="utf-8")
    before, _, rest = page.partition(START)
    _, _, after = rest.partition(END)
    path.write_text(f"{before}{START}\n{text}{END}{after}", encoding="utf-8")


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=700)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--measured", type=Path)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--misses", action="store_true")
    given = parser.parse_args(None if arguments is None else list(arguments))
    wanted = list(cases(given.first_seed, given.seeds))
    rows = run_all(wanted, given.measured, given.minutes)
    asked = len(wanted) + (len(PLANTED) if given.measured else 0)
    text = report(rows, asked, given.first_seed)
    print(text)
    if given.misses:
        for row in filter(missed, rows):
            print(json.dumps({k: v for k, v in row.items() if k != "code"}))
    if given.write:
        write(given.write, text)


if __name__ == "__main__":
    main()
