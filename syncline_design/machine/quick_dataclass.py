"""`dataclass` as in the standard library, with methods that are made when they are first needed.

The standard decorator compiles six functions for a frozen class, 0.4 ms of processor time at every
start of a process, used or not; a command imports some three hundred such classes and makes
instances of a part of them.  Here the standard decorator only reads the fields (and makes the
slots); `__init__` is compiled for the first instance, comparison, hash and text are shared by all
classes.  To a type checker it is the standard decorator itself.
"""

from __future__ import annotations

import dataclasses
import functools
import reprlib
from collections.abc import Callable
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass

_MISSING: Final = dataclasses.MISSING


def _dataclass(
    cls: Any = None,
    /,
    *,
    frozen: bool = False,
    slots: bool = False,
    kw_only: bool = False,
    eq: bool = True,
) -> Any:
    """The class as a dataclass; the arguments are the standard ones."""
    if cls is None:
        return functools.partial(_dataclass, frozen=frozen, slots=slots, kw_only=kw_only, eq=eq)
    made: Any = dataclasses.dataclass(
        cls, init=False, repr=False, eq=False, slots=slots, kw_only=kw_only
    )
    own = vars(made)
    if "__init__" not in own:
        made.__init__ = _first_init(made, frozen)
    if "__repr__" not in own:
        made.__repr__ = _repr
    if eq:
        _compare(made, frozen)
    if frozen:
        made.__setattr__, made.__delattr__ = _refuse_set, _refuse_delete
        if slots:
            made.__getstate__, made.__setstate__ = _state, _restore
    return made


if not TYPE_CHECKING:
    dataclass = _dataclass


def _compare(made: Any, frozen: bool) -> None:
    """Comparison by the fields, and a hash where nothing can change."""
    own = vars(made)
    hashed = own.get("__hash__", _MISSING)
    if hashed is _MISSING or (hashed is None and "__eq__" in own):
        made.__hash__ = _hash if frozen else None
    if "__eq__" not in own:
        made.__eq__ = _eq


def _first_init(cls: Any, frozen: bool) -> Callable[..., None]:
    """An `__init__` that puts the compiled one in its place when it is called."""

    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:  # noqa: N807
        init = cls.__init__ = _compiled_init(cls, frozen)
        init(self, *args, **kwargs)

    return __init__


def _compiled_init(cls: Any, frozen: bool) -> Callable[..., None]:
    """`__init__` of the fields of a class."""
    names: dict[str, Any] = {"_set": object.__setattr__, "_missing": _MISSING}
    plain: list[str] = ["self"]
    named: list[str] = []
    body: list[str] = []
    for one in dataclasses.fields(cls):
        value = _value(one, names, "__slots__" in vars(cls))
        if one.init:
            default = "" if one.name not in names else f"={one.name}"
            (named if one.kw_only else plain).append(one.name + default)
        if value is not None:
            body.append(
                f"_set(self, {one.name!r}, {value})" if frozen else f"self.{one.name} = {value}"
            )
    if hasattr(cls, "__post_init__"):
        body.append("self.__post_init__()")
    arguments = ", ".join([*plain, *(["*", *named] if named else [])])
    text = "\n    ".join([f"def __init__({arguments}):", *(body or ["pass"])])
    exec(text, names)
    init: Callable[..., None] = names.pop("__init__")
    init.__qualname__, init.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    return init


def _value(one: Any, names: dict[str, Any], slots: bool) -> str | None:
    """What a field is set to; defaults go under its name to `names`. None: nothing sets it here."""
    if one.default_factory is not _MISSING:
        names[f"_make_{one.name}"] = one.default_factory
        if not one.init:
            return f"_make_{one.name}()"
        names[one.name] = _MISSING
        return f"_make_{one.name}() if {one.name} is _missing else {one.name}"
    if one.default is not _MISSING:
        names[one.name] = one.default
    if one.init or (slots and one.default is not _MISSING):
        return str(one.name)
    return None


@functools.cache
def _getter(cls: Any, hashed: bool = False) -> Callable[[Any], tuple[Any, ...]]:
    """The fields that are compared (or hashed) of an instance."""
    names = [
        one.name
        for one in dataclasses.fields(cls)
        if (one.hash if hashed and one.hash is not None else one.compare)
    ]
    if len(names) > 1:
        return attrgetter(*names)
    return lambda self: tuple(getattr(self, name) for name in names)


def _eq(self: Any, other: Any) -> bool:
    if other.__class__ is not self.__class__:
        return NotImplemented  # type: ignore[no-any-return]
    values = _getter(self.__class__)
    return bool(values(self) == values(other))


def _hash(self: Any) -> int:
    return hash(_getter(self.__class__, True)(self))


@reprlib.recursive_repr()
def _repr(self: Any) -> str:
    shown = (
        f"{one.name}={getattr(self, one.name)!r}" for one in dataclasses.fields(self) if one.repr
    )
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _is_fixed(kind: Any, name: str) -> bool:
    """Only a plain subclass may hold more than the fields."""
    return "__dataclass_fields__" in vars(kind) or name in kind.__dataclass_fields__


def _refuse_set(self: Any, name: str, value: object) -> None:
    if _is_fixed(type(self), name):
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _refuse_delete(self: Any, name: str) -> None:
    if _is_fixed(type(self), name):
        raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
    object.__delattr__(self, name)


def _state(self: Any) -> list[Any]:
    """For pickle and copy."""
    return [getattr(self, one.name) for one in dataclasses.fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for one, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, one.name, value)
