"""Text that came from a spec, made harmless and visible before it enters any output."""

from __future__ import annotations

import re
from typing import Final

from syncline_design.model.unit_table import UNITS

_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_CONTROL_PICTURES = 0x2400  # U+2400..U+241F picture the C0 controls, U+2421 pictures DEL
_DIRECTION_OR_BREAK = {
    0x061C, 0x200E, 0x200F, 0x2028, 0x2029,
    *range(0x202A, 0x202F), *range(0x2066, 0x206A), 0xFEFF,
}  # fmt: skip
_SPREADSHEET_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_MICRO = re.compile(r"(?<=\d) u(?=(?:[smW]|rad)\b)")
# besides those of specs: as pages print them, and of figures that no spec states
_BESIDE: Final = ("m/s\N{SUPERSCRIPT TWO}", "deg/s\N{SUPERSCRIPT TWO}", "m/(m/s2)", "mm/(m/s2)",
                  "nat", "\N{GREEK SMALL LETTER SIGMA}", "kB", "MB", "GB")  # fmt: skip
_UNIT: Final = "|".join(map(re.escape, sorted((*UNITS, *_BESIDE), key=len, reverse=True)))
_GAP: Final = re.compile(rf"(?<=\d) (?=\d{{3}}(?!\d)|\u00b1|(?:{_UNIT})(?!\w))|(?<=\u00b1) (?=\d)")
_STAMP: Final = re.compile(
    r"(?<![\w.,:/-])(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d(?:\.\d+)?)Z(?![\w.:/-]*\w)"
)
_MONEY: Final = re.compile(r"(?<![\w.])\d{4,}(?=(?:\.\d+)? [A-Z]{3}(?!\w))")
_MARKDOWN_SPECIAL = re.compile(r"([\\`*_{}\[\]()#+!|~^$])")


def _visible_character(code: int) -> str | None:
    """What stands in for a character that must not reach an output as it is; None: keep it."""
    if code < 0x20:
        return chr(_CONTROL_PICTURES + code)
    if code == 0x7F:
        return "\N{SYMBOL FOR DELETE}"
    if 0x80 <= code <= 0x9F or 0xD800 <= code <= 0xDFFF or (code & 0xFFFE) == 0xFFFE:
        return _REPLACEMENT
    if code in _DIRECTION_OR_BREAK:
        return f"\N{LEFT-POINTING ANGLE BRACKET}U+{code:04X}\N{RIGHT-POINTING ANGLE BRACKET}"
    return None


def visible(text: object) -> str:
    """One line of text in which control, direction and broken characters show as pictures.

    A newline becomes U+240A, BEL U+2407, a bidi override its code point in brackets, a lone
    surrogate U+FFFD: the result is valid in XML 1.0, cannot start a new line and cannot reorder
    what stands beside it.
    """
    plain = str(text)
    if plain.isascii() and plain.isprintable():
        return plain
    return "".join(_visible_character(ord(c)) or c for c in plain)


def ticked(text: str) -> list[str]:
    """A sentence for people, apart at its backticks: every second part is code.

    An odd backtick stays as it is, with all others.  Outside of code a figure has its micro sign,
    `up to 24.16 \N{MICRO SIGN}s`, as in tables; specs and commands are written without it.
    """
    parts = text.split("`")
    if len(parts) % 2 == 0:
        parts = [text]
    return [part if k % 2 else _MICRO.sub("\N{NO-BREAK SPACE}\N{MICRO SIGN}", part)
            for k, part in enumerate(parts)]  # fmt: skip


def unticked(text: str) -> str:
    """The same without its backticks, where nothing shows code in a style of its own."""
    return "".join(ticked(text))


def unbroken(text: str) -> str:
    """A text in which no line ends inside a figure, or between it and its unit."""
    return _GAP.sub("\N{NO-BREAK SPACE}", text)


def dated(text: str) -> str:
    """A text whose moments a person reads, and a line may end in: `2026-09-27 14:13:20 UTC`."""
    return _STAMP.sub(r"\1 \2 UTC", text)


def grouped(text: str) -> str:
    """A text in which amounts of money have their thousands apart, `32 000 EUR`."""
    return _MONEY.sub(lambda found: f"{int(found[0]):,}".replace(",", "\N{NO-BREAK SPACE}"), text)


def spreadsheet_safe(text: object) -> str:
    """A CSV text cell that no spreadsheet reads as a formula (a leading apostrophe stops it)."""
    shown = visible(text)
    raw = str(text)
    return "'" + shown if raw.lstrip(" ").startswith(_SPREADSHEET_FORMULA) else shown


def markdown_safe(text: object) -> str:
    """Text that Markdown shows literally: no markup, no HTML, no mention, no table cell end."""
    shown = visible(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    escaped = _MARKDOWN_SPECIAL.sub(r"\\\1", shown)
    return escaped.replace("@", "&#64;").replace("://", ":&#8203;//")


def shortened(text: str, most: int = 30) -> str:
    """Text made harmless for a figure's label; the tables have it in full."""
    shown = visible(text)
    return shown if len(shown) <= most else shown[: most - 1] + "\N{HORIZONTAL ELLIPSIS}"
