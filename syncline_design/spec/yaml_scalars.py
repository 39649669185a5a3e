"""Unquoted scalars of YAML: the 1.2 core schema, strict about what people mean as a number."""

from __future__ import annotations

import re
from typing import Any

MAX_NUMBER_LENGTH = 60

_INT = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_FLOAT = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?")
_WORDS: dict[str, bool | None] = {
    "": None, "~": None, "null": None, "Null": None, "NULL": None,
    "true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False,
}  # fmt: skip


class Number(float):
    """A decimal number of a file: its value, and its text for exact work."""

    __slots__ = ("text",)
    text: str

    def __new__(cls, text: str) -> Number:
        self = super().__new__(cls, text)
        self.text = text
        return self


def plain_scalar(text: str) -> Any:
    """Value of an unquoted scalar, YAML 1.2 core schema.

    What that schema takes for a number but people do not mean as one (leading zeros, 0x, 0o, .inf,
    .nan) or what no float holds stays text, so that a numeric field can say what is wrong with it.
    """
    if text in _WORDS:
        return _WORDS[text]
    if len(text) > MAX_NUMBER_LENGTH or text[0] not in "+-.0123456789":
        return text
    if _INT.fullmatch(text):
        return int(text) if len(text) <= 18 else _number_or_text(text)
    return _number_or_text(text) if _FLOAT.fullmatch(text) else text


def _number_or_text(text: str) -> Number | str:
    number = Number(text)
    vanished = number == 0.0 and re.search(r"[1-9]", re.split("[eE]", text)[0])
    return text if number in (float("inf"), float("-inf")) or vanished else number
