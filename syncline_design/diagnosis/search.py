"""Which effects are missing: forward and backward search over whole effects.

Each candidate is scored as a whole (all its parameters at once) under a ladder of noise models, the
best few are fitted with the noise fitted anew, and the best of these is accepted if it beats what
the largest of all candidates' scores reaches by chance on this very trajectory.  An effect that
moves the mean must stand up in slow noise that is not the model's as well (`slow_states`), and goes
before any noise: a noise that wanders takes the shape of whatever is missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.borrowed import noisier_scenes
from syncline_design.diagnosis.candidates import (
    STEP_TIMES,
    Candidate,
    Signature,
    candidates,
    commonness,
    signatures,
)
from syncline_design.diagnosis.episodes import Episode, episode_effect, episodes, with_episodes
from syncline_design.diagnosis.fitting import Data, Model, Opened, finely, fit
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.lines import LINE, best_wave
from syncline_design.diagnosis.noise import NoiseLevel, as_specified
from syncline_design.diagnosis.pairs import TRIED as TRIED_PAIRS
from syncline_design.diagnosis.pairs import promising, standing, with_pair
from syncline_design.diagnosis.parts import NATS, STRETCHES, cut_down, in_a_part, refined
from syncline_design.diagnosis.scores import Gram, clean_threshold, gram, possible
from syncline_design.diagnosis.settling import Settled, borne_out, settle, weaker_judged
from syncline_design.diagnosis.slow_states import States, fitted_of, slow_states
from syncline_design.diagnosis.spans import span_of
from syncline_design.diagnosis.tails import tails_in
from syncline_design.diagnosis.trials import (
    freedom_of,
    log_chance,
    plausible,
    scatter_candidates,
    with_effect,
)
from syncline_design.diagnosis.unlike_readings import (
    Unlike,
    factor_effect,
    unlike_readings,
    with_unlike,
)
from syncline_design.diagnosis.wandering import wanderings
from syncline_design.effects.record import Effect
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator

JUDGED = 6  # candidates that are judged at a time
TRIED = 4  # candidates fitted with their own noise per step
SCREENED_OUT = 6.0  # gain [nat] below which a candidate is not fitted
WITHIN_NATS, WITHIN_SHARE = 12.0, 0.35  # how far behind the best a candidate may be to be fitted
MEAN_SHARE = 0.6  # of the false-alarm rate for effects that move the mean
WANDER_NATS = (
    15.0  # slow noise can take the shape of anything slow, so it has to be that much better
)
TAILS_NATS = 10.0  # by which Student's t has to be better than the normal
AS_GOOD_NATS = 2.0  # difference in log p within which the commoner of two effects is named
MOVED = 2.0  # standard uncertainties by which an effect has to move for its rivals to be tried
PAIRS = 8  # effects two by two that are judged by slow states, the likeliest ones
VARIES = 0.1  # of an effect's value, by which it has to vary to be said to
EPISODES = 7  # key of the draws that look for them
RIVAL_NATS = 4.5  # a rival whose fit is worse by less than this cannot be told apart

Label = tuple[str, str, int]
Rung = tuple[NoiseLevel, Gram]  # a noise model to screen under, and the scores under it
SearchProgress = Callable[[str, float], None]  # (what is being done, share done 0..1)


def silent(_: str, __: float) -> None:
    """No progress shown."""


@dataclass(frozen=True, slots=True)
class DiagnosisSettings:
    """seed: of everything drawn.  false_alarm_rate: chance that a clean log is found at fault.

    max_effects: how many effects are named at most.  exclude_effects: names that must not be used.
    unseen_block: whether to search once more without a block of the log, to judge on it.
    """

    seed: int = 0
    false_alarm_rate: float = 0.05
    max_effects: int = 8
    exclude_effects: tuple[str, ...] = ()
    unseen_block: bool = True


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
        return log_chance(self.candidate.effect, self.gain, self.freedom)


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The model without effects, and what was found."""

    base: Model
    final: Settled

    @property
    def model(self) -> Model:
        return self.final.model


