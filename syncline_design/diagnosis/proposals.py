"""What a search over effects may add next: every candidate tried, and the best that beats chance.

Each candidate is scored as a whole (all its parameters at once) under a ladder of noise models, and
the best few are fitted with the noise fitted anew.  An effect that moves the mean must stand up in
slow noise that is not the model's as well (`slow_states`), and goes before any noise: a noise that
wanders takes the shape of whatever is missing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import (
    AS_GOOD_NATS,
    STEP_TIMES,
    Candidate,
    Signature,
    commonness,
)
from syncline_design.diagnosis.fitting import Data, Model, Opened, fit
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.knocks import MOUNTED
from syncline_design.diagnosis.lines import LINE, best_wave
from syncline_design.diagnosis.noise import NoiseLevel, SensorKey, as_specified
from syncline_design.diagnosis.pairs import TRIED as TRIED_PAIRS
from syncline_design.diagnosis.pairs import promising, standing, with_pair
from syncline_design.diagnosis.parts import (
    NATS,
    STRETCHES,
    in_a_part,
    in_a_part_of_white,
    refined,
)
from syncline_design.diagnosis.scores import Gram, clean_threshold, gram, possible
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.diagnosis.settling import weaker_judged
from syncline_design.diagnosis.slow_states import States, slow_states
from syncline_design.diagnosis.spans import StampSpan, cut_to, span_of
from syncline_design.diagnosis.stretches import changed_once, in_stretches
from syncline_design.diagnosis.tails import tails_in
from syncline_design.diagnosis.trials import (
    freedom_of,
    log_chance,
    plausible,
    scatter_candidates,
    with_effect,
)
from syncline_design.effects.record import Effect
from syncline_design.machine.quick_dataclass import dataclass

JUDGED = 6  # candidates that are judged at a time
TRIED = 4  # candidates fitted with their own noise per step
SCREENED_OUT = 6.0  # gain [nat] below which a candidate is not fitted
WITHIN_NATS, WITHIN_SHARE = 12.0, 0.35  # how far behind the best a candidate may be to be fitted
MEAN_SHARE = 0.6  # of the false-alarm rate for effects that move the mean
WANDER_NATS = (
    15.0  # slow noise can take the shape of anything slow, so it has to be that much better
)
ROUGHLY = 0.5  # of what is wanted, below which no better ends of a stretch will make up for it
TAILS_NATS = 10.0  # by which Student's t has to be better than the normal
PAIRS = 8  # effects two by two that are judged by slow states, the likeliest ones

Label = tuple[str, str, int]
Rung = tuple[NoiseLevel, Gram]  # a noise model to screen under, and the scores under it


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
class Proposals:
    """What can be added to a model of one log.

    signatures: of the candidates that move the mean; states: of slow noise in this log; fallen:
    what was found and did not stand, and is not proposed again.
    """

    data: Data
    settings: DiagnosisSettings
    rng: np.random.Generator
    candidates: tuple[Candidate, ...]
    signatures: tuple[Signature, ...]
    states: States
    fallen: frozenset[Label] = frozenset()

    @property
    def may_have_range_tails(self) -> frozenset[SensorKey]:
        """Ranging sensors whose heavy tails may be named."""
        stages = self.data.view.system.stages
        return frozenset(
            (stages[c.stage].name, c.sensor)
            for c in self.candidates
            if c.effect.opens == "tails" and c.sensor == "ranging"
        )

    def less(self, fallen: Collection[Label]) -> Proposals:
        """The same without effects that were tried and did not stand."""
        return replace(self, fallen=self.fallen | frozenset(fallen))

    def with_data(self, data: Data) -> Proposals:
        """The same in the noise of other data on the same log."""
        return replace(self, data=data, states=slow_states(data))

    def scores(self, model: Model) -> Gram:
        """Of what the model does not hold yet, under its own noise."""
        return gram(self.data, model, self.free_signatures(model), model.level)

    def free_signatures(self, model: Model) -> list[Signature]:
        """Signatures of what the model does not hold yet."""
        known = self.fallen.union(model.labels)
        return [s for s in self.signatures if s.candidate.label not in known]

    def threshold_at(self, model: Model) -> float:
        """log p that the best of what a model does not hold falls below in a clean log."""
        return self.threshold(self.scores(model))

    def threshold(self, scores: Gram) -> float:
        """log p that the best candidate of a clean log falls below at the stated rate."""
        return clean_threshold(scores, MEAN_SHARE * self.settings.false_alarm_rate, self.rng)

    def chance(self, candidates: int) -> float:
        """log p that one of so many candidates falls below at the stated rate, at most."""
        return math.log(MEAN_SHARE * self.settings.false_alarm_rate / max(candidates, 1))

    def stands(self, one: Judged, effect: Effect, places: int = 1) -> bool:
        """Whether noise of another kind would not show as much of an effect by chance; places: at
        which it was looked for, but for those of a step."""
        charge = math.log(places)
        charge += math.log(STEP_TIMES) if any(p.located for p in effect.parameters) else 0.0
        return one.log_p + charge < self.chance(len({s.candidate.label for s in self.signatures}))

    def moving(self, model: Model, scores: Gram, threshold: float) -> Trial | None:
        """The candidate that best explains what is left, its noise fitted anew; none beats chance.

        Effects that act in all of the log go first, then those in a part of it, then waves without
        a name; noise comes after all of them.
        """
        rungs = self.rungs(model, scores)
        moving = [self.trial(model, s, level) for s, level in self.screened(model, rungs)]
        kept = [t for t in moving if t.log_p <= threshold and plausible(self.data, t.model)]
        best = preferred(kept) or self.swallowed(model, scores, threshold)
        best = self.part_instead(model, best)
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
        return preferred([t for t in kept if self.stand_all(t.model, [t.candidate.label])])

    def part_instead(self, model: Model, found: Trial | None) -> Trial | None:
        """A trial, or what acts in a part of the log alone that slow courses have taken up.

        It has to be clearly better than what acts all along, and to stand beside slow courses that
        are sized with it.  Not beside a named one.
        """
        if model.acting:
            return found
        least = (found.gain if found else 0.0) + WANDER_NATS + math.log(STRETCHES)
        level = ladder(self.data, model)[-1]
        free = self.free_signatures(model)
        asked = in_a_part_of_white(self.states, model, free, least, level)
        asked += self.knocked(model, free)
        trials = [self.trial(model, one, level, parted=least) for one in asked]
        kept = [t for t in trials if t.gain > least and plausible(self.data, t.model)]
        stand = [t for t in kept if self.stand_all(t.model, [t.candidate.label], STRETCHES)]
        return preferred(stand) or found

    def knocked(self, model: Model, free: Sequence[Signature]) -> list[Signature]:
        """An arm or a mounting from a moment on, or until then, where of all that is built in it is
        this that clearly changed once."""
        hit = changed_once(self.data, model, in_stretches(free))
        if hit is None or hit.signature.candidate.effect.breaks not in MOUNTED:
            return []
        span = StampSpan(hit.signature.candidate.effect, hit.from_s, hit.to_s)
        return [cut_to(span, hit.signature, self.data.view.log.time_s)]

    def stand_all(self, model: Model, labels: Collection[Label], places: int = 1) -> bool:
        """Whether effects of a model stand beside slow courses that are sized with them."""
        judged = weaker_judged(self.data, model, self.states)
        return all(self.stands(one, a.effect, places) for a, one in judged if a.label in labels)

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

    def rungs(self, model: Model, scores: Gram) -> list[Rung]:
        """Scores of what the model does not hold under every noise of the ladder."""
        free = self.free_signatures(model)
        own, *others = ladder(self.data, model)
        return [(own, scores), *((level, gram(self.data, model, free, level)) for level in others)]

    def rungs_of(self, model: Model, asked: Sequence[Signature]) -> list[Rung]:
        """The same of some signatures alone."""
        return [(level, gram(self.data, model, asked, level)) for level in ladder(self.data, model)]

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
        self, model: Model, found: Signature, level: NoiseLevel, *, parted: float = math.inf
    ) -> Trial:
        """The model with this candidate, fitted by re-simulation.

        parted: nat that it has to gain in a part of the log, whose ends are found anew if it may.
        """
        fitted = with_effect(self.data, model, found, level)
        if model.nll - fitted.nll > ROUGHLY * parted:
            fitted = refined(self.states, fitted)
        freedom = freedom_of(found.candidate.effect)
        return Trial(found.candidate, fitted, model.nll - fitted.nll, freedom)

    def part_trial(self, model: Model) -> Trial | None:
        """The model with an effect that acts in a part of the log alone."""
        free = self.free_signatures(model)
        limit = self.chance(len({s.candidate.label for s in self.signatures}))
        found = in_a_part(self.states, model, free, limit, ladder(self.data, model))
        trials = [self.trial(model, one, model.level, parted=WANDER_NATS) for one in found]
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
        """Heavy tails, where the scatter is too large and Student's t describes it much better.

        Of ranges they are told by their direction (`range_tails`).
        """
        one, model = understated.candidate, understated.model
        own = (one.sensor, one.stage)
        if one.sensor == "ranging":
            return []
        tails = [c for c in self.candidates
                 if c.effect.opens == "tails" and (c.sensor, c.stage) == own]  # fmt: skip
        if one.effect.opens != "factor" or not tails or tails[0].label in model.labels:
            return []
        gain = tails_in(self.data, model).gain
        if gain < TAILS_NATS:
            return []
        opened = (*model.opened[:-1], Opened(tails[0], "tails"))
        return [Trial(tails[0], replace(model, opened=opened), understated.gain + gain, 2)]


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
