"""Every leg that a drive can be made of."""

from __future__ import annotations

from syncline_design.planning.legs import Leg, usual_legs
from syncline_design.planning.swings import swings
from syncline_design.planning.vehicle import Vehicle


def library(vehicle: Vehicle, stage: int) -> tuple[Leg, ...]:
    """What the vehicle can do, in a time that is worth it."""
    return (*usual_legs(vehicle, stage), *swings(vehicle, stage))
