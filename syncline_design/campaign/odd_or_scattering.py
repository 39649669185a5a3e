"""Whether some logs are unlike the others in an effect, or all have another value of it.

Both free the effect, in the odd logs or in every log, by values of their own that are normal about
the common one, of covariance S = size^2 times what one log leaves unsure.  With L the likelihood
ratio of that against one value in all (`scatter.log_differing`), every size as likely as the next,
    odds = p_all sum L_all / (p_odd^k sum L_odd),
k logs being odd.  Logs that agree by chance while the effect scatters lose what they would gain by
values of their own, so that few that agree are no proof of one value, and many are.
Source: Kass and Raftery, J. Am. Stat. Assoc. 90 (1995), on Bayes factors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.parts import parts_of
from syncline_design.campaign.pool import Index, Pool, Term, inverted
from syncline_design.campaign.scatter import DIFFERING, log_differing
from syncline_design.effects.record import Array

ODD: Final = 0.1  # how often a log is unlike the others: one day in ten
SIZES: Final = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # standard deviations of a log


def rather_scatters(pool: Pool, beside: Sequence[Term], odd: Index, term: Term) -> bool:
    """Whether an effect rather has another value in every log than in the odd ones alone.

    beside: effects that have one value in all.
    """
    every = np.arange(pool.count)
    kept = np.concatenate([term.index, *(one.index for one in beside)])
    normal, score = pool.normal[:, kept[:, None], kept], pool.score[:, kept]
    scattering = math.log(DIFFERING) + _log_apart(normal, score, term, every)
    return scattering > len(odd) * math.log(ODD) + _log_apart(normal, score, term, odd)


def _log_apart(normal: Array, score: Array, term: Term, rows: Index) -> float:
    """log sum L of some logs, over sizes and parts of an effect, whose parameters come first."""
    usual, prior = normal.mean(axis=0), np.zeros(normal.shape[1:])
    found = []
    for part in parts_of([term]):
        unsure = inverted(usual[np.ix_(part.own, part.own)])
        own = log_differing(normal, score, prior, part.own, unsure, SIZES, rows)
        found.append(part.log_share + own)
    return float(np.logaddexp.reduce(np.ravel(found)))
