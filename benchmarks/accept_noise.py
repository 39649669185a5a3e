"""How often the intervals of `accept`'s noise rows hold the truth, and how wide they are.

    python -m benchmarks.accept_noise [--systems 200] [--seed 0] [--whole] [--write docs/accept.md]

Systems as they are built: the vehicles and motions of `benchmarks/accept_world.py`, the noise of
each device between 1 / 1.4 and 1.4 times its figure by chance, 100 s at 5 Hz.  Their noise is
fitted as `accept` fits it where it finds nothing else; with --whole after the search for effects.
"""

from __future__ import annotations

import argparse
import math
import os
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.accept_world import MOTIONS, VEHICLES, Drive, Fault, write
from benchmarks.docs_tables import put
from benchmarks.study_scoring import proportion
from syncline_design import __version__

BEGIN, END = "<!-- accept noise: begin -->", "<!-- accept noise: end -->"
KINDS = {
    "white": "white", "slow": "0.36 of the variance of 25 s", "quick": "0.5 of it of 5 s",
    "tails": "tails (Student's t of 5)", "uneven": "0.75 or 1.5 times, by turns",
}  # fmt: skip
LENGTH_S, RATE_HZ, MOST = 100.0, 5.0, 1.4


@dataclass(frozen=True)
class Held:
    """Whether an interval holds the truth; its width and the value's error over that."""

    device: str
    inside: bool
    width: float
    off: float


def systems(kind: str, count: int, seed: int, whole: bool) -> Iterator[Held]:
    """Every reading's interval of so many systems."""
    from syncline_design.diagnosis.fitting import fit
    from syncline_design.diagnosis.noise_split import factors
    from syncline_design.diagnosis.searched import examined, prepared
    from syncline_design.diagnosis.settings import DiagnosisSettings
    from syncline_design.diagnosis.system import measured
    from syncline_design.spec.load import load

    source = np.random.default_rng([seed, 23])
    vehicles = tuple(VEHICLES)
    for k in range(count):
        place, angle, length, bearing = np.exp(source.uniform(-1.0, 1.0, 4) * math.log(MOST))
        times = {"position": place, "roll": angle, "pitch": angle, "yaw": angle,
                 "range": length, "bearing": bearing}  # fmt: skip
        drive = Drive(vehicles[k % 4], MOTIONS[(k // 4 + k) % 3], kind, 70000 + 1000 * seed + k,
                      LENGTH_S, RATE_HZ)  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            spec, log = write(drive, Fault(times=times), Path(folder))
            inputs = measured(load(spec), [log])
            if whole:
                one = examined(inputs, DiagnosisSettings(seed=0))
                found = factors(one.data, one.result.model, one.search.unlike or ())
            else:
                data = prepared(inputs, inputs.log)
                found = factors(data, fit(data))
        for name, own in found.items():
            role = name.partition("/")[2]
            for part in own.parts:
                device = role if role != "ranging" else part.readings[0]
                truth = {"position": place, "attitude": angle, "range": length}.get(device, bearing)
                inside = part.low <= truth <= part.high
                yield Held(
                    "bearings" if truth is bearing else device, bool(inside),
                    float((part.high - part.low) / truth), float(part.value / truth - 1.0),
                )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--write", type=Path)
    asked = parser.parse_args()
    date = datetime.now(UTC).date().isoformat()
    lines = [
        f"Measured on {date} (version {__version__}, seed {asked.seed}; "
        f"`benchmarks/accept_noise.py`): {asked.systems} systems as built for every noise.",
        "",
        "| noise | intervals that hold the truth | position | attitude | range | bearings "
        "| median width, of the true figure | typical error |",
        "|---|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for kind in asked.kinds.split(","):
        by: dict[str, list[Held]] = defaultdict(list)
        for one in systems(kind, asked.systems, asked.seed, asked.whole):
            by[one.device].append(one)
        every = [one for own in by.values() for one in own]
        cells = [KINDS[kind], proportion([one.inside for one in every])]
        cells += [f"{np.mean([one.inside for one in by[device]]):.1%}".replace("%", " %")
                  for device in ("position", "attitude", "range", "bearings")]  # fmt: skip
        cells.append(f"{np.median([one.width for one in every]):.2f}")
        cells.append(f"{math.sqrt(np.mean([one.off**2 for one in every])):.2f}")
        lines.append("| " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    text = "\n".join(lines)
    print(text)
    if asked.write is not None:
        put(asked.write, f"{text}\n", BEGIN, END)


if __name__ == "__main__":
    main()
