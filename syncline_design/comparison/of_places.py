"""Which files tell places to diagnose, and which messages with stamps alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from syncline_design.logs.log_files import no_places_in, tells_all
from syncline_design.spec.case import Case
from syncline_design.spec.log_block import LogChoice, StreamChoice


def as_of_places(case: Case, places: Sequence[Path]) -> Case:
    """The spec as a diagnosis reads it.

    Where tables of the call tell all that it needs by themselves, the streams that the spec names
    are of recordings beside them, and named for their stamps.
    """
    choice = case.spec.log
    if choice is None or not tells_all(places, choice, _stages(case)):
        return case
    stamps = choice.model_copy(update={"streams": StreamChoice()})
    return replace(case, spec=case.spec.model_copy(update={"log": stamps}))


def stamps_alone(case: Case, places: Sequence[Path], stamps: Sequence[Path]) -> str:
    """Why these recordings were read for their stamps alone; "" where they tell places, or are
    none."""
    if not places or not set(places) <= set(stamps):
        return ""
    why = no_places_in(places, case.spec.log or LogChoice(), _stages(case))
    if not why:
        return ""
    names = ", ".join(path.name for path in places)
    return f"{names}: read for the stamps alone, no log of places for a diagnosis: {why}"


def _stages(case: Case) -> list[str]:
    return [stage.choice.name for stage in case.stages]
