"""From which value on something no longer holds: values that grow, then bisection."""

from __future__ import annotations

from collections.abc import Callable, Sequence

BISECTIONS = 60


CLOSE = 1e-6


def tried(value: float, growths: Sequence[float], fails_at: float | None = None) -> list[float]:
    """Values to try, rising; just above the one at which the verdict fails is one of them."""
    scale = value or (fails_at or 1.0) * 1e-6
    values = {scale * growth for growth in growths}
    if fails_at is not None:
        edge = max(fails_at, value)
        values |= {edge * (1.0 + 1e-9) or 1e-12, max(value, edge * (1.0 - CLOSE))}
    return sorted(values)


def first_failing(
    holds: Callable[[float], bool],
    values: Sequence[float],
    start: float | None = None,
    close: float = CLOSE,
) -> float | None:
    """Least of the values (and between them, to `close`) at which something no longer holds."""
    last = values[0] if start is None else start
    for value in values:
        if not holds(value):
            return edge(holds, last, value, close)
        last = value
    return None


def edge(holds: Callable[[float], bool], works: float, fails: float, close: float) -> float:
    for _ in range(BISECTIONS):
        if fails - works <= close * abs(fails):
            break
        middle = 0.5 * (works + fails)
        works, fails = (middle, fails) if holds(middle) else (works, middle)
    return fails
