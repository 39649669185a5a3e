"""Requirements: what a design must keep, by kind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import date
from fractions import Fraction
from typing import Any, Final, Literal

from pydantic import ValidationInfo, model_validator
from pydantic import field_validator as reads_field

from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.model.unit_table import SI_UNITS
from syncline_design.spec.fields import (
    Day,
    FileRecord,
    NonEmptyText,
    read_number,
    read_quantity,
    refusal,
    refusals,
)

LIMIT_DIMENSIONS: dict[str, Dimension] = {
    "accuracy": Dimension.LENGTH,
    "sync": Dimension.DIMENSIONLESS,
    "cost": Dimension.MONEY,
    "mass": Dimension.MASS,
    "power": Dimension.POWER,
    "monte_carlo": Dimension.LENGTH,
    "worst_case": Dimension.LENGTH,
    "thu": Dimension.LENGTH,
    "tvu": Dimension.LENGTH,
    "rmse": Dimension.LENGTH,
    "quantile": Dimension.LENGTH,
    "sample_spacing": Dimension.LENGTH,
}
STATED_KINDS: Final = ("worst_case", "thu", "tvu", "rmse", "quantile")  # of the error's figures
JUDGED_KINDS: Final = ("monte_carlo", *STATED_KINDS)  # decided design by design, not by sums
SUMMED_KINDS: Final = tuple(kind for kind in LIMIT_DIMENSIONS if kind not in JUDGED_KINDS)
# SI units of limits; an amount of money is in the currency of its spec.
LIMIT_UNITS: Final = {kind: SI_UNITS[d] for kind, d in LIMIT_DIMENSIONS.items() if d in SI_UNITS}
DEFAULT_CONFIDENCE: Final = 0.95
ErrorAxis = Literal["horizontal", "vertical", "3d"]
KEYS_OF: Final[dict[str, tuple[str, ...]]] = {  # keys of their own, those in capitals due
    "monte_carlo": ("QUANTILE",),
    "thu": ("confidence",),
    "tvu": ("confidence",),
    "rmse": ("AXIS",),
    "quantile": ("of", "P"),
}
_EXAMPLES: Final = {"quantile": "a quantile such as 0.95", "p": "a share such as 0.95",
                    "axis": "horizontal, vertical or 3d"}  # fmt: skip


class DistanceLimit(Quantity):
    """A limit that grows with distance d: rule (a, b, of), its value that at one d [m]."""

    __slots__ = ("rule",)
    rule: tuple[Quantity, Quantity, Quantity | None]

    @staticmethod
    def at(rule: tuple[Quantity, Quantity, Quantity | None], distance_m: float) -> DistanceLimit:
        """sqrt(a^2 + (b d)^2) [m], the form of IHO S-44 (Special Publication 44, 6th ed., 2020)."""
        a, b, of = rule
        value = math.hypot(a, b * (distance_m if of is None else of))
        text = format_quantity(value, Dimension.LENGTH)
        made = Quantity.__new__(DistanceLimit, Fraction(value), text)
        object.__setattr__(made, "rule", rule)
        return made  # type: ignore[return-value]

    def __reduce__(self) -> tuple[Any, ...]:
        return _limit_again, (self.rule, self.exact, self.text)


def _limit_again(
    rule: tuple[Quantity, Quantity, Quantity | None], exact: Fraction, text: str
) -> DistanceLimit:
    made = Quantity.__new__(DistanceLimit, exact, text)
    object.__setattr__(made, "rule", rule)
    return made  # type: ignore[return-value]


def read_distance_limit(value: Mapping[str, Any]) -> DistanceLimit:
    """`{a: 0.15 m, b: 0.0075}`; its value is set where the distance is known."""
    wrong = [
        (("limit", key), refusal("unknown key", "one of a, b, of"))
        for key in value
        if key not in ("a", "b", "of")
    ]
    wrong += [(("limit", key), refusal("missing", example)) for key, example in
              (("a", "a length such as 0.25 m"), ("b", "a number such as 0.02"))
              if key not in value]  # fmt: skip
    if wrong:
        raise refusals(wrong)
    a = read_quantity(value["a"], Dimension.LENGTH, 0.0)
    b = read_number(value["b"], 0.0)
    given = value.get("of")
    of = None if given is None else read_quantity(given, Dimension.LENGTH, 0.0, above=True)
    if a == 0.0 and b == 0.0:
        raise refusal("out of range", "a or b more than 0", "both 0")
    return DistanceLimit.at((a, b, of), 0.0)


class Waiver(FileRecord):
    """Why a requirement may be missed, and until when."""

    reason: NonEmptyText
    expires: Day  # the requirement counts again after it

    def holds_on(self, day: date) -> bool:
        """Whether the waiver still counts; its last day does."""
        return day <= date.fromisoformat(self.expires)


class Requirement(FileRecord):
    """One requirement; limit is a Quantity of the kind's dimension (a bare number for sync)."""

    id: NonEmptyText
    kind: Literal[
        "accuracy", "sync", "cost", "mass", "power", "monte_carlo",
        "worst_case", "thu", "tvu", "rmse", "quantile", "sample_spacing",
    ]  # fmt: skip
    limit: float
    quantile: float | None = None
    confidence: float | None = None
    axis: ErrorAxis | None = None
    of: ErrorAxis | None = None
    p: float | None = None
    waiver: Waiver | None = None
    note: str = ""

    @reads_field("limit", mode="plain", json_schema_input_type=str | float)
    @classmethod
    def _read_limit(cls, value: Any, info: ValidationInfo) -> Any:
        kind = info.data.get("kind")
        if kind is None:  # its own error is enough
            return value
        if kind == "sync":
            return read_number(value, 0.0, above=True)
        if kind in STATED_KINDS and isinstance(value, Mapping):
            return read_distance_limit(value)
        above = kind in ("accuracy", "sample_spacing", *JUDGED_KINDS)
        return read_quantity(value, LIMIT_DIMENSIONS[kind], 0.0, above)

    @reads_field("quantile", "confidence", "p", mode="plain", json_schema_input_type=float)
    @classmethod
    def _read_share(cls, value: Any) -> Quantity | None:
        if value is None:
            return None
        number = read_number(value)
        if not 0.0 < number < 1.0:
            raise refusal("out of range", "between 0 and 1, such as 0.95", number.text)
        return number

    @property
    def limit_written(self) -> str | None:
        """The limit as it was written, `0.30 m`.

        None of an amount of money, of a bare number, and where it varies with the distance.
        """
        limit = self.limit
        if self.kind in ("sync", "cost") or type(limit) is not Quantity or not limit.text:
            return None
        return " ".join(limit.text.split())

    @model_validator(mode="after")
    def _keys_fit_kind(self) -> Requirement:
        own = KEYS_OF.get(self.kind, ())
        wrong = []
        for key in ("quantile", "confidence", "axis", "of", "p"):
            given = getattr(self, key) is not None
            if key.upper() in own and not given:
                wrong.append(((key,), refusal("missing", _EXAMPLES[key])))
            elif given and key not in own and key.upper() not in own:
                message = f"a {self.kind} requirement takes no {key}"
                wrong.append(((key,), refusal(message, hint="delete it")))
        if wrong:
            raise refusals(wrong)
        return self

    @property
    def share(self) -> float | None:
        """The share of errors that has to keep the limit, where it is one."""
        given = self.quantile or self.confidence or self.p
        if given is None and self.kind in ("thu", "tvu"):
            return DEFAULT_CONFIDENCE
        return None if given is None else float(given)
