"""Designs around a front: all of them, or a sample where there are too many, for a picture."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from typing import Final

from syncline_design.choice.evaluate import broken, chosen_options, evaluate
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import in_force
from syncline_design.verdict.named import CloudDesign

MOST: Final = 400  # designs of a picture
SEED: Final = 0  # which of many are drawn tells nothing, so that it need not follow the user's


def cloud(problem: Problem) -> tuple[CloudDesign, ...]:
    """Designs with a price, by rising price, whether they keep the requirements or not."""
    found = []
    for design in _designs(problem):
        in_force().check()
        sums = evaluate(problem, design)
        if sums.cost is not None:
            options = chosen_options(problem, design)
            payload = ", ".join(f"{one.sensor} ({one.method})" for one in options)
            breaks = broken(problem, sums, accuracy=False)
            found.append(CloudDesign(float(sums.cost), float(sums.total_m), payload, breaks))
    return tuple(sorted(found, key=lambda one: (one.cost, one.error_m, one.payload)))


def _designs(problem: Problem) -> Iterator[Design]:
    """Every design where there are at most `MOST`, else as many drawn with equal chances."""
    ranges = [range(len(role.options)) for role in problem.roles]
    clocks = [range(len(vehicle.clocks)) for vehicle in problem.vehicles]
    split = len(ranges)
    if problem.combinations <= MOST:
        for choice in itertools.product(*ranges, *clocks):
            yield Design(choice[:split], choice[split:])
        return
    drawn = random.Random(SEED)
    seen: set[tuple[int, ...]] = set()
    for _ in range(4 * MOST):
        picks = tuple(drawn.randrange(len(places)) for places in (*ranges, *clocks))
        if picks not in seen:
            seen.add(picks)
            yield Design(picks[:split], picks[split:])
        if len(seen) == MOST:
            return
