"""Runs of a system in their order: their sums, the noise inside them, how each effect scatters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from syncline_design.campaign.constants import PLAUSIBLE, shown_constants
from syncline_design.campaign.differing_odds import log_odds_of
from syncline_design.campaign.freed_runs import marginal, pseudo_inverse
from syncline_design.campaign.looks import KeptLook
from syncline_design.campaign.parts import EffectPart, parts_of, with_singles
from syncline_design.campaign.pool import Pool, Term, inverted
from syncline_design.campaign.run_records import Change, Runs, SameSize
from syncline_design.campaign.scatter import EffectInRuns, RunScatter, scattered
from syncline_design.campaign.within_runs import scatter_within
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, eq=False)
class RunSums:
    """Runs of a system in their order.

    kept: what looks at the first of these runs found, so that none of it is computed again.
    beside: changes that are taken off; what is left of each is free beside all others, or the first
    that is told would keep what it took of the second.
    """

    pool: Pool
    kept: tuple[KeptLook, ...] = ()
    beside: tuple[Change, ...] = ()

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        return self.pool.terms

    @cached_property
    def groups(self) -> tuple[SameSize, ...]:
        """The terms by size: small matrices of one size are worked on at once."""
        sizes = sorted({term.size for term in self.terms})
        places = [[k for k, t in enumerate(self.terms) if t.size == size] for size in sizes]
        return tuple(
            SameSize(np.array(own), np.array([self.terms[k].index for k in own])) for own in places
        )

    @cached_property
    def parts(self) -> tuple[EffectPart, ...]:
        """What may differ from run to run: every effect, and its single parameters."""
        return parts_of(self.terms)

    @cached_property
    def part_groups(self) -> tuple[SameSize, ...]:
        return with_singles(self.groups, self.parts)

    @cached_property
    def prior(self) -> Array:
        """Prior information of what may have any value that it can have, (P,)."""
        found = np.zeros(len(self.pool.labels))
        for term in self.terms:
            found[term.index] = [p.high**-2.0 for p in term.effect.slopes()]
        return found

    @cached_property
    def within(self) -> Array:
        """Variance by the scatter of parts over that fitted, of every run and effect, (L, C)."""
        known = [np.array(look.within) for look in self.kept[: self.pool.count]]
        rest = [self.within_of(run) for run in range(len(known), self.pool.count)]
        return np.array([*known, *rest]).reshape(self.pool.count, len(self.terms))

    def within_of(self, run: int) -> Array:
        """The same of one run, (C,)."""
        if not self.pool.less[run]:
            return np.ones(len(self.terms))
        known = pseudo_inverse(self.pool.normal[run] + np.diag(self.prior))
        return scatter_within(self.pool, run, self.groups, known)

    def inside(self, look: int) -> Array:
        """Variance by the scatter of the parts of runs over that fitted, (C,)."""
        return np.asarray(np.maximum(1.0, self.within[:look].mean(axis=0)))

    def _log_odds(self, look: int, runs: Runs, parts: Sequence[EffectPart], *off: Change) -> Array:
        """log p_a L_a of some parts by each of APART, (U, S), of runs less what changes make."""
        return log_odds_of(runs, parts, self.inside(look), off)

    def _compared(self, look: int, normal: Array, score: Array, *likely: Change) -> Runs:
        """Runs, with Cochran's Q of each effect alone, the values of all others those of these runs
        together, less what likely changes make; beside every course of the effect, and alone."""
        total = self.total(look, normal, score)
        inverse = pseudo_inverse(total)
        left = score - sum(one.made(normal) for one in likely)
        left = left - normal @ (inverse @ left.sum(axis=0))
        found = []
        inside_parts = self.inside(look)[[part.place for part in self.parts]]
        for g in self.part_groups:
            blocks = normal[:, *g.blocks]
            squares = scattered(blocks, inverted(blocks), left[:, g.index])
            seen = np.sum(np.einsum("rgaa->rga", blocks) > 0.0, axis=-1)
            inside = inside_parts[g.terms]
            own = EffectInRuns(blocks, left[:, g.index], seen, inside)
            found.append(RunScatter.of(squares / inside, own))
        return Runs(normal, score, total, inverse, tuple(found[: len(self.groups)]), tuple(found))

    def total(self, look: int, normal: Array, score: Array) -> Array:
        """Information of runs, with the prior of what they show; what is beside is free."""
        found, size = normal.sum(axis=0), len(self.pool.labels)
        total, scores = marginal(found, score.sum(axis=0), size)
        prior, held = np.diag(found)[:size] / PLAUSIBLE**2, np.zeros_like(total)
        groups = tuple((g.terms, g.index) for g in self.groups)
        for one in shown_constants(total, scores, groups, self.inside(look)):
            prior[one.index] = 0.0
            held[np.ix_(one.index, one.index)] = one.prior
        found[:size, :size] += held + np.diag(np.maximum(prior, self.prior))
        return np.asarray(found)
