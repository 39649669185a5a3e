"""Designs around a front: all of them, or a sample where there are too many, for a picture."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.choice.evaluate import broken, chosen_options, evaluate
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import in_force
from syncline_design.verdict.named import CloudDesign, FrontDesign

MOST: Final = 1000  # designs of a picture
ROUNDED: Final = 1.0 + 1e-9
SIMULATED: Final = "simulated"
SEED: Final = 0  # which of many are drawn tells nothing, so that it need not follow the user's


def cloud(
    problem: Problem,
    front: Sequence[FrontDesign] = (),
    names: Sequence[Mapping[str, str]] | None = None,
) -> tuple[CloudDesign, ...]:
    """Designs with a price, by rising price, whether they keep the requirements or not.

    names: of each role's sensors by their ids, as the front tells its own.  front: of cost; where
    figures are simulated, a design that it leaves out though no other is as good breaks one of
    them: nothing else could have kept it out.
    """
    found, named = [], names or [{} for _ in problem.roles]
    for design in _designs(problem):
        in_force().check()
        sums = evaluate(problem, design)
        if sums.cost is not None:
            options = chosen_options(problem, design)
            payload = ", ".join(
                f"{called.get(one.sensor, one.sensor)} ({one.method})"
                for called, one in zip(named, options, strict=True)
            )
            breaks = broken(problem, sums, accuracy=False)
            one = CloudDesign(float(sums.cost), float(sums.total_m), payload, breaks)
            if not breaks and problem.judge is not None and front and not _beaten(one, front):
                one = replace(one, breaks=(SIMULATED,))
            found.append(one)
    return tuple(sorted(found, key=lambda one: (one.cost, one.error_m, one.payload)))


def _beaten(one: CloudDesign, front: Sequence[FrontDesign]) -> bool:
    """Whether a design of the front costs no more and errs no more, to rounding."""
    return any(
        (point.cost or 0.0) <= one.cost * ROUNDED and point.error_m <= one.error_m * ROUNDED
        for point in front
    )


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
