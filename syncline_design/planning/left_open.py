"""What a drive leaves open of what is asked, and what has to be known otherwise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from syncline_design.effects.record import Array
from syncline_design.planning.information import sigmas
from syncline_design.planning.others import taken_by
from syncline_design.planning.result import HeldEffect, Untold
from syncline_design.planning.setup import Setup
from syncline_design.planning.wanted import text_of

UNSEEN: Final = 0.7  # of what is plausible: a parameter left that uncertain is not shown


def confused(setup: Setup, information: Array) -> tuple[str, ...]:
    """Effects that, left free alone, would take what is asked."""
    places = setup.judge.confusing(information)
    return tuple(text_of(setup.system, setup.world.every[k]) for k in places)


def untold(setup: Setup, information: Array) -> tuple[Untold, ...]:
    """What has to be known otherwise, with what it would leave of what is asked."""
    found = taken_by(setup.untold, setup.goal, information, setup.judge.prior)
    return tuple(
        Untold(
            text_of(setup.system, setup.world.every[effect]),
            {setup.keys[k]: sigma for k, sigma in taken.items()},
        )
        for effect, taken in found.items()
    )


def held(setup: Setup) -> tuple[HeldEffect, ...]:
    """What is asked and held, effect by effect, with the effects that are told beside it."""
    every, system = setup.world.every, setup.system
    found: dict[str, tuple[list[str], dict[str, None]]] = {}
    for one in setup.held:
        keys, beside = found.setdefault(text_of(system, every[one.held]), ([], {}))
        keys.append(setup.keys[one.held])
        beside.update(dict.fromkeys(text_of(system, every[k]) for k in one.beside))
    return tuple(
        HeldEffect(text, tuple(keys), tuple(one for one in beside if one != text))
        for text, (keys, beside) in found.items()
    )


def unseen(setup: Setup, information: Array) -> tuple[str, ...]:
    """Effects of whose parameters the drive tells too little, whole or some of them.

    Each effect with what is asked free beside it, not with all effects at once, of which some are
    one: its sigma against the tolerance where one is asked, else against what is plausible.
    """
    groups: dict[str, list[int]] = {}
    for k, one in enumerate(setup.world.every):
        if k not in setup.goal.out_by_size:
            groups.setdefault(text_of(setup.system, one), []).append(k)
    found = []
    for text, places in groups.items():
        hidden = _hidden(setup, information, places)
        if hidden:
            names = [setup.world.every[k].parameter.name for k in hidden]
            found.append(text if len(hidden) == len(places) else f"{text}: {', '.join(names)}")
    return tuple(found)


def _hidden(setup: Setup, information: Array, places: Sequence[int]) -> list[int]:
    """Of one effect's parameters those of which the drive tells too little."""
    goal, prior = setup.goal, setup.judge.prior
    asked = dict(zip(goal.wanted, goal.tolerance, strict=True))
    own = dict(zip(goal.wanted, sigmas(information, list(goal.wanted)), strict=True))
    index = sorted({*places, *goal.wanted})
    beside = dict(zip(index, sigmas(information, index, prior[index]), strict=True))
    return [
        k
        for k in places
        if (
            own[k] > asked[k]
            if math.isfinite(asked.get(k, math.inf))
            else beside[k] > UNSEEN * prior[k]
        )
    ]
