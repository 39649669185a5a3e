"""Writes the example of the documentation: `python -m tests.world.example` from the checkout."""

from __future__ import annotations

from pathlib import Path

from tests.world import hidden, make_log, scenario
from tests.world.worldlog import spec_text

SEED = 20
REPAIRED_SEED = 21
FOLDER = Path(__file__).parents[2] / "examples"
COMMENT = """\
# A multirotor that surveys along lines over ground targets: RTK GNSS, INS and laser scanner.
# The design meets its 0.30 m on paper.  hidden_latency.csv is what it logged over targets that
# were surveyed beforehand: 300 s at 10 Hz.
#   syncline-design check examples/hidden_latency.yaml
#   syncline-design diagnose examples/hidden_latency.yaml examples/hidden_latency.csv
"""


def write(folder: Path = FOLDER) -> None:
    run = scenario("multirotor_lines", SEED, 300.0, 10.0)
    log = make_log(run, (hidden("latency", "position", latency_s=0.087),))
    log.to_csv(folder / "hidden_latency.csv", coarser=1)
    (folder / "hidden_latency.yaml").write_text(
        COMMENT + spec_text(run, limit_m=0.30), encoding="utf-8"
    )
    # the same vehicle on another day, with nothing hidden
    repaired = scenario("multirotor_lines", REPAIRED_SEED, 300.0, 5.0)
    make_log(repaired).to_csv(folder / "hidden_latency_repaired.csv", coarser=1)


if __name__ == "__main__":
    write()
