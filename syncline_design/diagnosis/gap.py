"""The gap on data that the fit has not seen: contiguous blocks, and a regime of its own."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import slopes
from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.fitting import Data, Model, scored, solve_scaled
from syncline_design.diagnosis.gap_result import Fit, Gap, HeldOut, Saved
from syncline_design.diagnosis.noise import (
    NoiseLevel,
    as_specified,
    clipped,
    marginal_variance,
    precision,
    spec_bounds,
)
from syncline_design.diagnosis.regimes import covariates
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.model.normal import NORMAL_95

BLOCKS = 5
PURGE_S = 5.0  # left out on both sides of a held-out block
PURGE_SHARE = 0.1  # of a block, at most
REGIME_SHARE = 0.3  # fastest share of the rows, held out as a regime
LEAST_GAP = 1e-9  # nat per sample
LEAST_TRAINING = 30  # rows

Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Sums:
    """Sums over held-out rows."""

    squares: float = 0.0
    chi2: float = 0.0
    nll: float = 0.0
    inside: float = 0.0
    rows: int = 0
    samples: int = 0

    def __add__(self, other: _Sums) -> _Sums:
        return _Sums(
            self.squares + other.squares,
            self.chi2 + other.chi2,
            self.nll + other.nll,
            self.inside + other.inside,
            self.rows + other.rows,
            self.samples + other.samples,
        )

    def fit(self) -> Fit:
        return Fit(
            float(np.sqrt(self.squares / max(self.rows, 1))),
            self.chi2 / max(self.samples, 1),
            self.nll / max(self.samples, 1),
            self.inside / max(self.samples, 1),
        )


@dataclass(frozen=True, slots=True)
class Folds:
    """Pairs of (training, held-out) rows."""

    pairs: tuple[tuple[Index, Index], ...]


def block_folds(data: Data) -> Folds:
    """Five contiguous blocks, each held out once, with a purge gap on both sides."""
    n, times = len(data.view), data.view.log.time_s
    edges = np.linspace(0, n, BLOCKS + 1).astype(int)
    pairs = []
    for a, b in itertools.pairwise(edges):
        purge = min(PURGE_S, PURGE_SHARE * float(times[b - 1] - times[a]))
        near = (times > times[a] - purge) & (times < times[b - 1] + purge)
        near[a:b] = True
        training = np.flatnonzero(~near)
        if training.shape[0] >= LEAST_TRAINING and b - a >= 2:
            pairs.append((training, np.arange(a, b)))
    return Folds(tuple(pairs))


def regime_fold(data: Data) -> tuple[str, Folds]:
    """The rows of highest speed held out; where the speed hardly varies, of highest turn rate."""
    found = {c.name: c.values for c in covariates(data.view)}
    speed = found["speed"]
    varied = float(np.ptp(np.quantile(speed, [0.1, 0.9]))) > 0.15 * float(np.median(speed))
    values = speed if varied else np.abs(found["turn_rate"])
    limit = float(np.quantile(values, 1.0 - REGIME_SHARE))
    name = "speed" if varied else "turn_rate"
    held = np.flatnonzero(values > limit)
    training = np.flatnonzero(values <= limit)
    unit = "m/s" if varied else "deg/s"
    if held.shape[0] < LEAST_TRAINING or training.shape[0] < LEAST_TRAINING:
        return name, Folds(())
    return f"{name} above {to_digits(limit, 3)} {unit}", Folds(((training, held),))


def gap(
    data: Data,
    model: Model,
    folds: Folds,
    extra: Array | None = None,
    untouched: Array | None = None,
) -> Gap:
    """Evaluate a model on held-out rows, its parameters fitted on the other rows.

    Around the fitted parameters the error is linear, so a fit to part of the rows is one step.
    extra: columns (n, 3, p) of an effect that was not chosen, as a placebo.  untouched (n, 3) [m]:
    the error of the log as it came, where gross faults were undone in it: what "before" means.
    """
    if not folds.pairs:
        return Gap()
    columns = np.nan_to_num(slopes(data.view, model.acting))
    moved = columns.shape[2] > 0 or untouched is not None
    if extra is not None:
        columns = np.concatenate([columns, extra], axis=2)
    plain = data.error(()) if untouched is None else untouched
    spec = clipped(model.level, spec_bounds(data.structure))
    totals = {name: _Sums() for name in ("before", "after", "fitted", "expected")}
    saved = []
    for training, held in folds.pairs:
        part = Held(data, held, spec, model.level)
        left = model.error
        train = precision(data.structure.rows(training), model.level)
        learned = left[held] - columns[held] @ _step(train, columns[training], left[training])
        found = {"before": part.before(plain[held]), "after": part.after(learned)}
        found |= {"fitted": part.after(left[held]), "expected": part.noise_only()}
        totals = {name: sums + found[name] for name, sums in totals.items()}
        saved.append((found["before"].nll - found["after"].nll) / found["before"].samples)
    before, after, fitted, expected = (totals[n].fit() for n in totals)
    floor = replace(
        fitted,
        rms_m=min(fitted.rms_m, expected.rms_m),
        nll_per_sample=min(fitted.nll_per_sample, expected.nll_per_sample),
    )
    spread = float(np.std(saved, ddof=1) / np.sqrt(len(saved))) if len(saved) > 1 else None
    scores = HeldOut(before, after, floor, fitted)
    return Gap(
        held_out=scores,
        expected_rms_m=expected.rms_m,
        closed_fraction=closed_share(scores) if moved else None,
        nll_saved_per_sample=Saved(before.nll_per_sample - after.nll_per_sample, spread),
    )


def closed_share(scores: HeldOut) -> float | None:
    """Share of the gap that is closed, the lesser of NLL and RMS; 1 at most.

    Better by the likelihood alone may be a larger noise, better by the RMS alone a lucky fit.
    """
    before, after, floor = scores.before, scores.after, scores.floor
    shares = []
    if before.nll_per_sample - floor.nll_per_sample > LEAST_GAP:
        gained = before.nll_per_sample - after.nll_per_sample
        shares.append(gained / (before.nll_per_sample - floor.nll_per_sample))
    if scores.slight:
        return None
    shares.append((before.rms_m - after.rms_m) / (before.rms_m - floor.rms_m))
    return min(1.0, *shares)


def _step(known: Precision, columns: Array, error: Array) -> Array:
    """Change of the parameters that fits the rows best."""
    if columns.shape[2] == 0:
        return np.zeros(0)
    return solve_scaled(*scored(known, columns, error))


class Held:
    """Held-out rows with their covariance under the spec's noise and under the fitted one."""

    def __init__(self, data: Data, held: Index, spec: NoiseLevel, fitted: NoiseLevel) -> None:
        structure = data.structure.rows(held)
        self.visible = np.isfinite(data.view.log.truth_m[held])
        self.spec, self.known = precision(structure, spec), precision(structure, fitted)
        stated = as_specified(structure)
        self.stated = precision(structure, stated)
        self.stated_variance = marginal_variance(structure, stated)
        self.spec_variance = marginal_variance(structure, spec)
        self.known_variance = marginal_variance(structure, fitted)

    def before(self, error: Array) -> _Sums:
        return self._sums(self.spec, self.spec_variance, error)

    def after(self, error: Array) -> _Sums:
        return self._sums(self.known, self.known_variance, error)

    def noise_only(self) -> _Sums:
        """What to expect when nothing but the spec's own noise is left: chi-square 1."""
        count = int(np.sum(self.visible))
        unknown = self.visible.size * np.log(2 * np.pi)
        nll = 0.5 * (self.stated.log_determinant + count + unknown)
        squares = float(np.sum(self.stated_variance[self.visible]))
        rows = self.visible.shape[0]
        return _Sums(squares, float(count), float(nll), 0.95 * count, rows, count)

    def _sums(self, known: Precision, variance: Array, error: Array) -> _Sums:
        chi2 = float(known.squares(error[:, :, None])[0])
        nll = 0.5 * (chi2 + known.log_determinant + error.size * np.log(2.0 * np.pi))
        inside = np.abs(error) < NORMAL_95 * np.sqrt(variance)
        return _Sums(
            float(np.sum(error**2)),
            chi2,
            float(nll),
            float(np.sum(inside & self.visible)),
            error.shape[0],
            int(np.sum(self.visible)),
        )
