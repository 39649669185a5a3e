"""What stands in the way of a design, in words, and what of it a study counts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from syncline_design.choice.outcome import Conflict, ConflictMember, Explanation, Fix
from syncline_design.report.study_words import misses_note
from syncline_design.studies.record import CaseRecord
from syncline_design.verdict.obstacle import obstacle_sentence, remedies_sentence
from syncline_design.verdict.tree import RequirementResult, decided


def members(ids: str) -> tuple[ConflictMember, ...]:
    return tuple(ConflictMember(one, "cost", 1) for one in ids.split())


def explanation(first: str, *further: str, minimal: bool = True) -> Explanation:
    conflict = Conflict(members(first), minimal)
    return Explanation((), conflict, tuple(map(members, further)), (), (), cut_short=not minimal)


@pytest.mark.parametrize(
    ("conflicts", "said"),
    [(("A",), "A cannot be met."),
     (("A B",), "A and B cannot hold together."),
     (("A", "B"), "A and B cannot be met, each for itself."),
     (("A", "B", "C"), "A, B and C cannot be met, each for itself."),
     (("A", "B C"), "B and C cannot hold together. Apart from that A cannot be met."),
     (("A B", "C", "D"), "A and B cannot hold together. Apart from that C and D cannot be met, "
                         "each for itself.")],
)  # fmt: skip
def test_all_that_stands_in_the_way_is_named(conflicts: tuple[str, ...], said: str) -> None:
    assert obstacle_sentence(explanation(*conflicts)) == said


def test_a_set_that_was_not_made_smaller_says_so() -> None:
    said = obstacle_sentence(explanation("A B C", minimal=False))
    assert said == "A, B and C cannot all hold together (a smaller set was not ruled out in time)."


def test_changes_that_help_only_together_are_offered_together() -> None:
    one, two = (cast(Fix, SimpleNamespace(text=text)) for text in ("raise A", "raise B"))
    why = explanation("A", "B")
    assert remedies_sentence(why) == ""
    both = replace(why, joint_fixes=((one, two),))
    assert remedies_sentence(both) == "Together these would do: raise A and raise B."
    assert remedies_sentence(replace(both, fixes=(one,))) == "This would do: raise A."
    two_ways = replace(both, fixes=(one, two))
    assert remedies_sentence(two_ways) == "Either of these would do: raise A; raise B."


def row(identity: str) -> RequirementResult:
    return decided(id=identity, kind="cost", status="fail", value=None, limit=1.0, unit="EUR")


@pytest.mark.parametrize(
    ("first", "minimal", "failing"),
    [("A", True, ("A", "B")), ("A", False, ("A", "B")), ("A B", True, ("A", "B")),
     ("A B", False, ())],
)  # fmt: skip
def test_a_study_counts_only_what_is_known_to_fail(
    first: str, minimal: bool, failing: tuple[str, ...]
) -> None:
    why = explanation(first, minimal=minimal)
    record = CaseRecord(verdict="infeasible", requirements=(row("A"), row("B")), infeasibility=why)
    assert record.failing == failing
    brief = SimpleNamespace(
        verdict="infeasible", failing=record.failing, unsettled=record.unsettled
    )
    note = misses_note(cast(Any, SimpleNamespace(briefs=[brief])))
    assert ("one case the time limit was over" in note) == (failing == ())
    assert ("no design meets together" in note) == (failing != ())
