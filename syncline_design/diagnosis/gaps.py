"""The gap of a diagnosis: after each of its steps, on blocks, on a regime, with a placebo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.gap import block_folds, gap, regime_fold
from syncline_design.diagnosis.gap_result import Gap, WholeGap
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.search import Search, SearchResult
from syncline_design.effects.record import Array


def gap_steps(
    data: Data, result: SearchResult, faults: Sequence[Gross], untouched: Array | None
) -> tuple[Gap, ...]:
    """The gap after each addition, gross faults undone first."""
    folds = block_folds(data)
    labelled: list[tuple[tuple[tuple[str, str, int], ...], Model]] = [
        ((label,), model) for label, model in result.final.stairs
    ]
    if untouched is not None:
        labelled.insert(0, (tuple(one.acting.label for one in faults), result.base))
    found = [(labels, gap(data, model, folds, None, untouched)) for labels, model in labelled]
    return tuple(
        replace(one, added=", ".join(f"{name} ({sensor})" for name, sensor, _ in labels))
        for labels, one in found
        if one.held_out is not None
    )


def whole_gap(
    data: Data, search: Search, result: SearchResult, untouched: Array | None
) -> WholeGap:
    """On blocks of the log, on its fastest part, and with a placebo."""
    blocks = gap(data, result.model, block_folds(data), None, untouched)
    name, fold = regime_fold(data)
    return WholeGap(
        held_out=blocks.held_out,
        expected_rms_m=blocks.expected_rms_m,
        closed_fraction=blocks.closed_fraction,
        nll_saved_per_sample=blocks.nll_saved_per_sample,
        regime=replace(gap(data, result.model, fold, None, untouched), held_rows=name),
        placebo=_placebo(data, search, result, untouched),
    )


def _placebo(data: Data, search: Search, result: SearchResult, untouched: Array | None) -> Gap:
    """The gap with one more effect, drawn from those that were not chosen."""
    free = [s for s in search.proposals.free_signatures(result.model) if s.plain]
    if not free or not result.model.labels:
        return Gap(added="")
    chosen = free[int(search.proposals.rng.integers(len(free)))]
    name, sensor, _ = chosen.candidate.label
    columns = np.nan_to_num(chosen.columns)
    found = gap(data, result.model, block_folds(data), columns, untouched)
    return replace(found, added=f"{name} ({sensor})")
