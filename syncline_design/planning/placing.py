"""Legs in their places: the heading of each, the turn to it, and where that leads.

Each leg is driven to whichever of four headings brings the vehicle back towards its start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Final

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.legs import QUARTER_RAD, Leg

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

    def begun_at(self, quarter: int) -> Swept:
        """The same begun to another quarter of the compass."""
        south, north, west, east = self.box_m
        corners = [_turned((n, e), quarter) for n in (south, north) for e in (west, east)]
        norths, easts = zip(*corners, strict=True)
        box = (min(norths), max(norths), min(easts), max(easts))
        return Swept(_turned(self.moved_m, quarter), box)

    def then(self, other: Swept) -> Swept:
        """Both, the other from where this one ends."""
        (north, east), (more, off) = self.moved_m, other.moved_m
        return Swept((north + more, east + off), around(self.box_m, self.moved_m, other.box_m))


def around(box: Box, at: Place, own: Box) -> Box:
    """What was taken, and what is taken from a place on as well."""
    north, east = at
    return (
        min(box[0], north + own[0]),
        max(box[1], north + own[1]),
        min(box[2], east + own[2]),
        max(box[3], east + own[3]),
    )


STILL: Final = Swept()


@dataclass(frozen=True, slots=True)
class Room:
    """Where a vehicle has to stay: north and east extent [m], and what its turns to a leg take, by
    -2 to 2 quarters."""

    area_m: Place
    turns: tuple[Swept, ...]


@dataclass(frozen=True, slots=True)
class Way:
    """One way to drive a leg: which of the four headings it has, the turn to it [rad] and its time
    [s], the leg's own time [s], and what turn and leg take from where the turn begins."""

    heading: int
    turn_rad: float
    turn_s: float
    leg_s: float
    swept: Swept


@dataclass(frozen=True, slots=True)
class LegTold:
    """What one leg tells at each of the four headings: G00, G0d + Gd0, Gdd, (4, p + 1, p + 1) each,
    the last row and column what the noise shifts.

    swept: of the leg driven northwards; turned_rad: its net turn.  turns_s: time to the leg
    straight on, and after a turn about; infinite where it can only be driven straight on.  room:
    None where the vehicle may go anywhere; what its turns take is not looked at then.  runs_m: the
    run-up before a drive that it begins, and the run-out after one that it ends.
    """

    leg: Leg
    now: Array
    once: Array
    twice: Array
    swept: Swept
    turned_rad: float
    turns_s: tuple[float, float]
    room: Room | None = None
    runs_m: tuple[float, float] = (0.0, 0.0)

    _known: dict[float, tuple[Way, ...]] = field(default_factory=dict, repr=False, compare=False)

    @property
    def area_m(self) -> Place | None:
        """North and east extent within which its vehicle has to stay."""
        return None if self.room is None else self.room.area_m

    def ways_from(self, heading_rad: float) -> tuple[Way, ...]:
        """Every way that it can be driven after a leg that ended at this heading; worked out once,
        for a search places the same few legs again and again."""
        found = self._known.get(heading_rad)
        if found is None:
            found = self._known[heading_rad] = tuple(self._ways(heading_rad))
        return found

    def _ways(self, heading_rad: float) -> Iterator[Way]:
        """At each of the four headings; a turn about goes either way round."""
        for heading in range(4):
            angle = math.remainder(QUARTER_RAD * heading - heading_rad, 2.0 * math.pi)
            if angle and math.isinf(self.turns_s[1]):
                continue
            yield self._way(heading, angle)
            if self.room is not None and abs(round(angle / QUARTER_RAD)) == ABOUT:
                yield self._way(heading, angle - math.copysign(2.0 * math.pi, angle))

    def _way(self, heading: int, turn_rad: float) -> Way:
        turned = round(turn_rad / QUARTER_RAD)
        turn = STILL if self.room is None else self.room.turns[ABOUT + turned]
        begun = turn.begun_at((heading - turned) % 4)
        swept = begun.then(self.swept.begun_at(heading))
        return Way(heading, turn_rad, self._turn_s(turn_rad), self.leg.duration_s, swept)

    def _turn_s(self, angle_rad: float) -> float:
        """Time of a turn."""
        straight, about = self.turns_s
        if not angle_rad:
            return straight
        share = abs(math.remainder(angle_rad, 2.0 * math.pi)) / math.pi
        return straight + share * (about - straight)

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


