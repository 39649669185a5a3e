"""Field types of files: quantities with a unit, for frozen pydantic models.

Each field says what is wrong in one message with what was expected, found and what to do; a
union of shapes is read by a function that looks at the shape first, so that a slip in one branch
is never reported for all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from datetime import date
from typing import Annotated, Any, Final, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.model.quantity import (
    EXAMPLES,
    UNITS,
    Dimension,
    Quantity,
    UnitError,
    parse_quantity,
    plain_number,
)
from syncline_design.spec.yaml_text import KeyPath

T = TypeVar("T")
R = TypeVar("R", bound="FileRecord")
MAX_SUGGESTIONS = 50  # of one record or list: more errors than that are no typing slips
_DAY: Final = re.compile(r"\d{4}-\d\d-\d\d")


def refusal(
    message: str, expected: str = "", found: str = "", hint: str = ""
) -> PydanticCustomError:
    """An error of one field in the four parts that a message has."""
    parts = {"message": message, "expected": expected, "found": found, "hint": hint}
    return PydanticCustomError("refused", "{message}", parts)


def refusals(errors: Iterable[tuple[KeyPath, PydanticCustomError]]) -> ValidationError:
    """Several errors of one record, each at its own place inside it."""
    return ValidationError.from_exception_data(
        "record", [InitErrorDetails(type=error, loc=loc, input=None) for loc, error in errors]
    )


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`did you mean X?` or nothing; case and near misses are looked at."""
    from difflib import get_close_matches

    candidates = list(known)
    same = [c for c in candidates if c.lower() == word.lower()]
    nearest = same or get_close_matches(word, candidates, 1, 0.6)
    if not nearest and len(word) >= 3:
        nearest = [c for c in candidates if word.lower() in c.lower()][:1]
    return f"did you mean {nearest[0]}?" if nearest else ""


def kind_of(value: object) -> str:
    """What a value is, in words: `the number 12`, `a list`."""
    if value is None:
        return "nothing (null)"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"the number {getattr(value, 'text', None) or value}"
    if isinstance(value, str):
        shown = value if len(value) <= 40 else value[:37] + "..."
        return repr(shown)
    return "a mapping" if isinstance(value, Mapping) else "a list"


class FileRecord(BaseModel):
    """Base of everything read from a file: frozen, strict, no unknown keys."""

    # Built on first use: a run that meets no inline sensor pays nothing for that model.
    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, defer_build=True
    )

    @model_validator(mode="wrap")
    @classmethod
    def _explain_keys(cls: type[R], value: Any, handler: ModelWrapValidatorHandler[R]) -> R:
        if not isinstance(value, Mapping | cls):
            raise refusal("not a mapping", "a mapping of keys and values", kind_of(value))
        try:
            return handler(value)
        except ValidationError as error:
            details = error.errors(include_url=False)
            if not any(d["type"] == "extra_forbidden" and len(d["loc"]) == 1 for d in details):
                raise
            known = list(cls.model_fields)
            restated = [
                _restated(dict(d), known, suggest=index < MAX_SUGGESTIONS)
                for index, d in enumerate(details)
            ]
            raise ValidationError.from_exception_data(cls.__name__, restated) from None


def _restated(detail: dict[str, Any], known: list[str], *, suggest: bool) -> InitErrorDetails:
    """The same error again; an unknown key of this record with the keys it might have meant."""
    kind, loc, context = detail["type"], detail["loc"], detail.get("ctx", {})
    if kind == "extra_forbidden" and len(loc) == 1:
        hint = did_you_mean(str(loc[0]), known) if suggest else ""
        hint = hint or f"known keys: {', '.join(known)}"
        error = PydanticCustomError("unknown_key", "{message}", {"message": "", "hint": hint})
        return InitErrorDetails(type=error, loc=loc, input=detail["input"])
    if kind in ("refused", "unknown_key"):
        kind = PydanticCustomError(kind, "{message}", context)
    return InitErrorDetails(type=kind, loc=loc, input=detail["input"], ctx=context)


