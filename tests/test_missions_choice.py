"""The choice for several missions at once, against plain enumeration."""

from __future__ import annotations

import itertools
import random

import pytest

from random_families import plain_front, plain_order, random_family
from syncline_design.choice.evaluate import error_key
from syncline_design.choice.family_best import family_front, iter_family

FAMILIES = 150


@pytest.mark.parametrize("start", range(0, FAMILIES, 50))
def test_front_and_order_are_those_of_enumeration(start: int) -> None:
    feasible = 0
    for seed in range(start, start + 50):
        rng = random.Random(seed)
        family = random_family(rng)
        resource = rng.choice(["cost", "mass", "power"])
        found = [(p.amount, error_key(p.error_m)) for p in family_front(family, resource)]
        assert found == plain_front(family, resource), seed
        ranked = [one.rank[:2] for one in itertools.islice(iter_family(family), 4)]
        assert ranked == plain_order(family)[:4], seed
        feasible += bool(ranked)
    assert 10 < feasible < 50
