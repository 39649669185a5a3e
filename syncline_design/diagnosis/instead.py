"""What several departures together would explain as well as one that was found.

With Q(S) = g_S' (N_SS + 1)^-1 g_S / 2 the nats that departures S save (N and g in units of what a
build can be wrong by, as in `undone`), a departure a stands for itself if Q(S + a) - Q(S) is large
for all that could be in its place: every arm, turn and bias, and one delay beside those that were
found.  What moves no object on any drive (delays common to all sensors, equal errors of both arms,
turns of both mountings) is no explanation of its own; what one other departure explains alone is an
alias of the finding already.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import field
from itertools import combinations
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature, slopes
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.slow_states import fitted_of
from syncline_design.diagnosis.undone import BUILD, Label, joint_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

RIVAL_NATS: Final = 3.0  # by which others may be worse and still not be told apart
Named = tuple[str, str, str]  # effect, sensor, name of the stage


@dataclass(frozen=True, slots=True)
class JointFigure:
    """A parameter of one of several departures together: its value and standard uncertainty, SI."""

    departure: Named
    parameter: str
    value: float
    spread: float


@dataclass(frozen=True, slots=True)
class InItsPlace:
    """A departure that was found, and others that would do together in its place, with which
    figures."""

    found: Named
    others: tuple[Named, ...]
    loss: float
    figures: tuple[JointFigure, ...] = ()


@dataclass(frozen=True, slots=True)
class InQuestion:
    """Departures asked together: label, which assumption each breaks, its columns; N, g of all."""

    labels: tuple[Label, ...]
    breaks: tuple[str, ...]
    columns: tuple[tuple[int, ...], ...]
    normal: Array
    score: Array
    saved: dict[frozenset[int], float] = field(default_factory=dict)

    def saves(self, chosen: Collection[int]) -> float:
        """Q(S) [nat]."""
        key = frozenset(chosen)
        if key not in self.saved:
            at = [c for k in sorted(key) for c in self.columns[k]]
            whole = self.normal[np.ix_(at, at)] + np.eye(len(at))
            own = self.score[at]
            self.saved[key] = 0.5 * float(own @ np.linalg.solve(whole, own)) if at else 0.0
        return self.saved[key]

    def fitted(self, chosen: Collection[int], own: int) -> tuple[Array, Array]:
        """(N_SS + 1)^-1 g_S of one of the chosen, and standard uncertainties, of what a build can
        be wrong by."""
        order = sorted(chosen)
        at = [c for k in order for c in self.columns[k]]
        inverse = np.linalg.inv(self.normal[np.ix_(at, at)] + np.eye(len(at)))
        first = sum(len(self.columns[k]) for k in order if k < own)
        part = slice(first, first + len(self.columns[own]))
        return (inverse @ self.score[at])[part], np.sqrt(np.diag(inverse))[part]


def in_place(data: Data, model: Model, found: Sequence[Signature]) -> tuple[InItsPlace, ...]:
    """Of every departure that a model holds, others that would do together in its place."""
    signed = [s for s in found if s.asked_jointly]
    labels = tuple(s.candidate.label for s in signed)
    own = [one for one in model.acting if one.label in labels]
    if len(signed) < 3 or not own:
        return ()
    made = np.nan_to_num(slopes(data.view, own)) @ np.concatenate([fitted_of(one) for one in own])
    joint = joint_of(data, model, signed, model.error + made)
    columns = tuple(
        tuple(at for at, owner in enumerate(joint.owner) if owner == k) for k in range(len(signed))
    )
    asked = InQuestion(labels, tuple(s.candidate.effect.breaks for s in signed), columns,
                   joint.normal, joint.score)  # fmt: skip
    names = [stage.name for stage in data.view.system.stages]
    held = {labels.index(one.label) for one in own}
    return tuple(_each(asked, signed, held, names))


def _each(
    asked: InQuestion, signed: Sequence[Signature], held: Collection[int], names: Sequence[str]
) -> Iterator[InItsPlace]:
    for k in sorted(held):
        kept = frozenset(held) - {k}
        others = others_in_place(asked, k, kept)
        if others is not None:
            some, loss = others
            told = tuple(_named(asked.labels[i], names) for i in sorted(some))
            figures = tuple(f for i in sorted(some) for f in
                            _figures(asked, signed[i], i, kept | some, names))  # fmt: skip
            yield InItsPlace(_named(asked.labels[k], names), told, loss, figures)


def _figures(
    asked: InQuestion, signature: Signature, own: int, chosen: Collection[int],
    names: Sequence[str],
) -> Iterator[JointFigure]:  # fmt: skip
    values, spreads = asked.fitted(chosen, own)
    slopes_of = signature.candidate.effect.slopes()
    for p, value, spread in zip(slopes_of, values, spreads, strict=True):
        unit = BUILD[p.unit]
        yield JointFigure(_named(asked.labels[own], names), p.name, unit * float(value),
                          unit * float(spread))  # fmt: skip


def _named(label: Label, names: Sequence[str]) -> Named:
    effect, sensor, stage = label
    return effect, sensor, names[stage]


def others_in_place(
    asked: InQuestion, own: int, kept: frozenset[int]
) -> tuple[frozenset[int], float] | None:
    """The fewest others that do in its place, and how much worse; None where none do together."""
    best: tuple[frozenset[int], float] | None = None
    for free in _allowed(asked, own, kept):
        whole = asked.saves(kept | free | {own})
        if whole - asked.saves(kept | free) >= RIVAL_NATS:
            continue
        if any(whole - asked.saves(kept | {one}) < RIVAL_NATS for one in free):
            return None  # an alias of its own
        for count in range(2, len(free) + 1):
            losses = {
                frozenset(some): whole - asked.saves(kept.union(some))
                for some in combinations(sorted(free), count)
            }
            some, loss = min(losses.items(), key=lambda pair: pair[1])
            if loss < RIVAL_NATS:
                if best is None or (len(some), loss) < (len(best[0]), best[1]):
                    best = some, loss
                break
    return best


def _allowed(asked: InQuestion, own: int, kept: frozenset[int]) -> Iterator[frozenset[int]]:
    """Sets of what could be in its place: no two delays more, nothing of its own kind that it
    moves no object with."""
    _, _, stage = asked.labels[own]
    same = {k for k, what in enumerate(asked.breaks)
            if what == asked.breaks[own] and asked.labels[k][2] == stage}  # fmt: skip
    delays = {k for k, what in enumerate(asked.breaks) if what == "latency"}
    still = frozenset(range(len(asked.labels))) - delays - same - kept - {own}
    yield still
    for one in sorted(delays - kept - {own}):
        if delays - kept - {own, one} or own not in delays:
            yield still | {one}
