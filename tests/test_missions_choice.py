"""The choice for several missions at once, against plain enumeration."""

from __future__ import annotations

import itertools
import random

from random_families import all_tried, plain_front, plain_order, random_family
from syncline_design.choice.evaluate import error_key
from syncline_design.choice.family_best import family_front, iter_family

FAMILIES = 60  # 10 000 in benchmarks/missions.py


def test_front_and_order_are_those_of_enumeration() -> None:
    feasible = broken = 0
    for seed in range(FAMILIES):
        rng = random.Random(seed)
        family = random_family(rng, 24)
        resource = rng.choice(["cost", "mass", "power"])
        tried = list(all_tried(family))
        found = [(p.amount, error_key(p.error_m)) for p in family_front(family, resource)]
        assert found == plain_front(family, resource, tried), seed
        ranked = [one.rank[:2] for one in itertools.islice(iter_family(family), 2)]
        assert ranked == plain_order(family, tried)[:2], seed
        feasible += bool(ranked)
        broken += not ranked
    assert feasible > 15
    assert broken > 5


def test_a_design_that_something_else_refuses_is_passed_over() -> None:
    family = next(
        one
        for seed in range(100)
        if len(plain_order(one := random_family(random.Random(seed)))) > 5
    )
    first, second, third, *_ = itertools.islice(iter_family(family), 5)
    refused = {first.design, third.design}
    left = list(itertools.islice(iter_family(family, lambda one: one not in refused), 2))
    assert left[0].design == second.design
    assert left[1].rank >= third.rank
