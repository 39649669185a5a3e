"""NMEA sentences: their times, the day that most of them lack, and fixes joined by their epoch.

Fields by NMEA 0183 as public descriptions of it give them (gpsd's "NMEA Revealed", receivers'
manuals).  GGA has a time without a day; RMC and ZDA have both; VTG and HDT have neither.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from datetime import date

from syncline_design.logs.readers.epochs import DAY_NS, NANO, UNIX_DAY
from syncline_design.logs.readers.stream import UNSET
from syncline_design.machine.quick_dataclass import dataclass

KNOT_MPS = 1852 / 3600
ROLLOVER_DAYS = 7168  # 1024 weeks
MOST_JUMPS = 5
JOINED = ("PTNL", "PUBX")  # their kind stands in the second field
# kind without talker -> field of the time of day
TIMES = {"GGA": 1, "RMC": 1, "GNS": 1, "GST": 1, "GBS": 1, "GRS": 1, "ZDA": 1, "GLL": 5, "LLQ": 1}
OWN_TIMES = {"PASHR": 1, "PTNLAVR": 2, "PTNLGGK": 2, "PTNLPJK": 2, "PTNLVGK": 2, "PTNLVHD": 2}
PLACES = frozenset({"GGA", "RMC", "GNS", "GLL"})
FIX_COLUMNS = (
    *("latitude_deg", "longitude_deg", "height_m", "height_msl_m", "separation_m"),
    *("velocity_north_mps", "velocity_east_mps"),
    *("sigma_north_m", "sigma_east_m", "sigma_up_m", "hdop", "quality", "satellites"),
)
TURN_COLUMNS = ("heading_deg", "roll_deg", "pitch_deg")
NAN = math.nan


@dataclass(frozen=True, slots=True)
class Sentence:
    """One sentence: who said what; tod_ns None where its kind has no time, UNSET where empty."""

    name: str
    kind: str
    fields: Sequence[str]
    tod_ns: int | None


def parsed(text: bytes) -> Sentence:
    """The fields of a sentence whose checksum is right."""
    fields = text.decode("ascii", errors="replace").split(",")
    name = fields[0]
    if len(fields) > 1 and (name in JOINED or (name == "PASHR" and fields[1].isalpha())):
        name += fields[1]
    kind = name if name.startswith("P") else name[2:]
    place = OWN_TIMES.get(kind, TIMES.get(kind))
    if place is None:
        return Sentence(name, kind, fields, None)
    return Sentence(name, kind, fields, time_of_day_ns(_field(fields, place)))


def _field(fields: Sequence[str], place: int) -> str:
    return fields[place] if place < len(fields) else ""


def time_of_day_ns(text: str) -> int:
    """`235724.02` as nanoseconds since midnight; a second 60 is the one after 59."""
    whole, _, rest = text.partition(".")
    if len(whole) != 6 or not whole.isdecimal() or (rest and not rest.isdecimal()):
        return UNSET
    hours, minutes, seconds = int(whole[:2]), int(whole[2:4]), int(whole[4:])
    if hours > 23 or minutes > 59 or seconds > 60:
        return UNSET
    return (hours * 3600 + minutes * 60 + seconds) * NANO + int(rest[:9].ljust(9, "0"))


def day_ns(sentence: Sentence) -> int | None:
    """The day that RMC, ZDA or GGK says, since 1970; None where it says none."""
    fields = sentence.fields
    try:
        if sentence.kind == "RMC":
            text = fields[9]
            year = int(text[4:6])
            found = date(year + (1900 if year >= 80 else 2000), int(text[2:4]), int(text[:2]))
        elif sentence.kind == "ZDA":
            found = date(int(fields[4]), int(fields[3]), int(fields[2]))
        elif sentence.kind == "PTNLGGK":
            text = fields[3]
            found = date(2000 + int(text[4:6]), int(text[:2]), int(text[2:4]))
        else:
            return None
    except (IndexError, ValueError):
        return None
    return (found.toordinal() - UNIX_DAY) * DAY_NS


class DayClock:
    """Times of the day to moments: the day is that of the nearest dated sentence.

    first_ns: the first dated moment of the file; without one, days count from that of the first
    sentence.
    """

    def __init__(self, first_ns: int | None) -> None:
        self._at = first_ns
        self._last_day: int | None = None
        self._days: list[int] = []
        self.jumps: list[str] = []

    def moment(self, sentence: Sentence) -> int:
        """When a sentence with a time was said [ns]."""
        tod = sentence.tod_ns
        if tod is None or tod == UNSET:
            return UNSET
        own = day_ns(sentence)
        if own is not None:
            self._note_jump(own)
            self._at = own + tod
        elif self._at is None:
            self._at = tod
        else:
            same = self._at - self._at % DAY_NS + tod
            self._at = same + DAY_NS * round((self._at - same) / DAY_NS)
        return self._at

    def _note_jump(self, day: int) -> None:
        last, before = self._last_day, self._days
        self._last_day = day
        if last == day:
            return
        self._days = [*before[-7:], day]
        if last is None or abs(day - last) <= DAY_NS or len(self.jumps) >= MOST_JUMPS:
            return
        rolled = next((d for d in before if _is_rollover(day - d)), None)
        if rolled is None:
            self.jumps.append(f"the date goes from {_iso(last)} to {_iso(day)}")
        else:
            why = "1024 weeks apart, as the GPS week counter rolls over"
            self.jumps.append(f"the date goes from {_iso(rolled)} to {_iso(day)}: {why}")


def _is_rollover(shift_ns: int) -> bool:
    """Whether two days are some multiple of 1024 weeks apart, to a day."""
    days = abs(shift_ns) // DAY_NS
    return (
        days > 7000 and abs((days + ROLLOVER_DAYS // 2) % ROLLOVER_DAYS - ROLLOVER_DAYS // 2) <= 1
    )


def _iso(day: int) -> str:
    return date.fromordinal(day // DAY_NS + UNIX_DAY).isoformat()


@dataclass(slots=True)
class Fixes:
    """Sentences of one epoch as one fix: GGA and RMC say the same place twice.

    vtg_leads: whether VTG, which carries no time, comes before the sentences of its epoch that do.
    """

    vtg_leads: bool = False
    _ahead: dict[str, float] = field(default_factory=dict)
    _tod: int | None = None
    _stamp: int = UNSET
    _row: dict[str, float] = field(default_factory=dict)

    def add(self, sentence: Sentence, moment: int) -> tuple[int, list[float]] | None:
        """Take a sentence in; gives the fix before it where that is complete."""
        if sentence.kind == "VTG":
            self._fill(self._ahead if self.vtg_leads else self._row, sentence)
            return None
        if sentence.tod_ns in (None, UNSET) or sentence.kind not in (*PLACES, "GST"):
            return None
        done = None
        if sentence.tod_ns != self._tod:
            done = self.last()
            self._tod, self._row, self._ahead = sentence.tod_ns, self._ahead, {}
        self._stamp = moment
        self._fill(self._row, sentence)
        return done

    def _fill(self, row: dict[str, float], sentence: Sentence) -> None:
        """What a sentence says and no other of the epoch said before it."""
        for name, value in _said(sentence).items():
            if math.isnan(row.get(name, NAN)):
                row[name] = value

    def last(self) -> tuple[int, list[float]] | None:
        """The fix gathered so far, if there is a place in it."""
        if math.isnan(self._row.get("latitude_deg", NAN)):
            return None
        return self._stamp, [self._row.get(name, NAN) for name in FIX_COLUMNS]


def _said(sentence: Sentence) -> dict[str, float]:
    f = sentence.fields
    if sentence.kind == "GGA" and number(_field(f, 6)) > 0:
        msl, separation = number(_field(f, 9)), number(_field(f, 11))
        return {
            **_place(f, 2),
            "height_msl_m": msl,
            "separation_m": separation,
            "height_m": msl + separation,
            "quality": number(_field(f, 6)),
            "satellites": number(_field(f, 7)),
            "hdop": number(_field(f, 8)),
        }
    if sentence.kind == "GNS" and _field(f, 6).strip("N"):
        msl, separation = number(_field(f, 9)), number(_field(f, 10))
        heights = {"height_msl_m": msl, "separation_m": separation, "height_m": msl + separation}
        return {**_place(f, 2), **heights, "hdop": number(_field(f, 8))}
    if sentence.kind == "RMC" and _field(f, 2) == "A":
        return {**_place(f, 3), **_ground_velocity(number(_field(f, 7)), number(_field(f, 8)))}
    if sentence.kind == "VTG" and _field(f, 2) == "T" and _field(f, 9) != "N":
        knots, kmh = number(_field(f, 5)), number(_field(f, 7))
        known = knots if math.isfinite(knots) else kmh / 1.852
        return _ground_velocity(known, number(_field(f, 1)))
    if sentence.kind == "GLL" and _field(f, 6) == "A":
        return _place(f, 1)
    if sentence.kind == "GST":
        names = ("sigma_north_m", "sigma_east_m", "sigma_up_m")
        return {name: number(_field(f, 6 + k)) for k, name in enumerate(names)}
    return {}


def _ground_velocity(knots: float, course_deg: float) -> dict[str, float]:
    speed = knots * KNOT_MPS
    course = 0.0 if speed == 0 else math.radians(course_deg)
    return {
        "velocity_north_mps": speed * math.cos(course),
        "velocity_east_mps": speed * math.sin(course),
    }


def _place(fields: Sequence[str], at: int) -> dict[str, float]:
    """`4552.65403,S,17030.00668,E` in degrees; nothing where a part is missing."""
    latitude = _degrees(_field(fields, at), _field(fields, at + 1), "NS", 90)
    longitude = _degrees(_field(fields, at + 2), _field(fields, at + 3), "EW", 180)
    if math.isnan(latitude + longitude):
        return {}
    return {"latitude_deg": latitude, "longitude_deg": longitude}


def _degrees(text: str, side: str, sides: str, most: int) -> float:
    value = number(text)
    if side not in sides or not side or not 0 <= value <= most * 100:
        return NAN
    whole = int(value // 100)
    dot = text.find(".") if "." in text else len(text)
    minutes = number(text[max(dot - 2, 0) :])  # of the text: no digit is lost in a subtraction
    if not minutes < 60:
        return NAN
    degrees = whole + minutes / 60
    return degrees if side == sides[0] else -degrees


def number(text: str) -> float:
    """A decimal figure; NaN where there is none."""
    try:
        value = float(text)
    except ValueError:
        return NAN
    return value if math.isfinite(value) else NAN


def turn(sentence: Sentence) -> list[float] | None:
    """Heading, roll and pitch [deg] of sentences that say them; None of all others."""
    f = sentence.fields
    if sentence.kind in ("HDT", "THS"):
        return [number(_field(f, 1)), NAN, NAN]
    if sentence.kind == "PASHR":
        return [number(_field(f, 2)), number(_field(f, 4)), number(_field(f, 5))]
    if sentence.kind == "PTNLAVR":
        named = {_field(f, k + 1): number(_field(f, k)) for k in (3, 5, 7)}
        return [named.get("Yaw", NAN), named.get("Roll", NAN), named.get("Tilt", NAN)]
    return None
