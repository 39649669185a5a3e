"""Odds that a part of an effect has another value in every run (`changes`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.campaign.parts import EffectPart
from syncline_design.campaign.pool import inverted
from syncline_design.campaign.run_records import Change, Differing, Runs
from syncline_design.campaign.scatter import APART, log_differing, log_odds_apart
from syncline_design.effects.record import Array


def log_odds_of(
    runs: Runs, parts: Sequence[EffectPart], inside: Array, off: Sequence[Change] = ()
) -> Array:
    """log p_a L_a of some parts, by each of APART, (U, S); off: changes that are taken off first.

    inside (C,): variance inside runs over that fitted, of every effect.
    """
    prior = runs.total - runs.normal.sum(axis=0)
    score = runs.score - sum(one.made(runs.normal) for one in off)
    usual = runs.normal.mean(axis=0)
    found = np.zeros((len(parts), len(APART)))
    for k, part in enumerate(parts):
        factor, index = inside[part.place], part.index
        spread = inverted(usual[np.ix_(index, index)]) * factor
        own = runs.normal / factor, score / factor, prior / factor
        found[k] = log_differing(*own, index, spread) + part.log_share
    return np.asarray(found + log_odds_apart(len(inside)))


def log_of_any(odds: Array) -> float:
    """log (1 + sum p_a L_a): that some part differs, or none does."""
    return float(np.logaddexp.reduce([0.0, *odds.ravel()]))


def likeliest_of(runs: Runs, parts: Sequence[EffectPart], odds: Array) -> Differing:
    """The part that most likely differs from run to run, by the likeliest of APART."""
    k, size = np.unravel_index(int(np.argmax(odds)), odds.shape)
    part, usual = parts[int(k)], runs.normal.mean(axis=0)
    own = inverted(usual[np.ix_(part.index, part.index)])
    covariance = part.covariance(APART[int(size)] ** 2 * own)
    return Differing(part.term, covariance, part.term, covariance, 0.0)


def log_of_sizes(values: Array, covariance: Array, usual: Array) -> float:
    """log sum q N(d; 0, C + S) / N(d; d, C) over the covariances S = APART^2 `usual`, with q their
    shares: what not knowing the size of d, of covariance C, makes of its odds."""
    shares = log_odds_apart(1)
    found = []
    for size, share in zip(APART, shares - np.logaddexp.reduce(shares), strict=True):
        spread = covariance + size**2 * usual
        held = float(values @ inverted(spread) @ values)
        wide = np.linalg.slogdet(np.eye(len(values)) + inverted(covariance) @ (spread - covariance))
        found.append(float(share) - 0.5 * (held + float(wide[1])))
    return float(np.logaddexp.reduce(found))
