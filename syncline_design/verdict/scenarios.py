"""Whether a spec is judged in one scenario or in several."""

from __future__ import annotations

from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, Flaw


def is_family(case: Case) -> bool:
    """Whether a spec is judged in more than one scenario."""
    return bool(case.missions) or case.spec.choose_for != "nominal"


def refuse_missions(case: Case) -> None:
    """BadInput where one system is meant and the spec has several missions."""
    if case.missions:
        place = case.position(("missions",))
        message = "several missions, and this works on one system"
        hint = "give it a spec of one mission: its overrides put into stages and requirements"
        raise BadInput((Flaw(str(case.path), *place, "missions", message, hint=hint),))
