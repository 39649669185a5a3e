"""Noise that depends: a deviation by range, or by the angle of the beam, as a table of an entry.

Between two rows it is a straight line.  By range it never falls with range; nearer than the first
row that row's figure holds, and beyond the last one the last line goes on.  By angle (of the line
of sight from the body's down axis, 0 deg straight down) the outermost rows hold beyond.  A stage
takes the figure where it is largest: at its farthest distance, at the worst angle of its `look`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, Literal, cast

from pydantic_core import PydanticCustomError

from syncline_design.model.quantity import Dimension, Quantity, UnitError, parse_quantity
from syncline_design.spec.facts import FieldOfView
from syncline_design.spec.fields import kind_of, quantity_schema, read_quantity, refusal, refusals
from syncline_design.spec.yaml_text import KeyPath

Of = Literal["range", "angle"]
Rows = tuple[tuple[Fraction, Fraction], ...]  # range [m] or angle [rad], deviation
QUARTER = parse_quantity("90 deg", Dimension.ANGLE).exact
_KEYS: dict[Of, Dimension] = {"range": Dimension.LENGTH, "angle": Dimension.ANGLE}
_ROW: dict[Of, str] = {"range": "a range such as 10 m", "angle": "a beam angle such as 60 deg"}
_EXAMPLE = "{at: {10 m: 2 cm, 100 m: 5 cm}}"


class NoiseTable(Quantity):
    """A deviation by range or by angle; as a figure it is the one where it stands, else the last.

    of: what it hangs on; rows: rising in it, SI.
    """

    __slots__ = ("of", "rows")
    of: Of
    rows: Rows

    def __new__(cls, of: Of, rows: Rows, text: str, exact: Fraction | None = None) -> NoiseTable:
        worst = max(value for _, value in rows)
        made = super().__new__(cls, worst if exact is None else exact, text)
        self = cast("NoiseTable", made)
        object.__setattr__(self, "of", of)
        object.__setattr__(self, "rows", rows)
        return self

    def __reduce__(self) -> tuple[Any, tuple[object, ...]]:
        return NoiseTable, (self.of, self.rows, self.text, self.exact)

    def at(self, place: Fraction) -> Fraction:
        """The deviation at a range [m] or an angle [rad]."""
        first, last = self.rows[0], self.rows[-1]
        if place <= first[0] or len(self.rows) == 1:
            return first[1]
        if place >= last[0] and self.of == "angle":
            return last[1]
        ahead = (pair for pair in pairwise(self.rows) if place <= pair[1][0])
        (x, low), (y, high) = next(ahead, self.rows[-2:])
        return low + (high - low) * (place - x) / (y - x)

    def bends(self, near: Fraction, far: Fraction) -> tuple[Fraction, ...]:
        """Rows between two places, where the line bends."""
        return tuple(x for x, _ in self.rows if near < x < far)

    def worst(self, near: Fraction, far: Fraction) -> Fraction:
        """The largest deviation between two places."""
        return max(self.at(x) for x in (near, far, *self.bends(near, far)))

    def placed(self, exact: Fraction) -> NoiseTable:
        """The same table, with what it says where it stands as its figure."""
        return NoiseTable(self.of, self.rows, self.text, exact)

    @property
    def is_told_to(self) -> Fraction:
        """Up to which range or angle there are rows."""
        return self.rows[-1][0]


def angles_of(look: FieldOfView | None) -> tuple[Fraction, Fraction]:
    """Angles [rad] from straight down that a stage looks at: its elevations and a quarter turn."""
    span = None if look is None else look.elevation
    if span is None:
        return Fraction(0), 2 * QUARTER
    low, high = Fraction(span.low), Fraction(span.high)
    return max(low + QUARTER, Fraction(0)), min(high + QUARTER, 2 * QUARTER)


def table_where(table: NoiseTable, distance: float, look: FieldOfView | None) -> NoiseTable:
    """A table where a stage uses it: at its farthest distance [m], at the worst angle it looks."""
    far = distance.exact if isinstance(distance, Quantity) else Fraction(distance)
    value = table.at(far) if table.of == "range" else table.worst(*angles_of(look))
    return table.placed(value)


def read_table(value: Mapping[Any, Any], dimension: Dimension, keys: Sequence[Of]) -> NoiseTable:
    """`{at: {10 m: 2 cm, 100 m: 5 cm}}` with keys of range or angle."""
    if list(value) != ["at"] or not isinstance(value["at"], Mapping) or not value["at"]:
        found = ", ".join(map(str, value)) if list(value) != ["at"] else kind_of(value["at"])
        raise refusal("not a table of noise", f"a mapping such as {_EXAMPLE}", found or "{}")
    rows, of = _rows(value["at"], dimension, keys)
    places = [x for x, _ in rows]
    if len(set(places)) < len(places):
        raise refusal("a row given twice", "one row for each range or angle", _shown(value["at"]))
    falls = of == "range" and any(b[1] < a[1] for a, b in pairwise(rows))
    if falls:
        hint = "give the largest figure of all that is nearer"
        raise refusal("noise that falls with range", "rising figures", _shown(value["at"]), hint)
    return NoiseTable(of, rows, _shown(value["at"]))


def _rows(table: Mapping[Any, Any], dimension: Dimension, keys: Sequence[Of]) -> tuple[Rows, Of]:
    errors: list[tuple[KeyPath, PydanticCustomError]] = []
    rows, kinds = [], set()
    for key, item in table.items():
        try:
            of, place = _place(str(key), keys)
            value = read_quantity(item, dimension, 0.0, above=True)
            kinds.add(of)
            if len(kinds) > 1:
                raise refusal("ranges and angles in one table", "one of them", kind_of(str(key)))
            rows.append((place, value.exact))
        except PydanticCustomError as error:
            errors.append((("at", str(key)), error))
    if errors:
        raise refusals(errors)
    return tuple(sorted(rows)), kinds.pop()


def _place(key: str, keys: Sequence[Of]) -> tuple[Of, Fraction]:
    for of in keys:
        try:
            place = parse_quantity(key, _KEYS[of])
        except UnitError:
            continue
        if place < 0.0 or (of == "angle" and place.exact > 2 * QUARTER):
            wanted = "0 m or more" if of == "range" else "0 deg .. 180 deg from straight down"
            raise refusal("out of range", wanted, key)
        return of, place.exact
    wanted = " or ".join(_ROW[of] for of in keys)
    raise refusal("not a row", wanted, kind_of(key))


def _shown(table: Mapping[Any, Any]) -> str:
    return ", ".join(f"{getattr(v, 'text', v)} at {k}" for k, v in table.items())


def table_schema(dimension: Dimension) -> dict[str, Any]:
    """JSON Schema of a table."""
    rows = {
        "type": "object",
        "minProperties": 1,
        "additionalProperties": quantity_schema(dimension),
    }
    return {
        "type": "object",
        "properties": {"at": rows},
        "required": ["at"],
        "additionalProperties": False,
    }
