"""What of each departure a log leaves open while the others of a built system are free.

With X the slopes of the error by all departures p (delays, arms, turns, a range's bias), C the
fitted noise, and u_p what a build can be wrong by,
    V = (X' C^-1 X + diag(u_p^-2))^-1,   p = V X' C^-1 e.
Of what moves no object on any drive (one delay of all sensors over ground that stands still, equal
errors of both arms, turns of both mountings that undo one another) nothing is asked: along those
directions p is held at zero.
Source: Bayes' rule for a linear model, e.g. Tarantola, Inverse Problem Theory (2005), ch. 3.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature, slopes
from syncline_design.diagnosis.fitting import Data, Model, scored
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.normal import NEARLY_ALL

BUILD: Final = {"s": 0.2, "m": 1.0, "rad": 0.1}  # what a build can be wrong by, by unit
HELD: Final = 1e8  # of the prior's weight, along what moves no object
LARGER: Final = 1.5  # times the uncertainty alone, from which others count
Label = tuple[str, str, int]


@dataclass(frozen=True, slots=True)
class LeftOpen:
    """One parameter: the size that is not excluded at 19 of 20, with the others free.

    alone: the same with the others as the spec has them; by: the effect that undoes it most.
    """

    label: Label
    stage: str
    parameter: str
    unit: str
    size: float
    alone: float
    by: Label


def left_open(data: Data, model: Model, found: Sequence[Signature]) -> tuple[LeftOpen, ...]:
    """Every departure that another one makes much less certain, with that other one.

    found: signatures of all effects, those that the model holds as well: a delay that was found may
    be a part of one that all sensors share.
    """
    asked = [s for s in found if s.asked_jointly]
    if len(asked) < 2:
        return ()
    return tuple(_left_open(data, model, asked))


@dataclass(frozen=True, slots=True)
class _Held:
    """A direction (P,) that moves no object on any drive, and the columns that it is made of."""

    direction: Array
    columns: frozenset[int]


@dataclass(frozen=True, slots=True)
class JointNormal:
    """Normal matrix and score in units of what a build can be wrong by; whose each column is."""

    normal: Array
    score: Array
    held: tuple[_Held, ...]
    owner: tuple[int, ...]

    def grown(self, at: int) -> float:
        """What a column counts where those that can be it as well are right on average.

        Errors that differ by a held direction are one: an arm that is off by d beside one that is
        right is as good as either off by half, and along that direction they are held at zero.
        """
        count = next((len(one.columns) for one in self.held if at in one.columns), 0)
        return count / (count - 1.0) if count > 1 else 1.0

    def size(self, at: int, without: Collection[int] = ()) -> tuple[float, float]:
        """(largest size not excluded at 19 of 20, its standard uncertainty) of one column.

        without: owners whose columns are at zero.
        """
        keep = np.array([k not in without for k in self.owner])
        whole = self.normal + np.eye(len(keep))
        for one in self.held:
            if keep[sorted(one.columns)].all():
                whole = whole + HELD * np.outer(one.direction, one.direction)
        inverse = np.linalg.inv(whole[np.ix_(keep, keep)])
        values = inverse @ self.score[keep]
        own = int(np.sum(keep[:at]))
        spread = self.grown(at) * float(np.sqrt(inverse[own, own]))
        return self.grown(at) * float(abs(values[own])) + NEARLY_ALL * spread, spread


def _left_open(data: Data, model: Model, asked: Sequence[Signature]) -> Iterator[LeftOpen]:
    joint = joint_of(data, model, asked, model.error)
    at = 0
    for k, s in enumerate(asked):
        stage = data.view.system.stages[s.candidate.stage].name
        for p in s.candidate.effect.slopes():
            own = float(1.0 / np.sqrt(joint.normal[at, at] + 1.0))
            size, spread = joint.size(at)
            if spread > LARGER * own:
                unit = BUILD[p.unit]
                label, by = s.candidate.label, _by(joint, asked, k, at)
                yield LeftOpen(label, stage, p.name, p.unit, unit * size,
                               unit * NEARLY_ALL * own, by)  # fmt: skip
            at += 1


def _by(joint: JointNormal, asked: Sequence[Signature], own: int, at: int) -> Label:
    """What undoes it most: of the kind without which it is best known, the same sensor's first."""
    kinds: dict[str, list[int]] = {}
    for k, s in enumerate(asked):
        if k != own:
            kinds.setdefault(s.candidate.effect.breaks, []).append(k)
    best = min(kinds.values(), key=lambda group: joint.size(at, group)[1])
    mine = asked[own].candidate
    found = min(best, key=lambda k: (
        (asked[k].candidate.sensor, asked[k].candidate.stage) != (mine.sensor, mine.stage),
        joint.size(at, [k])[1],
    ))  # fmt: skip
    return asked[found].candidate.label


def joint_of(data: Data, model: Model, asked: Sequence[Signature], error: Array) -> JointNormal:
    labels = {s.candidate.label for s in asked}
    others = [one for one in model.acting if one.label not in labels]
    own = np.nan_to_num(slopes(data.view, others))
    columns = np.concatenate(
        [
            np.nan_to_num(s.columns) * [BUILD[p.unit] for p in s.candidate.effect.slopes()]
            for s in asked
        ],
        axis=2,
    )
    every = np.concatenate([own, columns], axis=2)
    normal, score = scored(model.precision, every, error)
    width = own.shape[2]
    if width:  # what was found is free as well
        inverse = np.linalg.pinv(normal[:width, :width], rcond=1e-12, hermitian=True)
        cross = normal[:width, width:]
        score = score[width:] - cross.T @ inverse @ score[:width]
        normal = normal[width:, width:] - cross.T @ inverse @ cross
    owner = tuple(k for k, s in enumerate(asked) for _ in s.candidate.effect.slopes())
    return JointNormal(normal, score, _held(normal, asked, owner), owner)


def _held(normal: Array, asked: Sequence[Signature], owner: Sequence[int]) -> tuple[_Held, ...]:
    """Directions that move no object on any drive, as far as all of one are asked."""
    names = [(s.candidate.effect.breaks, *s.candidate.label[1:]) for s in asked]
    found = []
    delays = [k for k, (name, *_) in enumerate(names) if name == "latency"]
    if {names[k][1] for k in delays} == {"position", "attitude", "ranging"}:
        found.append(_along(len(normal), {at: 1.0 for at, k in enumerate(owner) if k in delays}))
    for stage in sorted({stage for *_, stage in names}):
        for pair in (
            (("lever_arm", "position", stage), ("lever_arm", "ranging", stage)),
            (("mounting", "attitude", stage), ("mounting", "ranging", stage)),
        ):
            if all(label in names for label in pair):
                first, second = (_places(owner, names.index(one)) for one in pair)
                for a, b in zip(first, second, strict=True):
                    against = -float(np.sign(normal[a, b])) or 1.0
                    found.append(_along(len(normal), {a: 1.0, b: against}))
    return tuple(found)


def _places(owner: Sequence[int], own: int) -> list[int]:
    return [at for at, k in enumerate(owner) if k == own]


def _along(width: int, parts: Mapping[int, float]) -> _Held:
    direction = np.zeros(width)
    direction[list(parts)] = list(parts.values())
    return _Held(direction / np.linalg.norm(direction), frozenset(parts))
