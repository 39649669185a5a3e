"""Which effects are missing: forward and backward search over whole effects.

Each step adds the proposal that best explains what is left, if it beats what the largest of all
candidates' scores reaches by chance on this very trajectory; rivals of what its company moves are
tried in its place, and what is no longer needed goes at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from syncline_design.diagnosis.borrowed import noisier_scenes
from syncline_design.diagnosis.candidates import (
    Signature,
    candidates,
    signatures,
)
from syncline_design.diagnosis.episodes import Episode, episode_effect, episodes, with_episodes
from syncline_design.diagnosis.fitting import Data, Model, finely, fit
from syncline_design.diagnosis.identity import without
from syncline_design.diagnosis.pairs import TRIED as TRIED_PAIRS
from syncline_design.diagnosis.pairs import clear_nats, clearly_two, in_the_place, with_pair
from syncline_design.diagnosis.parts import cut_down
from syncline_design.diagnosis.proposals import Label, Proposals
from syncline_design.diagnosis.range_tails import RangeTails, range_tails, with_range_tails
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.diagnosis.settling import Settled, borne_out, settle
from syncline_design.diagnosis.slow_states import States, fitted_of, slow_states
from syncline_design.diagnosis.spans import acts_at
from syncline_design.diagnosis.trials import (
    plausible,
)
from syncline_design.diagnosis.unlike_readings import (
    Unlike,
    factor_effect,
    unlike_readings,
    with_unlike,
)
from syncline_design.diagnosis.wandering import wanderings
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator

MOVED = 2.0  # standard uncertainties by which an effect has to move for its rivals to be tried
VARIES = 0.1  # of an effect's value, by which it has to vary to be said to
FALLEN = 2  # times that the search goes on for what may be in the place of what fell
EPISODES = 7  # key of the draws that look for them
RIVAL_NATS = 4.5  # a rival whose fit is worse by less than this cannot be told apart


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
    """A running search over one log.

    proposals: what may be added; its data learn of uneven noise on the way.
    """

    proposals: Proposals
    progress: Callable[[float], None]
    episodes: tuple[Episode, ...] | None = None  # None until they were looked for
    unlike: tuple[Unlike, ...] | None = None  # the same
    range_tails: tuple[RangeTails, ...] | None = None  # the same

    @property
    def data(self) -> Data:
        return self.proposals.data

    @property
    def settings(self) -> DiagnosisSettings:
        return self.proposals.settings

    @property
    def states(self) -> States:
        return self.proposals.states

    @property
    def signatures(self) -> tuple[Signature, ...]:
        return self.proposals.signatures

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

        Each is fitted and tested here; those that do not stand go, then the search goes on.  One
        cut to a stretch of which no row is here says nothing of these rows, and goes first.
        """
        time_s = self.data.view.log.time_s
        here = [one for one in found.acting if acts_at(one.effect, time_s)]
        model = fit(self.data, here, found.opened, start=found.level)
        tried = self.proposals
        model = borne_out(self.data, model, self.states, tried.threshold_at, tried.stands)
        return self.grown(model, model)[1]

    def grown(self, base: Model, model: Model) -> tuple[Model, Model]:
        """The two models, the second with all that beats chance, one after the other."""
        while len(model.labels) < self.settings.max_effects:
            tried, scores = self.proposals, self.proposals.scores(model)
            threshold = tried.threshold(scores)
            trial = tried.moving(model, scores, threshold)
            if trial is None and self.episodes is None and self.with_uneven_noise(model):
                base = fit(self.data)
                model = fit(self.data, model.acting, model.opened, start=model.level)
                continue
            trial = trial or tried.noise(model, threshold)
            if trial is None:
                two = self.in_two(model)
                if two is None:
                    break
                model = two
                continue
            model = cut_down(self.states, self.exchanged(trial.model, model))
            in_force().doing("searching beyond " + ", ".join(name for name, *_ in model.labels))
            self.progress(len(model.labels) / self.settings.max_effects)
        return base, model

    def settled(self, model: Model) -> Settled:
        """The final model: its classes decided, its evidence counted, needless effects gone.

        Where one went that has nothing in its place, it was not the cause, and stood in the way of
        what may be: the search goes on without it.
        """
        final = self.once_settled(model)
        for _ in range(FALLEN):
            if len(final.model.labels) >= len(model.labels):
                break
            self.proposals = self.proposals.less({*model.labels} - {*final.model.labels})
            left = fit(self.data, final.model.acting, final.model.opened, start=final.model.level)
            model = self.grown(left, left)[1]
            if set(model.labels) == set(final.model.labels):
                break
            final = self.once_settled(model)
        found = wanderings(final.data, final.model, VARIES, self.settings.seed)
        return replace(final, wandering=found)

    def once_settled(self, model: Model) -> Settled:
        """The same, of one model."""
        fine = finely(self.data)
        start = fit(fine, model.acting, model.opened, start=model.level)
        tried = self.proposals
        threshold = replace(tried, data=fine).threshold_at
        return settle(
            fine, start, self.signatures, threshold, self.states, tried.stands, tried.fallen
        )

    def with_uneven_noise(self, model: Model) -> bool:
        """Look once for ranges far off, for noise that is larger in some readings, or for a while;
        whether there is any."""
        if self.range_tails is None:
            self.range_tails = range_tails(self.data, model, self.proposals.may_have_range_tails)
            if self.range_tails:
                self.proposals = self.proposals.with_data(
                    with_range_tails(self.data, self.range_tails)
                )
                return True
        if self.unlike is None:
            wanted = factor_effect().name not in self.settings.exclude_effects
            self.unlike = unlike_readings(self.data, model) if wanted else ()
            if self.unlike:
                self.proposals = self.proposals.with_data(with_unlike(self.data, self.unlike))
                return True
        return self.with_episodes(model)

    def with_episodes(self, model: Model) -> bool:
        """Look for noise that is larger for a while, once; whether the data have it now."""
        rng = generator([self.settings.seed, EPISODES])
        wanted = episode_effect().name not in self.settings.exclude_effects
        self.episodes = episodes(self.data, model, rng) if wanted else ()
        if self.episodes:
            self.proposals = self.proposals.with_data(with_episodes(self.data, self.episodes))
        return bool(self.episodes)

    def exchanged(self, model: Model, before: Model) -> Model:
        """Try the rivals of every earlier effect that its new company moves, in its place."""
        for one in moved(model, before):
            k = [a.label for a in model.acting].index(one)
            rest = tuple(a for i, a in enumerate(model.acting) if i != k)
            less = fit(self.data, rest, model.opened, start=model.level)
            rungs = self.proposals.rungs(less, self.proposals.scores(less))
            for s, level in self.proposals.screened(less, rungs):
                if s.candidate.label == one:
                    break  # what gains less to first order is no better
                if s.candidate.effect.kind == "stochastic":
                    continue
                trial = self.proposals.trial(less, s, level)
                model = self.at_least(model, trial.model)
                if plausible(self.data, trial.model) and clearly_better(trial.model, model):
                    model = trial.model
                    break
        return model

    def in_two(self, model: Model) -> Model | None:
        """The model with two effects where one stood for both; None where none does."""
        for one in model.acting:
            rest = without(model, one.label)
            rest = replace(rest, error=self.data.error(rest.acting))
            free = [s for s in self.proposals.free_signatures(rest)
                    if s.asked_jointly or s.candidate.label == one.label]  # fmt: skip
            rungs = self.proposals.rungs_of(rest, free)
            worth = cache(partial(clear_nats, self.data, free))
            for pair in in_the_place(rungs, free, one.label, worth)[:TRIED_PAIRS]:
                two = with_pair(self.data, rest, pair)
                if (
                    clearly_two(self.data, two, self.at_least(model, two), free)
                    and plausible(self.data, two)
                    and self.proposals.stand_all(two, [s.candidate.label for s in pair.pair])
                ):
                    return two
        return None

    def at_least(self, model: Model, rival: Model) -> Model:
        """A model, in the noise of one that seems clearly better where that suits it better.

        Two levels that are as good on the rows they are fitted to may differ on all others.
        """
        if not clearly_better(rival, model):
            return model
        again = fit(self.data, model.acting, model.opened, start=rival.level)
        return again if again.nll < model.nll else model


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


def start_search(
    data: Data, settings: DiagnosisSettings, progress: Callable[[float], None]
) -> Search:
    """Candidates and signatures of a log."""
    found = candidates(data.view, settings.exclude_effects)
    rng = generator(settings.seed)
    data = replace(data, noisier=noisier_scenes(data.view, rng.spawn(1)[0]))
    shown = signatures(data.view, found)
    return Search(Proposals(data, settings, rng, found, shown, slow_states(data)), progress)
