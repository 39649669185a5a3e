"""The surveyed targets that a spec names: a drive is laid beside them instead of they beside it.

`log: {files: [...]}` names them: a survey of targets in a file of its own, else the targets of the
log itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from syncline_design.diagnosis.system import measured, own_files
from syncline_design.effects.record import Array
from syncline_design.logs.columns import TARGET, known_names, si_columns
from syncline_design.logs.places import geodetic_to_ned
from syncline_design.logs.sources import opened
from syncline_design.logs.surveys import Survey, is_survey, survey_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.wanted import PlanError
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput


@dataclass(frozen=True, eq=False)
class FixedTargets:
    """Targets by name, their places (m, 3) [m] NED, and the files that hold them."""

    names: tuple[str, ...]
    places_m: Array
    files: tuple[str, ...]


def fixed_targets(case: Case) -> FixedTargets | None:
    """The targets that the spec's log files hold; None where they hold none.

    Raises BadInput for a survey or a log that cannot be read.
    """
    if case.spec.log is None or not case.spec.log.files:
        return None
    if case.stages[-1].role("ranging") is None:
        return None  # nothing is aimed at
    files = own_files(case)
    surveys = list(_surveys(case, files))
    return _of_surveys(case, surveys) if surveys else _of_log(case, files)


def _surveys(case: Case, files: Sequence[Path]) -> Iterator[Survey]:
    assert case.spec.log is not None
    known = known_names([stage.choice.name for stage in case.stages])
    for path in files:
        try:
            source = opened(path)
        except BadInput:
            continue  # no table: a recording, which `measured` reads
        found = si_columns(source.header, case.spec.log.columns, known)
        if is_survey(found):
            yield survey_of(source, found)


def _of_surveys(case: Case, surveys: Sequence[Survey]) -> FixedTargets:
    names: list[str] = []
    places = []
    for one in surveys:
        own, place = one.places
        names += own
        places.append(place if TARGET[0] in one.columns else _local(case, one.path, place))
    return FixedTargets(
        tuple(names), np.concatenate(places), tuple(one.path.name for one in surveys)
    )


def _local(case: Case, path: Path, place: Array) -> Array:
    """Places on the globe in the local frame of the spec's origin."""
    origin = case.spec.log.origin if case.spec.log else None
    if origin is None:
        raise PlanError(
            f"{path.name}: its targets are on the globe, and the drive is in a local frame; "
            "expected log: {origin: [47.3 deg, 8.55 deg, 460 m]} in the spec"
        )
    return geodetic_to_ned(place, np.array([float(v) for v in origin]))


def _of_log(case: Case, files: Sequence[Path]) -> FixedTargets | None:
    """The targets of a log of ranges to them."""
    log = measured(case, files).log
    if log.kind != "georeference":
        return None
    known = np.all(np.isfinite(log.truth_m), axis=1)
    places = np.unique(log.truth_m[known], axis=0)
    if not len(places):
        return None
    names = tuple(str(k + 1) for k in range(len(places)))
    return FixedTargets(names, places, tuple(path.name for path in files))
