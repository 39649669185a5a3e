"""What a drive lacks of what is asked: the worst of it, with its figure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.planning.drives import WholeDrive, whole_information
from syncline_design.planning.pairs import NONCENTRALITY, noncentrality_of, noncentrality_of_first
from syncline_design.planning.result import CalmWater, DearLeg, Lacking
from syncline_design.planning.setup import Setup
from syncline_design.planning.wanted import text_of

DEAR: Final = 0.5  # of a drive's time: what a leg takes so much for is said


def lacking(setup: Setup, information: Array) -> Lacking | None:
    """What is furthest from what is asked; None where all is reached."""
    judge = setup.judge
    if judge.enough(information):
        return None
    ratios = judge.ratios(information, exact=True)
    shares = judge.confusions(information)
    if shares.size and float(np.max(shares)) > float(np.max(ratios, initial=0.0)):
        return _taken(setup, information, int(np.argmax(shares)))
    at = int(np.argmax(ratios))
    asked = np.flatnonzero(np.isfinite(setup.goal.tolerance))
    if at >= len(asked):
        pair = setup.goal.pairs[at - len(asked)]
        found, names = noncentrality_of(information, pair), pair.names
        if not pair.known and found < noncentrality_of_first(information, pair):
            names = (names[1], names[0])
        return Lacking(" and ".join(names), None, found, NONCENTRALITY)
    k = int(asked[at])
    own = ratios[at] * setup.goal.tolerance[k]
    return Lacking(setup.keys[setup.goal.wanted[k]], None, float(own), setup.goal.tolerance[k])


def _taken(setup: Setup, information: Array, k: int) -> Lacking:
    """What another effect, left free, takes of a parameter; k: its place among what is wanted."""
    other, sigma, most = setup.judge.taken(information, k)
    text = text_of(setup.system, setup.world.every[other])
    return Lacking(setup.keys[setup.goal.wanted[k]], text, sigma, most)


def dear_legs(setup: Setup, found: WholeDrive) -> Iterator[DearLeg]:
    """Legs that take most of the time, with what fails without each."""
    whole_s = found.stretches[-1].to_s
    for k, one in enumerate(found.stretches):
        lasts_s = one.to_s - one.from_s
        if lasts_s <= DEAR * whole_s or len(found.stretches) < 2:
            continue
        rest = [told for j, told in enumerate(found.sequence) if j != k]
        without = lacking(setup, whole_information(setup.world, rest))
        if without is not None:
            yield DearLeg(f"{k + 1} {one.leg.name}", lasts_s, without)


def in_calm_water(setup: Setup, found: WholeDrive) -> CalmWater | None:
    """Whether a ship's drive is enough without waves; None where no waves are counted on."""
    if not setup.world.in_waves:
        return None
    lack = lacking(setup, whole_information(setup.world.calm, found.sequence))
    return CalmWater(lack is None, lack)
