"""What is built in and changed once: an arm or a mounting that is off after a knock.

An arm or a mounting does not come and go, so one that is off for a part of a log is but the word
for something else.  A knock changes it for good, though.  It is the cause where with it nothing but
noise is left, from it to the log's end or from the log's beginning to it.  A survey or a reading
that is off from then on is none: that is what a wrong fix looks like.

What acts for a while only while something acts that has no name is none either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from syncline_design.diagnosis.result import Finding
from syncline_design.effects import registry

MOUNTED: Final = ("lever_arm", "mounting")  # kinds of assumptions that a knock breaks


def words_for(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Material findings that are the best word for something that has no name."""
    return tuple(one for one in findings if one.material and one.kind == "stand_in")


def within_words(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The findings, of which a cause that acts within the while of such a word is one as well: what
    is wrong then has no name, and the cause is what one part of it looks like."""
    spans = [(one.from_s, one.to_s) for one in words_for(findings)]
    inside = [
        one.from_s is not None and one.to_s is not None and any(
            first is not None and last is not None and first <= one.from_s and one.to_s <= last
            for first, last in spans
        ) for one in findings
    ]  # fmt: skip
    return tuple(
        replace(one, kind="stand_in") if hidden and one.kind == "cause" else one
        for one, hidden in zip(findings, inside, strict=True)
    )


def after_a_knock(findings: Sequence[Finding]) -> tuple[Finding, ...] | None:
    """Findings of a log in which they leave nothing but noise, with what a knock changed as the
    cause; None where there is a word for anything else, or for nothing."""
    words = words_for(findings)
    if not words or not all(
        one.changed_once and registry()[one.effect].breaks in MOUNTED for one in words
    ):
        return None
    return tuple(
        replace(one, kind="cause", sentence=f"{one.sentence}, as after a knock")
        if one in words else one for one in findings
    )  # fmt: skip