def read_quantity(
    value: Any,
    dimension: Dimension,
    lowest: float | None = None,
    above: bool = False,
    tolerance: bool = False,
) -> Quantity:
    """One figure with unit, checked against its lower limit; both tolerance ends count."""
    if isinstance(value, Quantity):
        quantity = value
    else:
        try:
            quantity = parse_quantity(value, dimension, tolerance=tolerance)
        except UnitError as error:
            raise refusal(error.message, error.expected, error.found, error.hint) from None
    if lowest is not None and not (quantity.low > lowest if above else quantity.low >= lowest):
        raise refusal("out of range", "more than 0" if above else "0 or more", quantity.text)
    return quantity


def read_number(value: Any, lowest: float | None = None, above: bool = False) -> Quantity:
    """One bare number, checked against its lower limit."""
    try:
        number = value if isinstance(value, Quantity) else plain_number(value)
    except UnitError as error:
        raise refusal(error.message, error.expected, error.found, error.hint) from None
    if lowest is not None and not (number > lowest if above else number >= lowest):
        raise refusal(
            "out of range",
            f"{'more than' if above else 'at least'} {to_digits(lowest)}",
            number.text,
        )
    return number


def quantity_schema(dimension: Dimension, tolerance: bool = False) -> dict[str, Any]:
    """JSON Schema of `NUMBER UNIT`, with a tolerance where one is taken."""
    units = sorted((u for u, (d, _) in UNITS.items() if d is dimension), key=len, reverse=True)
    escaped = "|".join(u.replace("^", r"\^") for u in units)
    number = r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?"
    single = f"{number} +({escaped})"
    spread = rf"( *(\+/-|\u00b1) *({single}|{number} *%)| +\.\. +{single})?" if tolerance else ""
    return {
        "type": "string",
        "description": (
            f"{dimension.value}{' with or without tolerance' if tolerance else ''}, "
            f"NUMBER UNIT, for instance {EXAMPLES[dimension]}"
        ),
        "pattern": f"^ *{single}{spread} *$",
    }


@dataclass(frozen=True, eq=False)  # by identity: typing hashes annotations
class ReadBy:
    """Field annotation: how a value is read from a file, and its JSON Schema."""

    read: Callable[[Any], Any]
    schema: dict[str, Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return dict(self.schema)


def _read_day(value: Any) -> str:
    try:
        if _DAY.fullmatch(value):
            return date.fromisoformat(value).isoformat()
    except (TypeError, ValueError):
        pass
    raise refusal("not a date", "a date such as 2027-01-31", kind_of(value))


Day = Annotated[str, ReadBy(_read_day, {"type": "string", "format": "date"})]


def figure_of(
    dimension: Dimension, lowest: float | None = None, above: bool = False, tolerance: bool = False
) -> ReadBy:
    def read(value: Any) -> Quantity:
        return read_quantity(value, dimension, lowest, above, tolerance)

    return ReadBy(read, quantity_schema(dimension, tolerance))


def _read_yes_no(value: Any) -> bool:
    """yes, no, true or false; YAML 1.2 reads the first two as text."""
    if isinstance(value, bool):
        return value
    if value in ("yes", "no"):
        return bool(value == "yes")
    raise refusal("neither yes nor no", "yes or no", kind_of(value))


YesNo = Annotated[
    bool, ReadBy(_read_yes_no, {"anyOf": [{"enum": ["yes", "no"]}, {"type": "boolean"}]})
]
PositiveLength = Annotated[float, figure_of(Dimension.LENGTH, 0.0, above=True)]
NonNegativeLength = Annotated[float, figure_of(Dimension.LENGTH, 0.0)]
Time = Annotated[float, figure_of(Dimension.TIME)]
PositiveTime = Annotated[float, figure_of(Dimension.TIME, 0.0, above=True)]
NonNegativeTime = Annotated[float, figure_of(Dimension.TIME, 0.0)]
Speed = Annotated[float, figure_of(Dimension.SPEED, 0.0)]
PositiveSpeed = Annotated[float, figure_of(Dimension.SPEED, 0.0, above=True)]
AngularRate = Annotated[float, figure_of(Dimension.ANGULAR_RATE, 0.0)]
Acceleration = Annotated[float, figure_of(Dimension.ACCELERATION, 0.0, above=True)]
AngularAcceleration = Annotated[float, figure_of(Dimension.ANGULAR_ACCELERATION, 0.0, above=True)]
NonNegativeAngle = Annotated[float, figure_of(Dimension.ANGLE, 0.0)]
Mass = Annotated[Quantity, figure_of(Dimension.MASS, 0.0)]
Power = Annotated[Quantity, figure_of(Dimension.POWER, 0.0)]
Money = Annotated[Quantity, figure_of(Dimension.MONEY, 0.0)]
PositiveMoney = Annotated[Quantity, figure_of(Dimension.MONEY, 0.0, above=True)]
Ratio = Annotated[float, figure_of(Dimension.RATIO, 0.0)]


def _number(lowest: float) -> ReadBy:
    def read(value: Any) -> Quantity:
        return read_number(value, lowest, above=True)

    return ReadBy(read, {"type": "number", "exclusiveMinimum": lowest})


PositiveNumber = Annotated[float, _number(0.0)]


def _refuse_empty(value: Any) -> Any:
    """Looked at before the items: their errors would make the list seem empty."""
    if isinstance(value, tuple | list) and not value:
        raise refusal("an empty list", "at least one entry", "[]")
    return value


AtLeastOne = BeforeValidator(_refuse_empty)
NonEmptyText = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=1)]


