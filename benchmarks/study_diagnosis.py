"""Study of `diagnose` on logs from the hidden world: naming rate, false alarms, honesty.

    python -m benchmarks.study_diagnosis [--quick] [--seeds N] [--minutes M] [--write docs/study.md]

Two processes; every finished case is kept in out/, so a stopped study goes on where it was, for as
long as the version and the code of the diagnosis are the same.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import syncline_design
from benchmarks import study_cases
from benchmarks.study_cases import Case
from benchmarks.study_ideal import ideal_naming
from benchmarks.study_scoring import by_effect, misses, score, table
from tests.world import WorldLog, make_log

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "out" / "study_diagnosis.jsonl"
Row = dict[str, Any]


def digest(*patterns: str) -> str:
    """Digest of the code that the answers depend on."""
    whole = hashlib.sha256()
    for pattern in patterns:
        files = sorted(ROOT.glob(pattern))
        if not files:
            raise FileNotFoundError(f"no code at {pattern}: answers would be kept over changes")
        for file in files:
            whole.update(file.read_bytes())
    return whole.hexdigest()[:12]


def digests() -> dict[str, str]:
    """Of what makes the logs, and of everything an answer and its score depend on."""
    logs = ("tests/world/*.py", "benchmarks/study_cases.py", "benchmarks/study_ideal.py")
    rest = ("syncline_design/diagnosis/*.py", "syncline_design/effects/*.py")
    return {
        "world": digest(*logs),
        "code": digest(*logs, *rest, "benchmarks/study_scoring.py"),
    }


def ideal_of(case: Case, log: WorldLog, known: float | None) -> float | None:
    """How often the best possible reader names a single effect; costly, so computed once."""
    if known is not None or len(log.truth) != 1 or case.times_bound is None or case.exclude:
        return known
    return ideal_naming(log, log.truth[0])


def solve(case: Case, ideal: float | None = None) -> Row:
    """Make the log, diagnose it, score it; a failure of the diagnosis is a result too."""
    from syncline_design.diagnosis import DiagnosisSettings, diagnose

    base = {"id": case.id, "group": case.group, "label": case.label, "seed": case.seed}
    run = case.run()
    log = make_log(run, case.sized_effects(run), case.noise)
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        data = log.to_csv(Path(folder) / "log.csv")
        made = time.perf_counter()
        try:
            settings = DiagnosisSettings(seed=case.seed, exclude_effects=case.exclude)
            document = diagnose(spec, [data], settings).to_json()
        except Exception as error:
            return {**base, "error": f"{type(error).__name__}: {error}"}
    seconds = time.perf_counter() - made
    result = score(log, document)
    extra = {"ideal": ideal_of(case, log, ideal), "seconds": seconds}
    return {**base, **result, **extra}


def kept_rows(code: dict[str, str]) -> tuple[dict[str, Row], dict[str, float]]:
    """Rows of earlier runs of the same code, and yardsticks of earlier runs of the same world.

    A torn last line is left out.
    """
    rows: dict[str, Row] = {}
    ideals: dict[str, float] = {}
    for line in KEPT.read_text(encoding="utf-8").splitlines() if KEPT.exists() else []:
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if row["code"] == code["code"]:
            rows[row["id"]] = row
        if row["world"] == code["world"] and row.get("ideal") is not None:
            ideals[row["id"]] = row["ideal"]
    return rows, ideals


def run_all(cases: list[Case], processes: int, minutes: float | None) -> list[Row]:
    """Solve every case not yet kept, until the minutes are used up."""
    code = digests()
    rows, ideals = kept_rows(code)
    open_cases = iter([case for case in cases if case.id not in rows])
    deadline = None if minutes is None else time.monotonic() + 60.0 * minutes
    KEPT.parent.mkdir(exist_ok=True)
    with KEPT.open("a", encoding="utf-8") as file, ProcessPoolExecutor(processes) as pool:
        running: set[Future[Row]] = set()
        for case in _until(open_cases, deadline):
            running.add(pool.submit(solve, case, ideals.get(case.id)))
            if len(running) >= processes:
                running = _collect(running, rows, file, code)
        while running:
            running = _collect(running, rows, file, code)
    return [rows[case.id] for case in cases if case.id in rows]


def _until(cases: Iterable[Case], deadline: float | None) -> Iterable[Case]:
    for case in cases:
        if deadline is not None and time.monotonic() > deadline:
            return
        yield case


def _collect(
    running: set[Future[Row]], rows: dict[str, Row], file: Any, code: dict[str, str]
) -> set[Future[Row]]:
    done, left = wait(running, return_when=FIRST_COMPLETED)
    for future in done:
        row = {**future.result(), **code}
        rows[row["id"]] = row
        file.write(json.dumps(row) + "\n")
        file.flush()
        answer = row.get("error") or f"{row['verdict']} {row['found']}"
        print(f"{len(rows):4d} {row['id']}: {answer}", file=sys.stderr)
    return left


def report(rows: list[Row], planned: int, seeds: str) -> str:
    """The study in Markdown: head, table, lines per effect."""
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    failed = sum("error" in row for row in rows)
    mean = sum(seconds) / max(len(seconds), 1)
    head = (
        f"syncline-design {syncline_design.__version__}, {datetime.date.today().isoformat()}, "
        f"{seeds}; {len(rows)} of {planned} logs, {failed} ended in an error, "
        f"{mean:.1f} s per log on one core.\n"
    )
    parts = [head, table(rows)]
    for group in ("one effect at 10 times its bound", "one effect at 3 times its bound"):
        if any(row["group"] == group for row in rows):
            parts += [f"\n### {group[0].upper()}{group[1:]}\n", by_effect(rows, group)]
    return "\n".join(parts) + "\n"


def write_between_marks(path: Path, text: str) -> None:
    """Put the tables between the study's marks of a page, which keeps its words."""
    start, end = "<!-- study: start -->", "<!-- study: end -->"
    page = path.read_text(encoding="utf-8")
    before, rest = page.split(start, 1)
    after = rest.split(end, 1)[1]
    path.write_text(f"{before}{start}\n{text}{end}{after}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", default="", help="cases whose id contains this text")
    parser.add_argument("--misses", action="store_true", help="list every wrong answer")
    parser.add_argument("--write", type=Path, help="page whose marked part becomes the table")
    given = parser.parse_args()
    cases = study_cases.quick() if given.quick else study_cases.full(given.seeds, given.first_seed)
    cases = [case for case in cases if given.only in case.id]
    rows = run_all(cases, given.processes, given.minutes)
    numbers = sorted({case.seed for case in cases})
    text = report(rows, len(cases), f"seeds {numbers[0]} to {numbers[-1]}")
    print(text)
    if given.misses:
        print(misses(rows))
    if given.write:
        write_between_marks(given.write, text)


if __name__ == "__main__":
    main()
