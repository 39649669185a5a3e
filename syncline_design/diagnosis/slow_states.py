"""Errors of parameters that hold in noise that is not the model's.

The Gauss-Markov likelihood gives good values; its curvature gives no good errors where the noise is
of another kind.  Here every channel of every sensor (north, roll, range, ...) is given an unknown
slow course beside white noise, and what the log's own blocks say is heard as well:
    e = X b + sum_c B_c sum_k a_ck cos(pi k t / T) + w,   a_ck ~ N(0, s_c^2 max(k, 1)^-1),
B_c the channel's effect on the error [m per standard deviation of the spec], T the length of the
log, w the white noise of the spec with a free scale and Huber weights.  s_c is found from the
log's own slow courses (k >= 1) by expectation and maximisation, up to the spec's figure.  The error
of b is the larger of this model's and of the delete-a-block jackknife over BLOCKS stretches.
Sources: Laird and Ware, Biometrics 38 (1982) for random effects; Huber, Robust Statistics (1981),
ch. 7; Efron and Stein, Annals of Statistics 9 (1981) for the jackknife, its F as in Hotelling's T2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import slopes
from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data, Model, inverse_scaled
from syncline_design.diagnosis.judged import Course, Judged, course_of
from syncline_design.diagnosis.noise import NoiseLevel, SensorKey, white_covariance
from syncline_design.diagnosis.recent import LastMade
from syncline_design.diagnosis.slow_sizes import Channel, Sizing
from syncline_design.diagnosis.slow_sums import LOST, HeldFixed, Weighted
from syncline_design.diagnosis.spans import span_of
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.normal import OF_MEDIAN_DEVIATION

SURVEY: SensorKey = ("", "target")  # channel of the targets' survey errors
WAVES = 8  # cosines a channel; the constant comes on top
BLOCKS = 16
INSIDE = 12  # blocks of a part of the log in which an effect acts alone
FEW = 8, 64  # targets, to be left out one group after the other
LEAST_ROWS = 8  # of a block of a part of the log, and of one that is told by itself
FEWEST_ROWS = 4  # of a block that is left out: of fewer blocks hardly more than the values of an
# effect, as in a short drive, Fisher's F tells next to nothing, whatever their size
HUBER = 1.345  # standard deviations from where on a component counts less
REWEIGHTED = 3
MATTERS = 1e-3  # of a row's white standard deviation: channels below have no say
SCALE_LEAST = 0.02


@dataclass(frozen=True, slots=True)
class States:
    """The slow states of one log: courses (n, 3, q) [m], each one's channel and share."""

    data: Data
    courses: Array
    channel: NDArray[np.int64]  # (q,) which channel a course belongs to
    wave: Array  # (q,) k
    block: NDArray[np.int64]  # (n,) stretch of every row
    seen: NDArray[np.int64] | None  # (n,) group of targets of every row, where they are few
    roles: tuple[Channel, ...]  # sensor of every channel, and which of its readings
    explained: Array | None = None  # (n, 3, f) what effects could make of the error
    kept: LastMade[HeldFixed] = field(
        default_factory=lambda: LastMade(1), repr=False, compare=False
    )
    whitened: LastMade[Weighted] = field(
        default_factory=LastMade, repr=False, compare=False
    )  # whatever the blocks

    @property
    def count(self) -> int:
        return int(self.block[-1]) + 1

    @property
    def has_parts(self) -> bool:
        """Whether it is long enough for its blocks to be told by themselves."""
        return len(self.block) >= BLOCKS * LEAST_ROWS

    def judged(
        self, model: Model, groups: Sequence[Array], own: Array | None = None
    ) -> list[Judged]:
        """Each group of columns (n, 3, p) alone beside the model's own effects."""
        if not groups:
            return []

        def made() -> HeldFixed:
            known = self._beside_own(model, own)
            return HeldFixed(known, [self.block] if self.seen is None else [self.block, self.seen])

        asked = (model, self.data, self.block, self.explained, own)
        return self.kept.of(asked, made).judged(groups)

    def _beside_own(self, model: Model, own: Array | None) -> Weighted:
        """The courses beside a model's own effects; blocks of any kind are made of these rows."""

        def made() -> Weighted:
            acting = np.nan_to_num(slopes(self.data.view, model.acting))
            return self._weighted(model.level, model.error, acting if own is None else own)

        asked = (model, self.data, self.courses, self.explained, own)
        return self.whitened.of(asked, made)

    def beside(self, *columns: Array) -> States:
        """The same with slow courses sized beside these columns (n, 3, p) as well: what is asked
        for is no slow noise before it is answered."""
        known = () if self.explained is None else (self.explained,)
        return replace(self, explained=np.concatenate([*known, *columns], axis=2))

    def own(self, model: Model, *, freed: bool = False) -> list[Judged]:
        """The model's own effects, all together: one entry for each, marginal over the others.

        Slow courses are sized beside these alone: what else effects could make is not there.
        freed: by restricted likelihood, since what the effects took of the noise was there too.
        """
        columns = np.nan_to_num(slopes(self.data.view, model.acting))
        none, states = (
            np.zeros((*columns.shape[:2], 0)),
            replace(self, explained=columns if freed else None),
        )
        [whole] = states.judged(model, [columns], none)
        at, result = 0, []
        for one in model.acting:
            part = slice(at, at + len(one.effect.slopes()))
            found, span = whole, span_of(one.effect)
            if span is not None:
                inside = span.mask(self.data.view.log.time_s) > 0.0
                [found] = states.within(inside, INSIDE).judged(model, [columns], none)
            own = tuple((c[part, part], count) for c, count in found.jackknives)
            values = fitted_of(one) + found.values[part]
            result.append(Judged(values, found.model[part, part], own))
            at = part.stop
        return result

    def courses_of(self, model: Model) -> list[Course | None]:
        """How each of the model's effects of one parameter runs along the log; None of others.

        In every block the parameter is what the block itself says, all else as in the whole log;
        quarters of the blocks are held against the scatter inside them (one-way F test).
        """
        columns = np.nan_to_num(slopes(self.data.view, model.acting))
        width = columns.shape[2]
        if not self.has_parts or width == 0:
            return [None for _ in model.acting]
        sums = self._weighted(model.level, model.error, columns)
        normal, score = sums.sums(self.block)
        known = normal.sum(0) + np.diag(sums.prior)
        scale = np.sqrt(np.maximum(np.diag(known), 1e-300))
        values = np.linalg.pinv(known / scale[:, None] / scale, rcond=1e-12) @ (
            score.sum(0) / scale
        )
        left = score - normal @ (values / scale)
        at, found = 0, []
        for one in model.acting:
            names = [] if span_of(one.effect) else names_of(one)
            weight = normal[:, at, at]
            whole = float(one.values[names[0]]) + values[at] / scale[at] if names else 0.0
            own = whole + left[:, at] / np.where(weight > 0.0, weight, 1.0) if names else weight
            found.append(course_of(own, weight) if len(names) == 1 else None)
            at += len(names_of(one))
        return found

    def sums_of(self, model: Model, columns: Array, width: int) -> tuple[Array, Array, Array]:
        """X'X (G, m, m) and X'e (G, m) of every block, and the prior precision (m,).

        columns (n, 3, m): `width` that are free, then the courses.
        """
        sums = self._weighted(model.level, model.error, columns[:, :, :width])
        return *sums.sums(self.block), sums.prior

    def within(self, inside: NDArray[np.bool_], count: int) -> States:
        """The same with `count` blocks of the rows inside, and one on either side of them; one
        block alone where no row is inside."""
        rows = np.flatnonzero(inside)
        if not rows.size:
            return replace(self, block=np.zeros(inside.shape, dtype=np.int64), seen=None)
        count = max(min(count, rows.size // LEAST_ROWS), 1)
        block = np.zeros(inside.shape, dtype=np.int64)
        block[rows] = 1 + np.arange(rows.size) * count // rows.size
        block[rows[-1] + 1 :] = count + 1
        return replace(self, block=block - block[0], seen=None)

    def sizes(self, level: NoiseLevel, error: Array) -> dict[Channel, float]:
        """Variance of the slow courses of each sensor's channel over the spec's."""
        prior = self._weighted(level, error, np.zeros((*error.shape, 0))).prior
        return {self.roles[c]: float(1.0 / prior[self.channel == c][1]) for c in set(self.channel)}

    def expected_prior(self, total: Array, width: int, level: NoiseLevel) -> Array:
        """Prior precision of `width` free columns and of the courses, each channel's variance what
        is expected of it.

        total: normal matrix of these columns, of others, and of the error as the last.
        """
        fixed = width + self.courses.shape[2]
        normal, score = total[:fixed, :fixed], total[:fixed, -1]
        sizing = self._sizing(level)
        size2 = sizing.likeliest(normal, score, width, sizing.start)
        size2 = sizing.expected(normal, score, width, size2)
        return np.concatenate([np.zeros(width), np.maximum(self.wave, 1) / size2[self.channel]])

    def _weighted(self, level: NoiseLevel, remaining: Array, own: Array) -> Weighted:
        """Rows at the final weights and scale, the courses beside columns of a model's own."""
        axes = [k for k in range(3) if np.any(np.isfinite(self.data.view.log.truth_m[:, k]))]
        known = np.isfinite(self.data.view.log.truth_m)[:, axes]
        judged = known & np.isin(axes, self.data.axes)  # an axis that never varies has no noise
        covariance = white_covariance(self.data.structure, level)[:, axes][:, :, axes]
        root = np.linalg.inv(np.linalg.cholesky(covariance)) * known[:, :, None]
        columns = np.concatenate([own, self.courses], axis=2)
        part = (root @ columns[:, axes]).reshape(-1, columns.shape[2])
        error = (root @ remaining[:, axes, None]).ravel()
        width, q = own.shape[2], self.courses.shape[2]
        weight, scale2 = known.ravel().astype(float), 1.0
        more = np.zeros((len(part), 0))  # what else is no slow course
        if self.explained is not None:
            more = (root @ self.explained[:, axes]).reshape(len(part), -1)
        every = np.column_stack([part, error, more])
        sizing = self._sizing(level)
        size2 = sizing.start
        for _ in range(REWEIGHTED):
            rooted = np.sqrt(weight)[:, None] * every
            total = rooted.T @ rooted / scale2  # symmetric: half the work
            normal, score = total[: width + q, : width + q], total[: width + q, width + q]
            if more.shape[1]:
                sized = _beside(total, np.r_[0:width, width + q + 1 : len(total)], width, q)
                size2 = sizing.pooled(sized[0], sizing.likeliest(*sized, 0, size2))
            else:
                size2 = sizing.likeliest(normal, score, width, size2)
            values, inverse = sizing.values(normal, score, width, size2)
            freedom = float(np.sum(inverse * normal))
            left = error - part @ values
            scale2 = _scale2(left[judged.ravel()], freedom)
            far = np.abs(left) / math.sqrt(scale2)
            weight = known.ravel() * np.minimum(1.0, HUBER / np.maximum(far, HUBER))
        if more.shape[1]:
            size2 = np.maximum(size2, sizing.expected(*sized, 0, size2))
        prior = np.maximum(self.wave, 1) / size2[self.channel]
        prior = np.concatenate([np.zeros(width), prior])
        return Weighted(tuple(axes), root, part, error, weight / scale2, prior)

    def _sizing(self, level: NoiseLevel) -> Sizing:
        """The courses, and the most that the variance of a channel may be, over the spec's."""
        structure = self.data.structure
        most: dict[SensorKey, float] = {SURVEY: 1.0} | {
            w.sensor: max(x, 1.0) ** 2 for w, x in zip(structure.white, level.factor, strict=True)
        }
        for part, slow in zip(structure.slow, level.slow, strict=True):
            most[part.sensor] *= max(1.0, *slow)
        limit = np.array([most[sensor] for sensor, _ in self.roles])
        return Sizing(self.roles, self.channel, self.wave, limit)


def _beside(total: Array, free: NDArray[np.int64], first: int, count: int) -> tuple[Array, Array]:
    """Normal matrix and score of the courses, freed of what is no slow course.

    total: X'X of all columns; the courses are `count` from the `first`, then comes the error.
    """
    both = np.arange(first, first + count + 1)
    cross = total[np.ix_(free, both)]
    left = total[np.ix_(both, both)]
    before = np.diag(left).copy()
    left = left - cross.T @ (inverse_scaled(total[np.ix_(free, free)]) @ cross)
    kept = np.diag(left) > LOST * before
    left = np.where(kept[:, None] & kept, left, 0.0)
    return left[:-1, :-1], left[:-1, -1]


def few_targets(data: Data) -> NDArray[np.int64] | None:
    """The target of every row where they are few: an error of its survey is in all its rows."""
    log = data.view.log
    if log.kind == "position":
        return None
    _, index = np.unique(np.nan_to_num(log.truth_m), axis=0, return_inverse=True)
    count = int(index.max()) + 1
    return index.ravel() if FEW[0] <= count <= FEW[1] else None


def _dealt(data: Data) -> NDArray[np.int64] | None:
    """Groups of targets, as many as there are blocks."""
    target = few_targets(data)
    return None if target is None else target % BLOCKS


def names_of(one: Acting) -> list[str]:
    """The parameters of an effect that are fitted."""
    return [p.name for p in one.effect.slopes()]


def fitted_of(one: Acting) -> Array:
    """Their values."""
    return np.array([float(one.values[name]) for name in names_of(one)])


def slow_states(data: Data) -> States:
    """The slow states of all channels that matter on the axes compared."""
    view, axes = data.view, list(data.axes)
    time_s = view.log.time_s
    phase = np.pi * (time_s - time_s[0]) / max(float(time_s[-1] - time_s[0]), 1e-9)
    waves = np.cos(phase[:, None] * np.arange(WAVES + 1))
    white = sum(np.einsum("nii->ni", w.covariance) for w in data.structure.white)
    total = np.median(np.sum(np.asarray(white)[:, axes], axis=1))
    courses: list[Array] = []
    channel: list[int] = []
    wave: list[int] = []
    roles: list[Channel] = []
    for sensor, loading in channels(view):
        for k in range(loading.shape[2]):
            own = loading[:, :, k]
            if np.median(np.sum(own[:, axes] ** 2, axis=1)) < MATTERS**2 * total:
                continue
            courses.append(own[:, :, None] * waves[:, None, :])
            channel += [len(roles)] * (WAVES + 1)
            wave += list(range(WAVES + 1))
            roles.append((sensor, k))
    if data.structure.survey is not None:
        courses.append(data.structure.survey)
        channel += [len(roles)] * courses[-1].shape[2]
        wave += [1] * courses[-1].shape[2]
        roles.append((SURVEY, 0))
    count = int(np.clip(len(view) // FEWEST_ROWS, 1, BLOCKS))
    block = np.minimum(np.arange(len(view)) * count // max(len(view), 1), count - 1)
    whole = np.concatenate(courses, axis=2) if courses else np.zeros((len(view), 3, 0))
    channels_of, waves_of = np.array(channel, int), np.array(wave, int)
    return States(
        data, whole, channels_of, waves_of, block, _dealt(data), tuple(roles), data.explained
    )


def _scale2(left: Array, freedom: float) -> float:
    """Robust variance of the whitened remainder, for the freedom that the fit took."""
    rows = max(left.shape[0], 1)
    square = (OF_MEDIAN_DEVIATION * float(np.median(np.abs(left)))) ** 2 if left.size else 1.0
    return float(max(square * rows / max(rows - freedom, 1.0), SCALE_LEAST**2))