@dataclass(slots=True)
class Search:
    """A running search over one log."""

    data: Data
    settings: DiagnosisSettings
    rng: np.random.Generator
    candidates: tuple[Candidate, ...]
    signatures: tuple[Signature, ...]
    states: States
    progress: Callable[[float], None]
    episodes: tuple[Episode, ...] | None = None  # None until they were looked for
    unlike: tuple[Unlike, ...] | None = None  # the same

    def run(self) -> SearchResult:
        """Add effects while they beat chance; then take out what is no longer needed."""
        base, model = self.searched()
        return SearchResult(base, self.settled(model))

    def searched(self) -> tuple[Model, Model]:
        """The model without effects, and with all that beat chance, one after the other."""
        base = fit(self.data)
        return self.grown(base, base)

    def confirmed(self, found: Model) -> Model:
        """The effects of a model of other rows as far as these rows bear them out, and what else.

        Each is fitted and tested here; those that do not stand go, then the search goes on.
        """
        model = fit(self.data, found.acting, found.opened, start=found.level)
        model = borne_out(self.data, model, self.states, self.threshold_at, self.stands)
        return self.grown(model, model)[1]

    def grown(self, base: Model, model: Model) -> tuple[Model, Model]:
        """The two models, the second with all that beats chance, one after the other."""
        while len(model.labels) < self.settings.max_effects:
            scores = gram(self.data, model, self.free_signatures(model), model.level)
            threshold = self.threshold(scores)
            trial = self.moving(model, scores, threshold)
            if trial is None and self.episodes is None and self.with_uneven_noise(model):
                base = fit(self.data)
                model = fit(self.data, model.acting, model.opened, start=model.level)
                continue
            trial = trial or self.noise(model, threshold)
            if trial is None:
                break
            model = cut_down(self.states, self.exchanged(trial.model, model))
            in_force().doing("searching beyond " + ", ".join(name for name, *_ in model.labels))
            self.progress(len(model.labels) / self.settings.max_effects)
        return base, model

    def settled(self, model: Model) -> Settled:
        """The final model: its classes decided, its evidence counted, needless effects gone."""
        fine = finely(self.data)
        start = fit(fine, model.acting, model.opened, start=model.level)

        def threshold(less: Model) -> float:
            return self.threshold(gram(fine, less, self.free_signatures(less), less.level))

        final = settle(fine, start, self.signatures, threshold, self.states, self.stands)
        found = wanderings(final.data, final.model, VARIES, self.settings.seed)
        return replace(final, wandering=found)

    def stands(self, one: Judged, effect: Effect) -> bool:
        """Whether noise of another kind would not show as much of an effect by chance."""
        charge = math.log(STEP_TIMES) if any(p.located for p in effect.parameters) else 0.0
        return one.log_p + charge < self.chance(len({s.candidate.label for s in self.signatures}))

    def threshold_at(self, model: Model) -> float:
        """log p that the best of what a model does not hold falls below in a clean log."""
        return self.threshold(gram(self.data, model, self.free_signatures(model), model.level))

    def threshold(self, scores: Gram) -> float:
        """log p that the best candidate of a clean log falls below at the stated rate."""
        return clean_threshold(scores, MEAN_SHARE * self.settings.false_alarm_rate, self.rng)

    def free_signatures(self, model: Model) -> list[Signature]:
        """Signatures of what the model does not hold yet."""
        return [s for s in self.signatures if s.candidate.label not in model.labels]

    def with_uneven_noise(self, model: Model) -> bool:
        """Look once for noise that is larger in some readings, or for a while; whether it is."""
        if self.unlike is None:
            wanted = factor_effect().name not in self.settings.exclude_effects
            self.unlike = unlike_readings(self.data, model) if wanted else ()
            if self.unlike:
                self.data = with_unlike(self.data, self.unlike)
                self.states = slow_states(self.data)
                return True
        return self.with_episodes(model)

    def with_episodes(self, model: Model) -> bool:
        """Look for noise that is larger for a while, once; whether the data have it now."""
        rng = generator([self.settings.seed, EPISODES])
        wanted = episode_effect().name not in self.settings.exclude_effects
        self.episodes = episodes(self.data, model, rng) if wanted else ()
        if self.episodes:
            self.data = with_episodes(self.data, self.episodes)
            self.states = slow_states(self.data)
        return bool(self.episodes)

    def moving(self, model: Model, scores: Gram, threshold: float) -> Trial | None:
        """The candidate that best explains what is left, its noise fitted anew; none beats chance.

        Effects that act in all of the log go first, then those in a part of it, then waves without
        a name; noise comes after all of them.
        """
        rungs = self.rungs(model, scores)
        moving = [self.trial(model, s, level) for s, level in self.screened(model, rungs)]
        kept = [t for t in moving if t.log_p <= threshold and plausible(self.data, t.model)]
        best = preferred(kept) or self.swallowed(model, scores, threshold)
        if best is None:
            both = [self.part_trial(model), self.pair_trial(model, rungs, threshold)]
            found = min([t for t in both if t], key=lambda t: t.log_p, default=None)
            return found or self.wave_trial(model)
        return self.not_for_good(model, best)

    def swallowed(self, model: Model, scores: Gram, threshold: float) -> Trial | None:
        """An effect that slow courses sized without it have taken up, if it stands once fitted.

        By the likelihood it has to beat chance in noise that was fitted without it as well.  Not
        beside a named one: if that is not the true one, others fit what it leaves.
        """
        if model.acting:
            return None
        wanted = beyond_chance(self.free_signatures(model), scores, threshold)[:TRIED]
        trials = [self.trial(model, s, model.level) for s in wanted]
        kept = [t for t in trials if t.log_p <= threshold and plausible(self.data, t.model)]
        return preferred([t for t in kept if self.stands_fitted(t)])

    def stands_fitted(self, trial: Trial) -> bool:
        """Whether the effect of a trial stands beside slow courses that are sized with it."""
        judged = weaker_judged(self.data, trial.model, self.states)
        return all(
            self.stands(one, a.effect) for a, one in judged if a.label == trial.candidate.label
        )

    def not_for_good(self, model: Model, found: Trial) -> Trial:
        """A trial, or what goes back after a while in the place of a step that does not.

        The other end is one more place to look for, and has to pay for it.
        """
        if not any(p.located for p in found.candidate.effect.parameters):
            return found
        part = self.part_trial(model)
        if part is None or part.gain - found.gain < NATS + math.log(STRETCHES):
            return found
        span = span_of(part.model.acting[-1].effect)
        ends = span is not None and span.to_s < self.data.view.log.time_s[-1]
        return part if ends else found

    def noise(self, model: Model, threshold: float) -> Trial | None:
        """The noise that best explains how what is left scatters; none beats chance."""
        found = [t for t in self.scatter_trials(model) if plausible(self.data, t.model)]
        return preferred([t for t in found if t.log_p <= threshold])

    def standing(self, model: Model, asked: Sequence[Signature], limit: float) -> set[Label]:
        """Effects that noise of another kind would not show by chance.

        limit: log p for one of all candidates (Bonferroni); a step pays for its places as well.
        """
        judged = self.states.judged(model, [s.columns for s in asked])
        return {
            s.candidate.label
            for s, one in zip(asked, judged, strict=True)
            if one.log_p + (math.log(STEP_TIMES) if s.at else 0.0) < limit
        }

    def chance(self, candidates: int) -> float:
        """log p that one of so many candidates falls below at the stated rate, at most."""
        return math.log(MEAN_SHARE * self.settings.false_alarm_rate / max(candidates, 1))

    def rungs(self, model: Model, scores: Gram) -> list[Rung]:
        """Scores of what the model does not hold under every noise of the ladder."""
        free = self.free_signatures(model)
        return [
            (level, scores if level is model.level else gram(self.data, model, free, level))
            for level in ladder(self.data, model)
        ]

    def screened(self, model: Model, rungs: Sequence[Rung]) -> list[tuple[Signature, NoiseLevel]]:
        """Signatures that gain most under any noise of the ladder, one per candidate."""
        free = self.free_signatures(model)
        best: dict[Label, tuple[float, Signature, NoiseLevel]] = {}
        for level, seen in rungs:
            for s, (gain, values) in zip(free, seen.gains(), strict=True):
                if gain <= SCREENED_OUT or not possible(s, values):
                    continue
                total = gain - seen.nll - 2.0 * s.columns.shape[2] - 4.0 * len(s.at)
                known = best.get(s.candidate.label)
                if known is None or known[0] < total:
                    best[s.candidate.label] = (total, s, level)
        ranked = sorted(best.values(), key=lambda entry: -entry[0])
        return [(s, level) for _, s, level in self.first_standing(model, free, ranked)]

    def first_standing(
        self,
        model: Model,
        free: Sequence[Signature],
        ranked: Sequence[tuple[float, Signature, NoiseLevel]],
    ) -> list[tuple[float, Signature, NoiseLevel]]:
        """The first few that noise of another kind would not show by chance, near the first.

        They are judged a few at a time, for most never come into it.
        """
        limit = self.chance(len({s.candidate.label for s in free}))
        kept: list[tuple[float, Signature, NoiseLevel]] = []
        for at in range(0, len(ranked), JUDGED):
            reach = max(WITHIN_NATS, WITHIN_SHARE * (kept[0][0] + model.nll)) if kept else math.inf
            if len(kept) >= TRIED or (kept and ranked[at][0] <= kept[0][0] - reach):
                break
            part = ranked[at : at + JUDGED]
            labels = {s.candidate.label for _, s, _ in part}
            asked = [s for s in free if s.candidate.label in labels]
            standing = self.standing(model, asked, limit)
            kept += [entry for entry in part if entry[1].candidate.label in standing]
        if not kept:
            return []
        reach = max(WITHIN_NATS, WITHIN_SHARE * (kept[0][0] + model.nll))
        return [entry for entry in kept if entry[0] > kept[0][0] - reach][:TRIED]

    def trial(
        self, model: Model, found: Signature, level: NoiseLevel, *, parted: bool = False
    ) -> Trial:
        """The model with this candidate, fitted by re-simulation; parted: in a part of the log."""
        fitted = with_effect(self.data, model, found, level)
        fitted = refined(self.states, fitted) if parted else fitted
        freedom = freedom_of(found.candidate.effect)
        return Trial(found.candidate, fitted, model.nll - fitted.nll, freedom)

    def part_trial(self, model: Model) -> Trial | None:
        """The model with an effect that acts in a part of the log alone."""
        free = self.free_signatures(model)
        limit = self.chance(len({s.candidate.label for s in self.signatures}))
        found = in_a_part(self.states, model, free, limit, ladder(self.data, model))
        trials = [self.trial(model, one, model.level, parted=True) for one in found]
        kept = [t for t in trials if t.gain > WANDER_NATS and plausible(self.data, t.model)]
        return preferred(kept)

    def pair_trial(self, model: Model, rungs: Sequence[Rung], threshold: float) -> Trial | None:
        """The model with two effects more, neither of which shows without the other."""
        found = promising(rungs, self.free_signatures(model), threshold)[:PAIRS]
        limit = self.chance(len({s.candidate.label for s in self.signatures}))
        trials = []
        for one in standing(self.states, model, found, limit)[:TRIED_PAIRS]:
            fitted = with_pair(self.data, model, one)
            freedom = sum(freedom_of(s.candidate.effect) for s in one.pair)
            trial = Trial(one.pair[0].candidate, fitted, model.nll - fitted.nll, freedom)
            if trial.log_p <= threshold and plausible(self.data, fitted):
                trials.append(trial)
        return min(trials, key=lambda t: t.log_p, default=None)

    def wave_trial(self, model: Model) -> Trial | None:
        """The model with a wave that stands out of what is left, before any noise takes it up."""
        if LINE in self.settings.exclude_effects:
            return None
        found = best_wave(self.data, model)
        if found is None:
            return None
        (judged,) = self.states.judged(model, [found.columns])
        if not judged.log_p < self.chance(len({s.candidate.label for s in self.signatures})):
            return None
        trial = self.trial(model, found, model.level)
        return trial if trial.gain > WANDER_NATS else None

    def scatter_trials(self, model: Model) -> list[Trial]:
        """Candidates that only change the covariance, if a rough guess gains anything."""
        trials = []
        for one, level in scatter_candidates(self.data, self.candidates, model, 1.0):
            fitted = fit(self.data, model.acting, (*model.opened, one), start=level)
            gain = model.nll - fitted.nll
            if gain > 2.0:
                trials.append(Trial(one.candidate, fitted, gain, 2 if one.what == "slow" else 1))
                trials += self.tails_trial(trials[-1])
        return trials

    def tails_trial(self, understated: Trial) -> list[Trial]:
        """Heavy tails, where the scatter is too large and Student's t describes it much better."""
        one, model = understated.candidate, understated.model
        own = (one.sensor, one.stage)
        tails = [c for c in self.candidates
                 if c.effect.opens == "tails" and (c.sensor, c.stage) == own]  # fmt: skip
        if one.effect.opens != "factor" or not tails or tails[0].label in model.labels:
            return []
        gain = tails_in(self.data, model).gain
        if gain < TAILS_NATS:
            return []
        opened = (*model.opened[:-1], Opened(tails[0], "tails"))
        return [Trial(tails[0], replace(model, opened=opened), understated.gain + gain, 2)]

    def at_least(self, model: Model, rival: Model) -> Model:
        """A model, in the noise of one that seems clearly better where that suits it better.

        Two levels that are as good on the rows they are fitted to may differ on all others.
        """
        if not clearly_better(rival, model):
            return model
        again = fit(self.data, model.acting, model.opened, start=rival.level)
        return again if again.nll < model.nll else model

    def exchanged(self, model: Model, before: Model) -> Model:
        """Try the rivals of every earlier effect that its new company moves, in its place."""
        for one in moved(model, before):
            k = [a.label for a in model.acting].index(one)
            rest = tuple(a for i, a in enumerate(model.acting) if i != k)
            without = fit(self.data, rest, model.opened, start=model.level)
            scores = gram(self.data, without, self.free_signatures(without), without.level)
            for s, level in self.screened(without, self.rungs(without, scores)):
                if s.candidate.label == one:
                    break  # what gains less to first order is no better
                if s.candidate.effect.kind == "stochastic":
                    continue
                trial = self.trial(without, s, level)
                model = self.at_least(model, trial.model)
                if plausible(self.data, trial.model) and clearly_better(trial.model, model):
                    model = trial.model
                    break
        return model


