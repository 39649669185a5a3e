"""A mapping that cannot be changed, for what is handed out as frozen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class FrozenMap(dict[K, V]):
    """A `dict` that is read only; unlike `types.MappingProxyType` it travels between processes."""

    __slots__ = ()

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a result is frozen: make a dict of this mapping to change it")

    __setitem__ = __delitem__ = clear = pop = popitem = setdefault = update = _refuse
    __ior__ = _refuse

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


def frozen(value: Mapping[K, V]) -> FrozenMap[K, V]:
    """The mapping as one that cannot be changed."""
    return value if isinstance(value, FrozenMap) else FrozenMap(value)
