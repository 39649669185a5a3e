"""Drives that were flown, held against what a plan was asked for.

Every drive tells of the same values of the build, so that what several of them say of all unknowns
adds up: I = I_1 + I_2 + ... of the information matrices (`information`), each with its own motion,
targets and rate.  Files that are no log by themselves are parts of one drive.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from syncline_design.diagnosis.checks import log_checks
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.drives import World
from syncline_design.planning.information import fisher
from syncline_design.planning.setup import Setup
from syncline_design.planning.wanted import PlanError
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput


@dataclass(frozen=True, eq=False)
class FlownDrives:
    """Drives together: their files, how long they last and how many rows they have, all that they
    tell of the unknowns (P, P), and where one contradicts itself or its platform."""

    files: tuple[str, ...]
    duration_s: float
    rows: int
    information: Array
    cautions: tuple[str, ...]


def flown_drives(setup: Setup, files: Sequence[Path]) -> FlownDrives:
    """Read drives and add up what they tell.  BadInput or PlanError for what cannot be used."""
    drives = _drives(setup.case, files)
    for drive in drives:
        if len(drive.system.stages) != len(setup.system.stages):
            raise PlanError("--flown: the log holds not all stages of the spec")
    _demand_apart(drives)
    own = replace(setup.world, rate_hz=setup.world.computed_hz)
    return FlownDrives(
        tuple(path.name for path in files),
        float(sum(drive.log.duration_s for drive in drives)),
        sum(len(drive.log) for drive in drives),
        np.sum([_told(own, drive) for drive in drives], axis=0),
        tuple(_cautions(drives)),
    )


def _drives(case: Case, files: Sequence[Path]) -> list[Measured]:
    """A drive a file where each is a log by itself; else all are parts of one."""
    if len(files) > 1:
        try:
            return [measured(case, [path]) for path in files]
        except BadInput:  # what is wrong with a part, reading all together tells
            pass
    return [measured(case, files)]


def _demand_apart(drives: Sequence[Measured]) -> None:
    """Refuse a drive that is given twice: it would tell what it tells but once."""
    for k, one in enumerate(drives):
        for other in drives[:k]:
            if _is_same(one, other):
                raise PlanError(
                    f"--flown: {one.files[0]} is the drive of {other.files[0]}; expected each "
                    "drive once, for the second says nothing new"
                )


def _is_same(one: Measured, other: Measured) -> bool:
    """Whether two logs have the same stamps, truth and attitudes in every row."""
    pairs = [(own.log.time_s, own.log.truth_m, own.log.stages[0].euler_rad) for own in (one, other)]
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(*pairs, strict=True))


def _told(world: World, drive: Measured) -> Array:
    """Information of one drive about all unknowns, (P, P)."""
    view = scene(drive.system, drive.log, drive.known)
    structure, level = world.noise(view)
    return fisher(structure, level, world.columns(view))


def _cautions(drives: Sequence[Measured]) -> Iterator[str]:
    for drive in drives:
        which = f"{drive.files[0]}: " if len(drives) > 1 else ""
        view = scene(drive.system, drive.log, drive.known)
        yield from (f"{which}{one.message}" for one in log_checks(view))
