"""How a measured log names its columns, as a spec says it."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from syncline_design.units import UNITS, suffix_unit
from syncline_design.values import Loc, Record, Text, did_you_mean, refusal, refusals


def split_column(text: str) -> tuple[str, str]:
    """`att.phi [rad]` -> (`att.phi`, `rad`); without brackets the unit is empty."""
    whole = text.strip()
    name, bracket, unit = whole.rpartition("[")
    bare = name.rstrip()
    if not (bracket and bare and bare != name and whole.endswith("]")) or "]" in unit[:-1]:
        return whole, ""
    return bare, unit[:-1].strip()


class LogChoice(Record):
    """How a measured log names its columns: canonical name to `their.name [unit]`."""

    columns: dict[Text, Text] = Field(default_factory=dict)
    files: tuple[Text, ...] = ()

    @model_validator(mode="after")
    def _units_fit(self) -> LogChoice:
        errors: list[tuple[Loc, PydanticCustomError]] = []
        for canonical, theirs in self.columns.items():
            dimension, (_, unit) = suffix_unit(canonical)[1], split_column(theirs)
            known = UNITS.get(unit)
            if unit and known is None:
                hint = did_you_mean(unit, UNITS)
                errors.append(
                    (("columns", canonical), refusal("unknown unit", found=repr(unit), hint=hint))
                )
            elif known is not None and known[0] is not dimension:
                error = refusal("wrong dimension", dimension.value, f"{unit} ({known[0].value})")
                errors.append((("columns", canonical), error))
        if errors:
            raise refusals(errors)
        return self
