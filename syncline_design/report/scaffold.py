"""`init`: a starter spec and study that run, with their schemas beside them for the editor."""

from __future__ import annotations

import os
from pathlib import Path

from syncline_design.machine.result_files import OutputError, write_files
from syncline_design.report.schema import schema_text
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw

SPEC_NAME = "system.yaml"
SCHEMA_NAME = "syncline-spec.schema.json"
STUDY_NAME = "studies/distance.yaml"
STUDY_SCHEMA_NAME = "syncline-study.schema.json"

STARTER = f"""\
# yaml-language-server: $schema=./{SCHEMA_NAME}
#
# A system spec. Check it with:  syncline-design check {SPEC_NAME}
# Every figure is NUMBER UNIT (10 ns, 77.9 deg/s, 400 EUR); angles say deg or rad.
syncline: 1                          # format version
name: My first mapping system

# What the design has to meet. Each line gets a verdict of its own.
requirements:
  - {{id: ACC-1,  kind: accuracy, limit: 0.30 m}}      # sensor errors plus synchronisation error
  - {{id: SYNC-1, kind: sync, limit: 1.0}}             # timestamp error / critical one stays below
  - {{id: COST-1, kind: cost, limit: 80000 EUR}}

# One stage per vehicle that georeferences something.
stages:
  - name: uav
    platform: {{use: uav_fixed_wing, distance: 100 m}} # a catalog platform, single keys overridden
    position:
      candidates: [ublox_f9p_pvt, ublox_f9p_rtk]      # open: the cheapest that works is chosen
      lever_arm: [0.30 m, 0 m, -0.20 m]               # forward, right, down
    attitude:
      candidates: {{modality: attitude, type: ins}}     # a query: every INS of the catalog
    ranging:
      candidates: [velodyne_hdl32e, riegl_vux1uav]
      lever_arm: [0.05 m, 0 m, 0.12 m]
      # pinned instead of open:
      # sensor: riegl_vux1uav
      # primitive: pps
      # timestamping: hardware

# How measurements may get their timestamps; also per stage or per role.
timestamping: {{candidates: [hardware, gpio, arrival]}}

coverage_factor: 3                   # k of a normal timing error's bound, |mean| + k std
objective: cost                      # or mass, power, error

# Your own sensors, platforms and methods, in files beside this one:
# catalogs: [my_sensors.yaml]
"""

STUDY = f"""\
# yaml-language-server: $schema=../{STUDY_SCHEMA_NAME}
#
# A trade study: the spec over every combination of these values. Run it with:
#   syncline-design study {STUDY_NAME} --output html:study.html
study: 1                             # format version
name: Distance against accuracy
base: [../{SPEC_NAME}]

# Key paths name places of the spec; a list, or a range such as
# {{low: 40 m, high: 120 m, count: 5}}, scale: log for equal ratios.
grid:
  "stages[uav].distance": [40 m, 70 m, 100 m]
  "requirements[ACC-1].limit": [0.1 m, 0.2 m, 0.3 m]

# Instead of every combination, a sample:
# sample:
#   count: 50
#   over: {{"stages[uav].v_max": 10 m/s .. 30 m/s}}

# The study passes when all cases meet, any case meets, or each case is decided.
meets_when: decided
"""


def init_project(directory: str | Path) -> tuple[Path, ...]:
    """Write the starter spec, study and schemas into a folder; nothing is ever overwritten."""
    folder = Path(directory)
    contents = {
        folder / SPEC_NAME: STARTER,
        folder / SCHEMA_NAME: schema_text("spec"),
        folder / STUDY_NAME: STUDY,
        folder / STUDY_SCHEMA_NAME: schema_text("study"),
    }
    taken = [path for path in contents if os.path.lexists(path)]
    if taken:
        raise BadInput(tuple(_refused(path, "this file is there already") for path in taken))
    try:
        for path in contents:
            path.parent.mkdir(parents=True, exist_ok=True)
        write_files([(path, text.encode("utf-8")) for path, text in contents.items()])
    except OutputError as error:
        raise BadInput((_refused(folder, str(error)),)) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise BadInput((_refused(folder, f"cannot write here: {reason}"),)) from None
    return tuple(contents)


def _refused(path: Path, reason: str) -> Flaw:
    return Flaw(str(path), 0, 0, "", reason, hint="choose another folder")
