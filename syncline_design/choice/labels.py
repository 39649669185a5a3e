"""Partial designs as columns, and how a role's options extend them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.choice.arrays import RoleArrays
from syncline_design.choice.options import Bools, Column, Floats, Indices
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.table import Problem
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass

NOT_MET = np.array([-np.inf])  # nothing waits for a reference
CHUNK = 200_000  # candidates looked at in one go
MOST_PER_STEP = 10 * CHUNK
MOST_LABELS = 400_000  # partial designs kept before the merge gives up


@dataclass(frozen=True, slots=True)
class Labels:
    """Partial designs, in the order of their choices.

    resources, ties: sums so far.  error: sensor and systematic errors [m], added in the order of
    the roles; noise: the sensor errors alone [m], which the sync requirement is held against.
    bound: largest pair bound so far [s]; meets: largest bound of what the reference of the stage
    still has to meet [s].  sync: sync error so far [m] (per_sensor only).
    used: channels in use, one column per (vehicle, shared hardware).  choice: one row of option
    places per label, one column per role decided.  reference_tau, reference_host: of the last
    finished stage's ranging option.
    """

    resources: tuple[Column, ...]
    ties: tuple[Column, ...]
    error: Floats
    noise: Floats
    bound: Floats
    meets: Floats
    sync: Floats
    used: tuple[Column, ...]
    choice: NDArray[np.intp]
    clocks: NDArray[np.intp]
    reference_tau: Floats
    reference_host: Bools

    def __len__(self) -> int:
        return len(self.error)

    def take(self, rows: Indices | Bools) -> Labels:
        """Some of the labels."""
        return Labels(
            tuple(c[rows] for c in self.resources),
            tuple(c[rows] for c in self.ties),
            self.error[rows],
            self.noise[rows],
            self.bound[rows],
            self.meets[rows],
            self.sync[rows],
            tuple(c[rows] for c in self.used),
            self.choice[rows],
            self.clocks[rows],
            self.reference_tau[rows],
            self.reference_host[rows],
        )


def concatenate(parts: list[Labels]) -> Labels:
    """Several sets of labels as one, in the order of their choices."""
    if len(parts) == 1:
        return parts[0]
    joined = Labels(
        tuple(np.concatenate(c) for c in zip(*(p.resources for p in parts), strict=True)),
        tuple(np.concatenate(c) for c in zip(*(p.ties for p in parts), strict=True)),
        np.concatenate([p.error for p in parts]),
        np.concatenate([p.noise for p in parts]),
        np.concatenate([p.bound for p in parts]),
        np.concatenate([p.meets for p in parts]),
        np.concatenate([p.sync for p in parts]),
        tuple(np.concatenate(c) for c in zip(*(p.used for p in parts), strict=True)),
        np.concatenate([p.choice for p in parts]),
        np.concatenate([p.clocks for p in parts]),
        np.concatenate([p.reference_tau for p in parts]),
        np.concatenate([p.reference_host for p in parts]),
    )
    return joined.take(np.lexsort((*joined.clocks.T[::-1], *joined.choice.T[::-1])))


@dataclass(frozen=True, slots=True)
class Addition:
    """Options of one role as they add to a label.

    meets: bound of each option against the reference to come [s], None where it meets none; bound:
    pair bound that it completes by itself [s]; reference: whether it is the one that the stage's
    options meet; rate_mps: of all pairs that its tau is part of; used_at: where this vehicle's
    columns start in Labels.used.
    """

    options: RoleArrays
    rate_mps: float
    used_at: int
    meets: Floats | None = None
    bound: Floats | None = None
    reference: bool = False


def extend(labels: Labels, added: Addition, keep: Callable[[Labels], Indices]) -> Labels:
    """Every label with every option, in the order of their choices; of those what `keep` keeps."""
    n, m = len(labels), len(added.options)
    if m > MOST_PER_STEP:
        raise TooLarge(f"{m} options in one role")
    rows = max(1, CHUNK // max(1, m))
    if n <= rows:
        return _extend(labels, added, keep)
    parts: list[Labels] = []
    deadline = in_force()
    for start in range(0, n, rows):
        deadline.check()
        parts.append(_extend(labels.take(np.arange(start, min(n, start + rows))), added, keep))
        if sum(map(len, parts)) > MOST_LABELS:
            raise TooLarge(f"more than {MOST_LABELS} partial designs that none replaces")
    joined = concatenate(parts)
    return joined.take(keep(joined))


# Stands in for columns that are only worked out for the candidates that stay.
_NO_CHOICE: Any = np.broadcast_to(np.zeros((1, 1)), (MOST_PER_STEP, 1))


def _extend(labels: Labels, added: Addition, keep: Callable[[Labels], Indices]) -> Labels:
    n, m = len(labels), len(added.options)
    left, right = _in_order(labels, m)
    options = added.options
    used = [column[left] for column in labels.used]
    for k, channels in enumerate(options.channels):
        used[added.used_at + k] = used[added.used_at + k] + channels[right]
    bound, meets, sync = _timed(labels, added, left, right)
    tau, host = labels.reference_tau, labels.reference_host
    candidates = Labels(
        _sums(labels.resources, options.resources, left, right),
        _sums(labels.ties, options.ties, left, right),
        labels.error[left] + options.error[right],
        labels.noise[left] + options.noise[right],
        bound,
        meets,
        sync,
        tuple(used),
        _NO_CHOICE[: n * m],
        _NO_CHOICE[: n * m],
        options.tau[right] if added.reference else tau[left],
        options.host[right] if added.reference else host[left],
    )
    rows = keep(candidates)
    left, right = left[rows], right[rows]
    return replace(
        candidates.take(rows),
        choice=np.column_stack([labels.choice[left], options.place[right]]),
        clocks=labels.clocks[left],
    )


def _in_order(labels: Labels, options: int) -> tuple[Indices, Indices]:
    """Label and option of every candidate, in the order of choices, then of clocks."""
    n = len(labels)
    left, right = np.repeat(np.arange(n), options), np.tile(np.arange(options), n)
    if n < 2 or not labels.clocks.any():
        return left, right
    first = np.any(labels.choice[1:] != labels.choice[:-1], axis=1)
    if first.all():
        return left, right
    order = np.lexsort((left, right, np.append(0, np.cumsum(first))[left]))
    return left[order], right[order]


def _timed(
    labels: Labels, added: Addition, left: Indices, right: Indices
) -> tuple[Floats, Floats, Floats]:
    """Largest bounds, those still to be met, and sync error of every candidate."""
    bound, meets, sync = labels.bound[left], labels.meets[left], labels.sync[left]
    if added.reference:
        bound = np.maximum(bound, meets + added.options.tau[right])
        sync = sync + (added.rate_mps * added.options.tau)[right]
        return bound, np.repeat(NOT_MET, len(bound)), sync
    if added.meets is not None:
        meets = np.maximum(meets, added.meets[right])
        sync = sync + (added.rate_mps * added.meets)[right]
    if added.bound is not None:
        bound = np.maximum(bound, added.bound[right])
        sync = sync + (added.rate_mps * added.bound)[right]
    return bound, meets, sync


def _sums(
    own: tuple[Column, ...], added: tuple[Column, ...], left: Indices, right: Indices
) -> tuple[Column, ...]:
    return tuple(np.asarray(a[left] + b[right]) for a, b in zip(own, added, strict=True))


def total_m(problem: Problem, labels: Labels) -> Floats:
    """Total error of complete designs [m]."""
    caused = labels.sync
    if problem.sync_model == "syncline":
        caused = problem.sync_rate_mps * labels.bound
    return np.asarray(labels.error + problem.fixed_error_m + caused)