def axes(dimension: Dimension, names: tuple[str, ...]) -> ReadBy:
    """Standard deviations: one figure for every axis, or one per axis in the order of `names`."""
    count = len(names)

    def one(value: Any) -> Quantity:
        return read_quantity(value, dimension, 0.0, above=True, tolerance=True)

    def read(value: Any) -> Quantity | tuple[Quantity, ...]:
        if not isinstance(value, tuple | list):
            return one(value)
        if len(value) != count:
            wanted = f"one figure, or {count}: {', '.join(names)}"
            raise refusal("wrong number of axes", wanted, f"{len(value)} figures")
        return tuple(_each(value, one))

    schema = quantity_schema(dimension, tolerance=True)
    several = {"type": "array", "items": schema, "minItems": count, "maxItems": count}
    return ReadBy(read, {"anyOf": [schema, several]})


def _each(values: Iterable[Any], read: Callable[[Any], T]) -> list[T]:
    """Read every item, so that all wrong ones are named together."""
    items: list[T] = []
    errors: list[tuple[KeyPath, PydanticCustomError]] = []
    for index, value in enumerate(values):
        try:
            items.append(read(value))
        except PydanticCustomError as error:
            errors.append(((index,), error))
            if len(errors) == MAX_SUGGESTIONS:
                break
    if errors:
        raise refusals(errors)
    return items


def read_list(value: Any, what: str, read: Callable[[Any], T]) -> tuple[T, ...]:
    """A list of at least one item."""
    if not isinstance(value, tuple | list):
        raise refusal(f"not a list of {what}", "a list", kind_of(value))
    if not value:
        raise refusal("an empty list", "at least one entry", "[]")
    return tuple(_each(value, read))


def read_ids(value: Any, what: str) -> tuple[str, ...]:
    """A list of at least one id, none twice."""
    if not isinstance(value, tuple | list):
        raise refusal(
            f"not a list of {what} ids", f"a list such as [{what}_a, {what}_b]", kind_of(value)
        )
    if not value:
        raise refusal("an empty list", f"at least one {what} id", "[]")
    seen: set[str] = set()
    return tuple(_each(value, lambda item: _read_id(item, what, seen)))


def _read_id(value: Any, what: str, seen: set[str]) -> str:
    if not isinstance(value, str) or not value:
        hint = "put it in quotes" if isinstance(value, int | float) else ""
        raise refusal(f"not a {what} id", "text", kind_of(value), hint)
    if value in seen:
        raise refusal("listed twice", "each id once", value)
    seen.add(value)
    return value


def _read_vector(value: Any) -> tuple[Quantity, ...]:
    if not isinstance(value, tuple | list) or len(value) != 3:
        found = f"{len(value)} figures" if isinstance(value, tuple | list) else kind_of(value)
        raise refusal("not a vector", "three lengths: [forward, right, down]", found)
    return tuple(_each(value, lambda item: read_quantity(item, Dimension.LENGTH)))


Vector = Annotated[
    tuple[float, float, float],
    ReadBy(
        _read_vector,
        {
            "type": "array",
            "items": quantity_schema(Dimension.LENGTH),
            "minItems": 3,
            "maxItems": 3,
            "description": "body axes: forward, right, down",
        },
    ),
]
