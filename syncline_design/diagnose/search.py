"""Which effects are missing: forward and backward search over whole effects.

Each candidate is scored as a whole (all its parameters at once) under a ladder of noise models, the
best few are fitted with the noise fitted anew, and the best of these is accepted if it beats what
the largest of all candidates' scores reaches by chance on this very trajectory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from syncline_design.diagnose.calibration import refit_factor
from syncline_design.diagnose.candidates import (
    EDGE,
    STEP_TIMES,
    Candidate,
    Signature,
    candidates,
    commonness,
    signatures,
    zero_values,
)
from syncline_design.diagnose.fitting import (
    Data,
    Model,
    Opened,
    adjusted,
    fit,
    polished,
)
from syncline_design.diagnose.noise import NoiseLevel, as_specified
from syncline_design.diagnose.scatter import (
    directed_index,
    scatter_candidates,
    usual_noise_size,
    with_size,
)
from syncline_design.diagnose.scores import (
    Gram,
    clean_least,
    clean_threshold,
    gram,
    log_p_of,
    possible,
)
from syncline_design.diagnose.settings import DiagnosisSettings
from syncline_design.diagnose.simulation import Acting
from syncline_design.diagnose.tails import tails_in

TRIED = 4  # candidates fitted with their own noise per step
SCREENED_OUT = 6.0  # gain [nat] below which a candidate is not fitted
WITHIN_NATS, WITHIN_SHARE = 12.0, 0.35  # how far behind the best a candidate may be to be fitted
MEAN_SHARE = 0.6  # of the false-alarm rate for effects that move the mean
SCATTER_SHARE = 0.2  # for effects that only scatter; the rest is the remainder test's
WANDERING = frozenset({"correlated_noise", "height_drift"})
WANDER_NATS = (
    15.0  # slow noise can take the shape of anything slow, so it has to be that much better
)
TAILS_NATS = 10.0  # by which Student's t has to be better than the normal
NEAR = 2.0  # log p within this factor of the threshold is checked on simulated logs
AS_GOOD_NATS = 2.0  # difference in log p within which the commoner of two effects is named
SCATTER_WITHIN = 0.15  # share of the best mean effect's gain that makes a scatter worth a fit
AGREE = 0.3  # how far a scatter may be from what the mean says, as a share of it
RIVAL_NATS = 4.5  # a rival whose fit is worse by less than this cannot be told apart


@dataclass(frozen=True, slots=True)
class Trial:
    """A model with one more effect."""

    candidate: Candidate
    model: Model
    gain: float  # NLL saved [nat]
    freedom: int

    @property
    def log_p(self) -> float:
        """log of the chance that noise alone saves as much in this one candidate.

        A step is charged for the places at which it was looked for.
        """
        located = any(p.located for p in self.candidate.effect.parameters)
        charge = math.log(STEP_TIMES) if located else 0.0
        return min(log_p_of(2.0 * self.gain, self.freedom) + charge, 0.0)


@dataclass(frozen=True, slots=True)
class Step:
    """One accepted addition."""

    label: tuple[str, str, int]
    gain: float
    log_p: float
    threshold: float  # log p that clean logs reach at the stated rate
    model: Model


@dataclass(frozen=True, slots=True)
class SearchResult:
    base: Model
    model: Model
    steps: tuple[Step, ...]
    rivals: dict[tuple[str, str, int], tuple[Candidate, ...]] = field(default_factory=dict)


@dataclass(slots=True)
class Search:
    """A running search over one log."""

    data: Data
    settings: DiagnosisSettings
    rng: np.random.Generator
    candidates: tuple[Candidate, ...]
    signatures: tuple[Signature, ...]
    progress: Callable[[float], None]

    def run(self) -> SearchResult:
        """Add effects while they beat chance; then take out what is no longer needed."""
        base = fit(self.data)
        model, steps = base, []
        while len(model.labels) < self.settings.max_effects:
            scores = gram(self.data, model, self.free_signatures(model), model.level)
            threshold = self.threshold(scores)
            trial = self.best(model, scores)
            if trial is None or trial.log_p > threshold:
                break
            if trial.log_p > NEAR * threshold:
                threshold *= self.refit_factor(model, scores)
                if trial.log_p > threshold:
                    break
            model = self.exchanged(trial.model)
            steps.append(Step(trial.candidate.label, trial.gain, trial.log_p, threshold, model))
            self.progress(len(steps) / self.settings.max_effects)
        model = polished(self.data, self.pruned(model))
        return SearchResult(base, model, tuple(steps))

    def threshold(self, scores: Gram) -> float:
        """log p that the best candidate of a clean log falls below at the stated rate."""
        return clean_threshold(scores, MEAN_SHARE * self.settings.false_alarm_rate, self.rng)

    def refit_factor(self, model: Model, scores: Gram) -> float:
        """By how much refitted noise moves the threshold, from simulated clean logs."""
        free = self.free_signatures(model)

        def gains(clean: Model) -> list[float]:
            return [g for g, _ in gram(self.data, clean, free, clean.level).gains()]

        expected = float(np.mean(clean_least(scores, self.rng)))
        return refit_factor(self.data, model, free, self.rng, gains, log_p_of, expected)

    def free_signatures(self, model: Model) -> list[Signature]:
        """Signatures of what the model does not hold yet."""
        return [s for s in self.signatures if s.candidate.label not in model.labels]

    def best(self, model: Model, scores: Gram) -> Trial | None:
        """The candidate that best explains what is left, its noise fitted anew."""
        trials = [self.trial(model, s, level) for s, level in self.screened(model, scores)]
        most = max((t.gain for t in trials), default=0.0)
        trials += self.scatter_trials(model, SCATTER_WITHIN * most)
        kept = [t for t in trials if plausible(t.model)]
        return preferred(kept)

    def screened(self, model: Model, scores: Gram) -> list[tuple[Signature, NoiseLevel]]:
        """Signatures that gain most under any noise of the ladder, one per candidate."""
        free = self.free_signatures(model)
        best: dict[tuple[str, str, int], tuple[float, Signature, NoiseLevel]] = {}
        for level in ladder(self.data, model):
            seen = scores if level is model.level else gram(self.data, model, free, level)
            for s, (gain, values) in zip(free, seen.gains(), strict=True):
                if not possible(s, values):
                    continue
                total = gain - seen.nll - 2.0 * s.columns.shape[2] - 4.0 * len(s.at)
                known = best.get(s.candidate.label)
                if gain > SCREENED_OUT and (known is None or known[0] < total):
                    best[s.candidate.label] = (total, s, level)
        ranked = sorted(best.values(), key=lambda entry: -entry[0])
        if not ranked:
            return []
        reach = max(WITHIN_NATS, WITHIN_SHARE * (ranked[0][0] + model.nll))
        close = [entry for entry in ranked if entry[0] > ranked[0][0] - reach]
        return [(s, level) for _, s, level in close[:TRIED]]

    def trial(self, model: Model, found: Signature, level: NoiseLevel) -> Trial:
        """The model with this candidate, fitted by re-simulation."""
        start = found.candidate.acting(zero_values(found.candidate.effect, found.at))
        opened = model.opened
        if found.candidate.effect.kind == "stochastic":
            directed = directed_index(self.data, found.candidate)
            opened = (*opened, Opened(found.candidate, "size", directed))
            level = with_size(level, directed, 0.3 * usual_noise_size(self.data, directed))
        fitted = fit(self.data, (*model.acting, start), opened, start=level)
        fitted = located(self.data, fitted) if found.at else fitted
        freedom = found.columns.shape[2] + len(found.at) + (len(opened) - len(model.opened))
        return Trial(found.candidate, fitted, model.nll - fitted.nll, freedom)

    def scatter_trials(self, model: Model, least: float) -> list[Trial]:
        """Candidates that only change the covariance, if a rough guess gains `least` [nat]."""
        trials = []
        for one, level in scatter_candidates(self.data, self.candidates, model, least):
            fitted = fit(self.data, model.acting, (*model.opened, one), start=level)
            gain = model.nll - fitted.nll
            if gain > 2.0:
                trials.append(Trial(one.candidate, fitted, gain, 2 if one.what == "slow" else 1))
                trials += self.tails_trial(trials[-1])
        return trials

    def tails_trial(self, understated: Trial) -> list[Trial]:
        """Heavy tails, where the scatter is too large and Student's t describes it much better."""
        name, sensor, _ = understated.candidate.label
        tails = [c for c in self.candidates if c.effect.name == "heavy_tails"]
        if (name, sensor) != ("noise_understated", "position") or not tails:
            return []
        model = understated.model
        if tails[0].label in model.labels:
            return []
        gain = tails_in(self.data, model).gain
        if gain < TAILS_NATS:
            return []
        opened = (*model.opened[:-1], Opened(tails[0], "tails"))
        return [Trial(tails[0], replace(model, opened=opened), understated.gain + gain, 2)]

    def exchanged(self, model: Model) -> Model:
        """Try every earlier effect's rivals in its place now that there is company."""
        if len(model.acting) < 2:
            return model
        for k, one in enumerate(model.acting[:-1]):
            rest = tuple(a for i, a in enumerate(model.acting) if i != k)
            without = fit(self.data, rest, model.opened, start=model.level)
            scores = gram(self.data, without, self.free_signatures(without), without.level)
            for s, level in self.screened(without, scores):
                if s.candidate.label == one.label or s.candidate.effect.kind == "stochastic":
                    continue
                trial = self.trial(without, s, level)
                if plausible(trial.model) and clearly_better(trial.model, model):
                    model = trial.model
                    break
        return model

    def pruned(self, model: Model) -> Model:
        """Leave out effects that the others have made needless."""
        for label in model.labels:
            if len(model.labels) < 2:
                break
            acting = tuple(a for a in model.acting if a.label != label)
            opened = tuple(o for o in model.opened if o.candidate.label != label)
            less = fit(self.data, acting, opened, start=model.level)
            freedom = max(len(model.covariance) - len(less.covariance), 1)
            loss = max(2.0 * (less.nll - model.nll), 0.0)
            scores = gram(self.data, less, self.free_signatures(less), less.level)
            if log_p_of(loss, freedom) > self.threshold(scores):
                model = less
        return model


