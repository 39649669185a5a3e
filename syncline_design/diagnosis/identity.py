"""Effects of a model by their label: which they are, and the model less one of them."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.diagnosis.fitting import Model
from syncline_design.effects.record import Effect

Label = tuple[str, str, int]


def without(model: Model, label: Label) -> Model:
    """The model less one effect, not fitted again; its noise within what is left open."""
    acting = tuple(a for a in model.acting if a.label != label)
    opened = tuple(o for o in model.opened if o.candidate.label != label)
    return replace(model, acting=acting, opened=opened)


def effect_of(model: Model, label: Label) -> Effect:
    """The effect of a label that the model holds."""
    acting = {a.label: a.effect for a in model.acting}
    return acting.get(label) or {o.candidate.label: o.candidate.effect for o in model.opened}[label]
