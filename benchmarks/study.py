"""What a study costs beyond the checks themselves: overhead, two processes, many cases, memory.

    python benchmarks/study.py [--cases N] [--folder DIR]

Prints, on this machine:
- the time of one check by itself (load the patched spec, check it), summed over a sample;
- overhead per case in one process: (time of the study - sum of its checks) / cases;
- two processes against one on the same cases;
- N cases on two processes against the sum of the checks on the same two cores;
- the same in processor time, which other work on the machine does not spoil;
- memory of the parent while the number of cases grows.
The sum of the checks is taken in the same process and over the same cases, without the study
around them; for two cores it is measured in two processes at once, so that both sides share the
machine in the same way.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import shutil
import tempfile
import time
from pathlib import Path

from syncline_design.studies import StudySettings, load_study, run_study
from syncline_design.studies.case import CaseSettings
from syncline_design.studies.loading import Study
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = """\
syncline: 1
name: UAV mapping
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.50 m}
  - {id: COST-1, kind: cost, limit: 100000 EUR}
stages:
  - name: uav
    platform: uav_fixed_wing
    position: {sensor: ublox_f9p_rtk, primitive: pps}
    attitude: {candidates: [sbg_apogee, sbg_ellipse]}
    ranging: {sensor: velodyne_hdl32e, primitive: pps}
timestamping: {candidates: [gpio]}
"""
STUDY = """\
study: 1
name: Benchmark
base: spec.yaml
sample:
  count: {count}
  over: {{"stages[uav].distance": 20 m .. 60 m, "requirements[ACC-1].limit": 0.5 m .. 1 m}}
"""


def written(folder: Path, count: int) -> Path:
    """A study of `count` cases; no case is infeasible, so all cost about the same."""
    (folder / "spec.yaml").write_text(SPEC, encoding="utf-8")
    path = folder / f"study_{count}.yaml"
    path.write_text(STUDY.format(count=count), encoding="utf-8")
    return path


def checks_alone_s(study: Study, indices: range) -> float:
    """Seconds for the checks of these cases, with nothing of a study around them."""
    settings = CheckSettings(monte_carlo=False, today=CaseSettings.now(0, None).today)
    start = time.perf_counter()
    for index in indices:
        place, chosen = study.case(index)
        check_loaded(study.bases[place].load(chosen), settings)
    return time.perf_counter() - start


def _half(path: Path, indices: range, ready: object, out: object) -> None:
    study = load_study(path)
    checks_alone_s(study, indices[:5])  # imports and first-time work are not part of it
    ready.wait()  # type: ignore[attr-defined]
    out.put(checks_alone_s(study, indices))  # type: ignore[attr-defined]


def checks_on_two_cores_s(path: Path, count: int) -> float:
    """Wall time of all checks by themselves, half of them in each of two processes at once."""
    context = multiprocessing.get_context("spawn")
    ready, out = context.Barrier(2), context.Queue()
    parts = (range(0, count, 2), range(1, count, 2))
    workers = [context.Process(target=_half, args=(path, part, ready, out)) for part in parts]
    for worker in workers:
        worker.start()
    times = [out.get() for _ in workers]
    for worker in workers:
        worker.join()
    return max(times)


def study_s(path: Path, workers: int, store: Path) -> float:
    """Wall time of the study from an empty store."""
    shutil.rmtree(store, ignore_errors=True)
    return run_study(path, StudySettings(workers=workers, store=store)).elapsed_s


def processor_s() -> float:
    """Processor time of this process and of its ended children."""
    uses = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(use.ru_utime + use.ru_stime for use in uses)


def memory_mib() -> float:
    """Largest resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--few", type=int, default=400)
    parser.add_argument("--folder", type=Path)
    chosen = parser.parse_args()
    folder = Path(tempfile.mkdtemp(dir=chosen.folder))
    try:
        _measure(folder, chosen.few, chosen.cases)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _measure(folder: Path, few: int, many: int) -> None:
    store = folder / "store"
    small = written(folder, few)
    study = load_study(small)
    checks_alone_s(study, range(20))
    began = processor_s()
    alone = checks_alone_s(study, range(few))
    per_check = (processor_s() - began) / few
    print(f"one check by itself: {1e3 * alone / few:.2f} ms")
    began = processor_s()
    single = study_s(small, 1, store)
    extra = (processor_s() - began) / few - per_check
    print(f"overhead per case in processor time: {1e3 * extra:.2f} ms (bound 3 ms)")
    print(f"overhead per case in one process: {1e3 * (single - alone) / few:.2f} ms (bound 3 ms)")
    double = study_s(small, 2, store)
    print(f"{few} cases, two processes with their start: {single / double:.2f} x one")
    large = written(folder, many)
    began = processor_s()
    fair = checks_on_two_cores_s(large, many)
    fair_spent = processor_s() - began
    base = memory_mib()
    began = processor_s()
    whole = study_s(large, 2, store)
    spent = processor_s() - began
    print(f"{many} cases on two processes: {whole:.1f} s, the checks alone {fair:.1f} s")
    print(f"ratio: {whole / fair:.3f} (bound 1.15)")
    print(f"ratio in processor time: {spent / fair_spent:.3f} (bound 1.15)")
    print(f"against one process: {alone / few * many / whole:.2f} x (bound 1.7)")
    load = os.getloadavg()[0]
    print(f"load average {load:.1f} on {os.cpu_count()} cores: wall times hold when it is near 2")
    print(f"memory of the parent: {base:.0f} MiB before, {memory_mib():.0f} MiB after {many} cases")


if __name__ == "__main__":
    main()
