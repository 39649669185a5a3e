"""Physical effects, one file each; presence in this folder is registration."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from syncline_design.effects.record import Effect

NOT_EFFECTS = frozenset({"acting", "kinematics", "record", "underway"})


@cache
def registry() -> dict[str, Effect]:
    """Every effect by name, sorted; each module of this folder holds one `EFFECT`."""
    names = sorted(m.name for m in iter_modules(__path__) if m.name not in NOT_EFFECTS)
    effects = [import_module(f"{__name__}.{name}").EFFECT for name in names]
    return {effect.name: effect for effect in effects}


def plain_delay() -> Effect:
    """The constant delay of any sensor: what a slip of whole seconds is a case of."""
    slips = (one.undoing.instead_of for one in registry().values() if one.undoing is not None)
    return registry()[next(name for name in slips if name)]
