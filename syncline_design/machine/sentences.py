"""Parts of sentences that several rooms say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

MOST_NAMED: Final = 3  # members of a class that a headline names


def sentence_list(items: list[str], last: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`."""
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} {last} {items[-1]}"


def one_of(known: Sequence[str]) -> str:
    """What is expected where these are known: `one of a, b`, or the only one."""
    return f"one of {', '.join(known)}" if len(known) > 1 else known[0]


def any_of(names: Sequence[str], most: int = MOST_NAMED) -> str:
    """`a`, `a or b`, `a, b or one of 3 others`: which it may be, the first few by name."""
    more = len(names) - most
    if more <= 0:
        return sentence_list(list(names), "or")
    rest = "another one" if more == 1 else f"one of {more} others"
    return sentence_list([*names[:most], rest], "or")


def or_rivals(names: Iterable[str]) -> str:
    """What a log does not tell from what was just said; empty where there is none."""
    listed = " or ".join(names)
    return f" (or {listed}: this log cannot tell)" if listed else ""


def left_out(count: int, line: int, message: str) -> str:
    """Damaged lines that were left out, the first of them and what is wrong with it, in words."""
    if count == 1:
        return f"1 damaged line was left out, line {line}: {message}"
    return f"{count} damaged lines were left out, the first of them line {line}: {message}"