def clearly_better(new: Model, old: Model) -> bool:
    """Whether another effect in the place of one fits better by more than its freedom and luck."""
    extra = len(new.covariance) - len(old.covariance)
    return old.nll - new.nll > RIVAL_NATS * (1 + max(extra, 0))


def ladder(data: Data, model: Model) -> list[NoiseLevel]:
    """Noise models to screen under: as fitted, and with the slow part as small as can be.

    Slow noise fitted while an effect is missing has swallowed part of it.
    """
    spec = as_specified(data.structure)
    kept = replace(
        spec,
        size=model.level.size,
        factor=tuple(max(f, 0.3) for f in model.level.factor),
    )
    return [model.level, kept]


def preferred(trials: Sequence[Trial]) -> Trial | None:
    """The least likely by chance; among those that are as good, the commonest in practice."""
    if not trials:
        return None
    lasting = [t for t in trials if t.candidate.effect.name not in WANDERING]
    least = min(t.log_p for t in trials)
    if lasting and min(t.log_p for t in lasting) <= least + WANDER_NATS:
        trials, least = lasting, min(t.log_p for t in lasting)
    close = [t for t in trials if t.log_p <= least + AS_GOOD_NATS]
    return min(close, key=lambda t: (commonness(t.candidate), t.log_p, t.candidate.label))


