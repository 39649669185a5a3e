"""What earlier looks at a store found, kept so that a look costs what its own run adds.

A look rests on the runs since the baseline up to its own, in their order, and on the effects that
are looked for.  Its key is a hash of all that, so that a look at other runs, in another order or by
another version is never taken for it: it is computed again.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from syncline_design import __version__
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record

METHOD: Final = "looks/11"  # another where the evidence is computed in another way
MOST_RATIO: Final = 1e30
ALIKE: Final = 1e-3  # nat, and of a variance: more than what another machine rounds otherwise


@dataclass(frozen=True, slots=True)
class KeptLook(Record):
    """What a look found: log of the evidence [nat], by effect the scatter within its last run, and
    that of all its runs, over what they are by chance."""

    key: str
    log_evidence: float
    within: tuple[float, ...]
    between: tuple[float, ...]

    @property
    def is_possible(self) -> bool:
        """Whether a look can have found that: variances are no less than by chance."""
        ratios = (*self.within, *self.between)
        return math.isfinite(self.log_evidence) and all(0.0 <= one < MOST_RATIO for one in ratios)

    def is_like(self, other: KeptLook) -> bool:
        """Whether both say the same but for rounding."""
        pairs = zip(self._figures(), other._figures(), strict=False)
        same = len(self.within) == len(other.within) and len(self.between) == len(other.between)
        return same and all(math.isclose(a, b, rel_tol=ALIKE, abs_tol=ALIKE) for a, b in pairs)

    def _figures(self) -> tuple[float, ...]:
        return (self.log_evidence, *self.within, *self.between)


def keys_of(terms: Sequence[Any], runs: Sequence[str]) -> Iterator[str]:
    """Keys of the looks after each of some runs; terms: what is looked for, in its order."""
    last = _hash(json.dumps([METHOD, __version__, *terms]))
    for run in runs:
        last = _hash(last + run)
        yield last


def known_first(
    kept: Mapping[str, KeptLook], keys: Sequence[str], effects: int
) -> tuple[KeptLook, ...]:
    """The looks that are kept, as far as none is missing before them."""
    found = []
    for key in keys:
        one = kept.get(key)
        if one is None or len(one.within) != effects or len(one.between) != effects:
            break
        found.append(one)
    return tuple(found)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
