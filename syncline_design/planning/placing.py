"""Legs in their places: the heading of each, the turn to it, and where that leads.

Each leg is driven to whichever of four headings brings the vehicle back towards its start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.legs import Leg

QUARTER_RAD: Final = 0.5 * math.pi
ABOUT: Final = 2  # quarters of a turn about
AREA_SHARE: Final = 0.9  # of the area that a drive may take: nobody drives to the very edge
Place = tuple[float, float]
Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Swept:
    """What a course that begins northwards takes: where it ends from where it began, and its south,
    north, west and east end [m]."""

    moved_m: Place = (0.0, 0.0)
    box_m: Box = (0.0, 0.0, 0.0, 0.0)


STILL: Final = Swept()


@dataclass(frozen=True, slots=True)
class Room:
    """Where a vehicle has to stay: north and east extent [m], and what its turns to a leg take, by
    -2 to 2 quarters."""

    area_m: Place
    turns: tuple[Swept, ...]


@dataclass(frozen=True, slots=True)
class LegTold:
    """What one leg tells at each of the four headings: G00, G0d + Gd0, Gdd, (4, p + 1, p + 1) each,
    the last row and column what the noise shifts.

    swept: of the leg driven northwards; turned_rad: its net turn.  turns_s: time to the next leg
    straight on, and after a turn about.  room: None where the vehicle may go anywhere; what its
    turns take is not looked at then.
    """

    leg: Leg
    now: Array
    once: Array
    twice: Array
    swept: Swept
    turned_rad: float
    turns_s: tuple[float, float]
    room: Room | None = None

    @property
    def area_m(self) -> Place | None:
        """North and east extent within which its vehicle has to stay."""
        return None if self.room is None else self.room.area_m

    def turn_s(self, angle_rad: float) -> float:
        """Time of the turn to its heading."""
        straight, about = self.turns_s
        share = abs(math.remainder(angle_rad, 2.0 * math.pi)) / math.pi
        return straight + share * (about - straight)

    def turn(self, angle_rad: float) -> Swept:
        """What the turn to its heading takes, begun northwards."""
        if self.room is None:
            return STILL
        return self.room.turns[ABOUT + round(angle_rad / QUARTER_RAD)]

    def ways(self, angle_rad: float) -> tuple[float, ...]:
        """The turns that lead to its heading: a turn about goes either way round."""
        if self.room is None or abs(round(angle_rad / QUARTER_RAD)) < ABOUT:
            return (angle_rad,)
        return angle_rad, angle_rad - math.copysign(2.0 * math.pi, angle_rad)

    def at(self, heading: int, start_s: float) -> Array:
        """Information of the leg when it begins so late."""
        found: Array = (
            self.now[heading] + start_s * self.once[heading] + start_s**2 * self.twice[heading]
        )
        return found


@dataclass(frozen=True, slots=True)
class Placed:
    """A leg in its place: which of the four headings, the turn to it [rad], and when it begins, its
    turn done."""

    told: LegTold
    heading: int
    turn_rad: float
    start_s: float

    @property
    def end_s(self) -> float:
        """When it ends."""
        return self.start_s + self.told.leg.duration_s

    @property
    def courses(self) -> tuple[tuple[int, Swept], tuple[int, Swept]]:
        """Turn and leg: the quarter of the compass that each begins to, and what it takes."""
        turned = round(self.turn_rad / QUARTER_RAD)
        return (
            ((self.heading - turned) % 4, self.told.turn(self.turn_rad)),
            (self.heading, self.told.swept),
        )


@dataclass(frozen=True, slots=True)
class LegsEnd:
    """Where some legs end: north and east [m], which of the four headings the last one had, the
    heading now, and when; box_m: what they took on their way, south, north, west and east."""

    place_m: Place = (0.0, 0.0)
    before: int = 0
    heading_rad: float = 0.0
    end_s: float = 0.0
    box_m: Box = (0.0, 0.0, 0.0, 0.0)

    def then(self, told: LegTold) -> tuple[Placed, LegsEnd]:
        """One more leg, at the heading that ends nearest to the start, the way back first; within
        its area where some way is."""
        ways = list(self._ways(told))
        costs = [
            round(math.hypot(*end) + 1e-6 * ((h - self.before - 2) % 4), 5) for h, _, end in ways
        ]
        order = sorted(range(len(ways)), key=costs.__getitem__)
        found = (self._placed(told, *ways[k]) for k in order)
        fitting = (one for one in found if one[1].within(told.area_m))
        return next(fitting, None) or self._placed(told, *ways[order[0]])

    @property
    def extent_m(self) -> Place:
        """North to south and east to west that was taken [m], with the turns between the legs."""
        south, north, west, east = self.box_m
        return north - south, east - west

    def within(self, area_m: Place | None) -> bool:
        """Whether what was taken leaves some room at the edges of an area."""
        return area_m is None or all(
            own <= AREA_SHARE * most for own, most in zip(self.extent_m, area_m, strict=True)
        )

    def _ways(self, told: LegTold) -> Iterator[tuple[int, float, Place]]:
        """Heading, turn to it and where the leg ends, of every way that it can be driven."""
        now = round(self.heading_rad / QUARTER_RAD) % 4
        for heading in range(4):
            north, east = _turned(told.swept.moved_m, heading)
            angle = math.remainder(QUARTER_RAD * heading - self.heading_rad, 2.0 * math.pi)
            for way in told.ways(angle):
                on, off = _turned(told.turn(way).moved_m, now)
                yield heading, way, (self.place_m[0] + on + north, self.place_m[1] + off + east)

    def _placed(
        self, told: LegTold, heading: int, angle: float, end_m: Place
    ) -> tuple[Placed, LegsEnd]:
        begins_rad = QUARTER_RAD * heading
        placed = Placed(told, heading, angle, self.end_s + told.turn_s(angle))
        box, at = self.box_m, self.place_m
        for quarter, course in placed.courses:
            box = _around(box, at, course, quarter)
            on, off = _turned(course.moved_m, quarter)
            at = (at[0] + on, at[1] + off)
        return placed, LegsEnd(end_m, heading, begins_rad + told.turned_rad, placed.end_s, box)


def _around(box: Box, at: Place, course: Swept, quarter: int) -> Box:
    """What was taken, and what a course from a place takes as well."""
    south, north, west, east = course.box_m
    corners = [_turned((n, e), quarter) for n in (south, north) for e in (west, east)]
    return (
        min(box[0], *(at[0] + n for n, _ in corners)),
        max(box[1], *(at[0] + n for n, _ in corners)),
        min(box[2], *(at[1] + e for _, e in corners)),
        max(box[3], *(at[1] + e for _, e in corners)),
    )


def arranged(sequence: Sequence[LegTold]) -> tuple[Placed, ...]:
    """Every leg at its heading and time."""
    way, found = LegsEnd(), []
    for told in sequence:
        placed, way = way.then(told)
        found.append(placed)
    return tuple(found)


def way_of(sequence: Sequence[LegTold]) -> LegsEnd:
    """Where the legs of a sequence end."""
    way = LegsEnd()
    for told in sequence:
        way = way.then(told)[1]
    return way


def _turned(moved: Place, heading: int) -> Place:
    cos, sin = ((1, 0), (0, 1), (-1, 0), (0, -1))[heading]
    return moved[0] * cos - moved[1] * sin, moved[0] * sin + moved[1] * cos


def lasting_s(sequence: Sequence[LegTold]) -> float:
    """Of all legs with the turns between them."""
    return way_of(sequence).end_s