def plausible(model: Model) -> bool:
    """Whether every fitted parameter is of a size that its effect can have."""
    for one in model.acting:
        for p in one.effect.slopes():
            value = one.values[p.name]
            if abs(value) > p.high or (not p.signed and value < 0.0):
                return False
    return all(_mean_and_scatter_agree(model, one) for one in model.opened)


def _mean_and_scatter_agree(model: Model, opened: Opened) -> bool:
    """An effect with a mean and a scatter of one parameter needs both to say the same."""
    for one in model.acting:
        if one.label == opened.candidate.label:
            value = one.values[one.effect.parameters[0].name]
            return abs(model.level.size[opened.directed] - value) < AGREE * value
    return True


def located(data: Data, model: Model) -> Model:
    """Refine where the newest effect starts, by halving the grid around the best place."""
    last = model.acting[-1]
    name = next(p.name for p in last.effect.parameters if p.located)
    since = data.view.log.time_s - data.view.log.time_s[0]
    first, last_time = np.quantile(since, [EDGE, 1.0 - EDGE])
    reach = (last_time - first) / STEP_TIMES
    best = model
    for _ in range(4):
        centre = best.acting[-1].values[name]
        low, high = max(centre - reach, first), min(centre + reach, last_time)
        for t in np.linspace(low, high, 7):
            moved = replace(best.acting[-1], values={**best.acting[-1].values, name: float(t)})
            trial = refitted(data, (*best.acting[:-1], moved), best)
            best = trial if trial.nll < best.nll else best
        reach /= 3.5
    return best


def refitted(data: Data, acting: tuple[Acting, ...], like: Model) -> Model:
    """The same noise, other effects, one adjustment."""
    now, error, covariance = adjusted(data, acting, like.precision, data.error(acting), steps=1)
    nll = like.precision.negative_log_likelihood(error)
    return replace(like, acting=now, error=error, covariance=covariance, nll=nll)


def start_search(
    data: Data, settings: DiagnosisSettings, progress: Callable[[float], None]
) -> Search:
    """Candidates and signatures of a log."""
    found = candidates(data.view, settings.exclude_effects)
    rng = np.random.Generator(np.random.Philox(settings.seed))
    shown = signatures(data.view, found)
    return Search(data, settings, rng, found, shown, progress)
