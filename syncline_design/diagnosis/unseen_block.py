"""The gap on a block of the log that nothing has seen.

Blocks held out of a fit of the parameters were seen all the same: by the choice of the effects, the
size of the noise, the places of steps.  Here all of that is done again on the rest of the log, and
what comes out is held against the block.  The search starts from what the whole log showed, which
saves most of its time: each of these effects has to stand by the rest alone, or goes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.fitting import WINDOW, Data, windows
from syncline_design.diagnosis.gap import PURGE_S, PURGE_SHARE, Held, closed_share
from syncline_design.diagnosis.gap_result import HeldOut, UnseenBlock
from syncline_design.diagnosis.noise import clipped, spec_bounds
from syncline_design.diagnosis.search import Search, SearchResult
from syncline_design.logs.log import Log

FROM, TO = 0.6, 0.8  # of the rows: which block
LEAST_ROWS = 300  # of a log that is long enough to give a block away
MOST_ROWS = 1500  # of the rest, windows spread over it

Rows = NDArray[np.int64]


def unseen_block(
    data: Data, result: SearchResult, start: Callable[[Log], Search]
) -> UnseenBlock | None:
    """The block before and after what was found without it; None where nothing moves the mean.

    start: makes a search over a log.
    """
    if not result.model.acting or len(data.view) < LEAST_ROWS:
        return None
    rest, held = _split(data.view.log)
    kept = rest[windows(len(rest), MOST_ROWS, WINDOW)]
    search = start(data.view.log.rows(kept))
    if _shape(search.data) != _shape(data):
        return None
    model = search.confirmed(result.model)
    part = Held(data, held, clipped(model.level, spec_bounds(data.structure)), model.level)
    before = part.before(data.error(())[held]).fit()
    after = part.after(data.error(model.acting)[held]).fit()
    expected = part.noise_only().fit()
    scores = HeldOut(before, after, expected, expected)
    time_s = data.view.log.time_s[held]
    return UnseenBlock(
        from_s=float(time_s[0]),
        to_s=float(time_s[-1]),
        rows=len(held),
        found=tuple(f"{name} ({sensor})" for name, sensor, _ in model.labels),
        before=before,
        after=after,
        expected_rms_m=expected.rms_m,
        closed_fraction=closed_share(scores),
    )


def _split(log: Log) -> tuple[Rows, Rows]:
    """Rows of the rest, with a gap on both sides of the block; rows of the block."""
    first, last = (int(share * len(log)) for share in (FROM, TO))
    time_s = log.time_s
    start, end = time_s[first], time_s[last - 1]
    purge = min(PURGE_S, PURGE_SHARE * float(end - start))
    rest = np.flatnonzero((time_s <= start - purge) | (time_s >= end + purge))
    return rest, np.flatnonzero((time_s >= start) & (time_s <= end))


def _shape(data: Data) -> tuple[Sequence[object], ...]:
    """What a noise level has to fit."""
    structure = data.structure
    return (
        [part.sensor for part in structure.white],
        [(part.sensor, part.columns) for part in structure.slow],
        [part.key for part in structure.directed],
    )