@dataclass(frozen=True, slots=True)
class LegsEnd:
    """Where some legs end: north and east [m], which of the four headings the last one had, the
    heading now, and when; box_m: what they took on their way, south, north, west and east.

    A drive begins straight ahead, northwards: the way back is north where nothing was driven.
    run_m: the run-out, straight on from there; run_up_m: the run-up before its begin.
    """

    place_m: Place = (0.0, 0.0)
    before: int = 2
    heading_rad: float = 0.0
    end_s: float = 0.0
    box_m: Box = (0.0, 0.0, 0.0, 0.0)
    run_m: float = 0.0
    run_up_m: float = 0.0

    def then(self, told: LegTold) -> tuple[Placed, LegsEnd]:
        """One more leg, at the heading that ends nearest to the start, the way back first; within
        its area where some way is."""
        way, end = self.led_on(told)
        return Placed(told, way.heading, way.turn_rad, self.end_s + way.turn_s), end

    def led_on(self, told: LegTold) -> tuple[Way, LegsEnd]:
        """The way that one more leg is driven, and where it leads."""
        ways = told.ways_from(self.heading_rad)
        (north, east), about = self.place_m, self.before + 2
        costs = []
        for one in ways:
            more, off = one.swept.moved_m
            away_m = math.hypot(north + more, east + off)
            costs.append(round(away_m + 1e-6 * ((one.heading - about) % 4), 5))
        if told.room is None:
            return self._after(told, ways[costs.index(min(costs))])
        order = sorted(range(len(ways)), key=costs.__getitem__)
        if self.end_s == 0.0:  # turned to first only where straight on it does not fit
            order.sort(key=lambda k: abs(ways[k].turn_rad))
        for k in order:
            found = self._after(told, ways[k])
            if found[1].within(told.room.area_m):
                return found
        return self._after(told, ways[order[0]])

    @property
    def extent_m(self) -> Place:
        """North to south and east to west that was taken [m], with the turns between the legs, the
        run-up and the run-out."""
        south, north, west, east = self.box_m
        to_north = self.place_m[0] + self.run_m * math.cos(self.heading_rad)
        to_east = self.place_m[1] + self.run_m * math.sin(self.heading_rad)
        return (
            max(north, -self.run_up_m, to_north) - min(south, -self.run_up_m, to_north),
            max(east, 0.0, to_east) - min(west, 0.0, to_east),
        )

    def within(self, area_m: Place | None) -> bool:
        """Whether the drive leaves some room at the edges of an area, which a run-up and a run-out
        may take."""
        if area_m is None:
            return True
        south, north, west, east = self.box_m
        if north - south > AREA_SHARE * area_m[0] or east - west > AREA_SHARE * area_m[1]:
            return False
        whole = self.extent_m
        return whole[0] <= area_m[0] and whole[1] <= area_m[1]

    def _after(self, told: LegTold, way: Way) -> tuple[Way, LegsEnd]:
        (north, east), (more, off) = self.place_m, way.swept.moved_m
        heading_rad = QUARTER_RAD * way.heading + told.turned_rad
        box = around(self.box_m, self.place_m, way.swept.box_m)
        return way, LegsEnd(
            (north + more, east + off),
            way.heading,
            heading_rad,
            self.end_s + way.turn_s + way.leg_s,
            box,
            told.runs_m[1],
            self.run_up_m if self.end_s else told.runs_m[0],
        )


BEGIN: Final = LegsEnd()


def arranged(sequence: Sequence[LegTold]) -> tuple[Placed, ...]:
    """Every leg at its heading and time."""
    way, found = BEGIN, []
    for told in sequence:
        placed, way = way.then(told)
        found.append(placed)
    return tuple(found)


def way_of(
    sequence: Sequence[LegTold], begun: LegsEnd = BEGIN, most_s: float = math.inf
) -> LegsEnd:
    """Where the legs of a sequence end, after others; only that it takes longer, where it does."""
    way = begun
    for told in sequence:
        way = way.led_on(told)[1]
        if way.end_s > most_s:
            break
    return way


def _turned(moved: Place, heading: int) -> Place:
    cos, sin = ((1, 0), (0, 1), (-1, 0), (0, -1))[heading]
    return moved[0] * cos - moved[1] * sin, moved[0] * sin + moved[1] * cos


def lasting_s(sequence: Sequence[LegTold]) -> float:
    """Of all legs with the turns between them."""
    return way_of(sequence).end_s


def legs_s(sequence: Sequence[LegTold]) -> float:
    """Of all legs alone."""
    return sum(told.leg.duration_s for told in sequence)
