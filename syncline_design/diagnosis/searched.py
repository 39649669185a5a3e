"""A log searched for what is missing: gross faults undone, the model settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from syncline_design.diagnosis.axes import still_axes_apart, varying_axes, without_still_axes
from syncline_design.diagnosis.candidates import (
    candidates,
    directed_parts,
    plain_signatures,
)
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import WINDOW, Data, data_of, windows
from syncline_design.diagnosis.free_frame import with_free_frame
from syncline_design.diagnosis.gross import Gross, gross_faults, whole_seconds
from syncline_design.diagnosis.gross_trials import usual_size
from syncline_design.diagnosis.hanging_rows import Hanging, without_hanging
from syncline_design.diagnosis.late_part import is_far_off, late_part
from syncline_design.diagnosis.mending import mended
from syncline_design.diagnosis.motion_columns import (
    columns_of,
    contradictions,
    is_excusable,
    with_slopes,
)
from syncline_design.diagnosis.result import (
    Check,
)
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.search import Search, SearchResult, start_search
from syncline_design.diagnosis.settings import DiagnosisSettings, SearchProgress, silent
from syncline_design.diagnosis.shared_stamps import with_shared_stamps
from syncline_design.diagnosis.shown_noise import with_shown_noise
from syncline_design.diagnosis.spans import span_of
from syncline_design.diagnosis.system import Measured
from syncline_design.diagnosis.untouched import untouched_error
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass

MOST_ROWS = 20_000  # of a longer log, windows spread over it are worked on


@dataclass(frozen=True, slots=True)
class SearchedLog:
    """A log that was searched: gross faults undone, the model settled.

    replaced: columns of motion that contradict the poses, whose slopes were taken instead.
    hanging: devices that hang in it; inputs are without these rows.
    """

    inputs: Measured
    faults: tuple[Gross, ...]
    data: Data
    search: Search
    result: SearchResult
    replaced: tuple[Check, ...] = ()
    hanging: Hanging = field(default_factory=Hanging)

    @property
    def found_any(self) -> bool:
        """Whether the log is anything but what the spec says."""
        return bool(self.result.model.acting or self.result.model.opened)

    @property
    def untouched(self) -> Array | None:
        """The error before the gross faults were undone, where there were any."""
        return untouched_error(self.inputs, self.data) if self.faults else None


def examined(
    inputs: Measured, settings: DiagnosisSettings, progress: SearchProgress = silent
) -> SearchedLog:
    """Leave out what is no reading of its time, undo what is grossly wrong with a log, and look for
    what is missing."""
    less, hanging = without_hanging(inputs, settings.exclude_effects)
    return replace(_examined(less, settings, progress), hanging=hanging)


def _examined(
    inputs: Measured, settings: DiagnosisSettings, progress: SearchProgress
) -> SearchedLog:
    progress("looking for gross faults", 0.05)
    faults, log = gross_faults(
        inputs.system,
        inputs.log,
        inputs.known,
        settings.exclude_effects,
        inputs.reread,
    )
    few, exclude = _in_windows(log), settings.exclude_effects
    early = is_far_off(inputs, few)  # where all of a search would be for nothing
    late = late_part(inputs, log, few, exclude) if early else None
    if late is None:
        one = _settled(inputs, faults, log, settings, progress)
        if early or not one.found_any:
            return one
        late = late_part(inputs, log, few, exclude)
        if late is None:
            return one
    return _settled(inputs, (*faults, late.fault), late.log, settings, progress)


def _settled(
    inputs: Measured,
    faults: tuple[Gross, ...],
    log: Log,
    settings: DiagnosisSettings,
    progress: SearchProgress,
) -> SearchedLog:
    """Look for what is missing, beside the columns of motion that the poses bear out."""
    view = scene(inputs.system, _in_windows(log), inputs.known)
    wrong = () if is_excusable(view) else contradictions(view)

    def asked(wrong: tuple[Check, ...]) -> SearchedLog:
        sloped = with_slopes(log, wrong)
        return replace(_beside(inputs, faults, sloped, settings, progress), replaced=wrong)

    one = asked(wrong)
    found = contradictions(view, one.result.model.acting)
    return one if columns_of(found) == columns_of(wrong) else asked(found)


def _beside(
    inputs: Measured,
    faults: tuple[Gross, ...],
    log: Log,
    settings: DiagnosisSettings,
    progress: SearchProgress,
) -> SearchedLog:
    """Look for what is missing in a log; positions that are off by whole seconds are put back."""
    told_apart = _with_shared_stamps(inputs, log)
    data, search, result = _searched(inputs, told_apart, settings, progress)
    slip = slip_of(result)
    if slip is not None and slip.effect.name not in settings.exclude_effects:
        before = usual_size(result.base.error)
        faults = (*faults, Gross(slip, before / max(usual_size(result.model.error), 1e-300)))
        log = _with_shared_stamps(inputs, mended(log, slip, inputs.reread))
        data, search, result = _searched(inputs, log, settings, progress)
    return SearchedLog(inputs, faults, data, search, result)


def _with_shared_stamps(inputs: Measured, log: Log) -> Log:
    """The log, with what it tells of whose stamps its columns of motion carry."""
    return with_shared_stamps(log, scene(inputs.system, _in_windows(log), inputs.known))


def _searched(
    inputs: Measured, log: Log, settings: DiagnosisSettings, progress: SearchProgress
) -> tuple[Data, Search, SearchResult]:
    """The search over one log; of a long one, over windows of it."""
    search = started(inputs, _in_windows(log), settings, progress)
    result = search.run()
    return search.data, search, result


def _in_windows(log: Log) -> Log:
    return log.rows(windows(len(log), MOST_ROWS, WINDOW))


def started(
    inputs: Measured, log: Log, settings: DiagnosisSettings, progress: SearchProgress = silent
) -> Search:
    """A search over a log, ready to run."""
    data = prepared(inputs, log, settings.exclude_effects)
    progress("searching", 0.15)
    return start_search(data, settings, lambda done: progress("searching", 0.15 + 0.5 * done))


def prepared(inputs: Measured, log: Log, exclude: Sequence[str] = ()) -> Data:
    """A log beside its system, ready for fitting: what its own courses show of slow noise too."""
    plain = structure_of(scene(inputs.system, log, inputs.known))
    log = without_still_axes(inputs.system, log, inputs.known, plain)
    view = scene(inputs.system, log, inputs.known)
    found = candidates(view, exclude)
    parts = directed_parts(view, found)
    structure = structure_of(view, parts)
    structure = still_axes_apart(structure, varying_axes(view.error(), structure))
    shown = with_shown_noise(data_of(view, structure), plain_signatures(view, found))
    return with_free_frame(shown)


def slip_of(result: SearchResult) -> Acting | None:
    """A position latency of whole seconds: the rows are paired anew, which is more exact.

    None of a stretch: put back in all of the log, all other rows would be as much off.
    """
    at = 0
    for one in result.model.acting:
        if one.effect.slopes() and span_of(one.effect) is None:
            spread = float(np.sqrt(max(result.model.covariance[at, at], 0.0)))
            slip = whole_seconds(one, spread)
            if slip is not None:
                return slip
        at += len(one.effect.slopes())
    return None