def beyond_chance(free: Sequence[Signature], scores: Gram, threshold: float) -> list[Signature]:
    """Signatures that gain more than chance would, the best of every candidate, best first."""
    best: dict[Label, tuple[float, Signature]] = {}
    for s, (gain, values) in zip(free, scores.gains(), strict=True):
        effect, label = s.candidate.effect, s.candidate.label
        if log_chance(effect, gain, freedom_of(effect)) > threshold or not possible(s, values):
            continue
        if label not in best or best[label][0] < gain:
            best[label] = (gain, s)
    return [s for _, s in sorted(best.values(), key=lambda one: -one[0])]


def moved(model: Model, before: Model) -> list[Label]:
    """Effects whose values another effect beside them moves by more than MOVED uncertainties."""
    old = {a.label: fitted_of(a) for a in before.acting}
    spread = np.sqrt(np.maximum(np.diag(before.covariance), 0.0))
    spreads, at = {}, 0
    for a in before.acting:
        spreads[a.label] = spread[at : at + len(old[a.label])]
        at += len(old[a.label])
    return [
        a.label
        for a in model.acting
        if a.label in old and np.any(np.abs(fitted_of(a) - old[a.label]) > MOVED * spreads[a.label])
    ]


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
        episodes=model.level.episodes,
        factor=tuple(max(f, 0.3) for f in model.level.factor),
    )
    return [model.level, kept]


def preferred(trials: Sequence[Trial]) -> Trial | None:
    """The least likely by chance; among those that are as good, the commonest in practice."""
    if not trials:
        return None
    lasting = [t for t in trials if not t.candidate.effect.wanders]
    least = min(t.log_p for t in trials)
    if lasting and min(t.log_p for t in lasting) <= least + WANDER_NATS:
        trials, least = lasting, min(t.log_p for t in lasting)
    close = [t for t in trials if t.log_p <= least + AS_GOOD_NATS]
    return min(close, key=lambda t: (commonness(t.candidate.label), t.log_p, t.candidate.label))


def start_search(
    data: Data, settings: DiagnosisSettings, progress: Callable[[float], None]
) -> Search:
    """Candidates and signatures of a log."""
    found = candidates(data.view, settings.exclude_effects)
    rng = generator(settings.seed)
    data = replace(data, noisier=noisier_scenes(data.view, rng.spawn(1)[0]))
    shown = signatures(data.view, found)
    return Search(data, settings, rng, found, shown, slow_states(data), progress)
