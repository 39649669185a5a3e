"""The faults that shapes of an offset are: drift, steps, locks that settle, each in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.epochs import LARGE_SLIP_S
from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import Array, in_words
from syncline_design.model.figure_text import signed, to_digits

_SMALL: Final = 0.1  # of the largest stretch: rates that are hardly another
_LEAST_S: Final = 2e-5
PLACES: Final = 101  # of a course, of which rates are told
_SURELY: Final = 100  # standard deviations


def all_named(shapes: Sequence[Shape], time_s: Array) -> Iterator[StampFault]:
    """One fault for all that moves slowly, one for every other shape."""
    slow = tuple(s for s in shapes if s.kind in ("drift", "bend", "ramp"))
    if any(s.kind == "ramp" for s in slow) and not any(s.kind == "bend" for s in slow):
        yield from _pieces(slow, time_s)
    elif slow:
        yield _drift(slow, time_s)
    for shape in shapes:
        if shape not in slow:
            yield _named(shape, time_s)


def _pieces(slow: tuple[Shape, ...], time_s: Array) -> Iterator[StampFault]:
    """Drift that begins or ends within the log, or changes its rate: one fault a stretch."""
    first, last = float(time_s[0]), float(time_s[-1])
    ends = {e for s in slow if s.kind == "ramp" for e in (s.begin_s, s.end_s)}
    edges = np.asarray(sorted({first, last, *(e for e in ends if first < e < last)}))
    moved = -np.diff(course(slow, edges))
    for begin, end, size in zip(edges[:-1], edges[1:], moved, strict=True):
        if abs(size) < max(_SMALL * float(np.max(np.abs(moved))), _LEAST_S):
            continue
        ppm = 1e6 * float(size) / float(end - begin)
        yield StampFault(
            "drift", {"ppm": ppm}, float(begin), float(end),
            f"stamps run {to_digits(abs(ppm), 4)} ppm {'fast' if ppm > 0 else 'slow'} against "
            f"receipts from "
            f"{to_digits(begin, 4)} to {to_digits(end, 4)} s: {in_words(abs(float(size)))}",
        )  # fmt: skip


def _drift(slow: tuple[Shape, ...], time_s: Array) -> StampFault:
    """Rate of the stamps against receipts: its mean, and from where to where it changes."""
    grid = np.linspace(float(time_s[0]), float(time_s[-1]), PLACES)
    moved = -course(slow, grid)
    length = float(grid[-1] - grid[0])
    ppm = 1e6 * float(moved[-1] - moved[0]) / length
    sure = max(abs(s.size_s) / max(s.sigma_s, 1e-12) for s in slow)
    parameters: dict[str, float | str] = {"ppm": ppm}
    words = (
        f"stamps run {to_digits(abs(ppm), 4)} ppm {'fast' if ppm > 0 else 'slow'} against receipts"
    )
    if len(slow) > 1 or slow[0].kind == "bend":
        parameters = wandering_rates(grid, moved)
        low, high = float(parameters["ppm_low"]), float(parameters["ppm_high"])
        words += f" in the mean, between {signed(low, 3)} and {signed(high, 3)} ppm"
    span = in_words(float(np.ptp(moved)))
    words += f": {span} over the log, {_times(sure)} its uncertainty"
    return StampFault("drift", parameters, None, None, words)


def wandering_rates(time_s: Array, moved: Array) -> dict[str, float | str]:
    """Parameters of a drift that changes its rate: mean, least and largest rate, reach in all;
    moved: stamp minus receipt [s]."""
    rate = 1e6 * np.diff(moved) / np.diff(time_s)
    ppm = 1e6 * float(moved[-1] - moved[0]) / float(time_s[-1] - time_s[0])
    return {"ppm": ppm, "kind": "wandering", "ppm_low": float(rate.min()),
            "ppm_high": float(rate.max()), "span_s": float(np.ptp(moved))}  # fmt: skip


def _named(shape: Shape, time_s: Array) -> StampFault:
    end = float(time_s[-1])
    size = -shape.size_s
    sure = f"{_times(abs(shape.size_s) / max(shape.sigma_s, 1e-12))} its uncertainty"
    if shape.kind in ("step", "episode"):
        stop = end if shape.kind == "step" else shape.end_s
        lasts = "and stay so" if shape.kind == "step" else f"until {to_digits(stop, 4)} s"
        return StampFault(
            "step", {"seconds": size}, shape.begin_s, stop,
            f"stamps move by {_signed(size)} against receipts {lasts}, {sure}",
        )  # fmt: skip
    away = "drift away and settle" if shape.kind == "holdover" else "jump and settle"
    stop = min(end, shape.end_s + 5.0 * shape.settle_s)
    return StampFault(
        "relock", {"seconds": size, "settling_s": shape.settle_s}, shape.begin_s, stop,
        f"stamps {away} again: {_signed(size)}, time constant {to_digits(shape.settle_s, 3)} s",
    )  # fmt: skip


def _times(sure: float) -> str:
    """How often a size is its uncertainty; beyond what any model of noise holds for, no figure."""
    return f"{to_digits(sure, 3)} times" if sure < _SURELY else f"more than {_SURELY} times"


def _signed(size_s: float) -> str:
    return f"{'+' if size_s >= 0 else '-'}{in_words(abs(size_s))}"


def is_whole(size_s: float, exact_s: float) -> bool:
    """Whether a jump that is known so well is of whole seconds, and of no other epoch."""
    whole = round(size_s)
    return 0 < abs(whole) < LARGE_SLIP_S and abs(size_s - whole) < exact_s


def slipped(
    seconds: int, count: int, span_s: tuple[float, float], falls: int, *, ends: bool
) -> StampFault:
    """A stretch of so many messages whose stamps are whole seconds off; ends: within the log."""
    back = Consequence("backward_jump", {"count": float(falls)},
                       "stamps go back where the slip begins or ends")  # fmt: skip
    return StampFault(
        "whole_second_slip", {"seconds": float(seconds), "count": float(count)}, *span_s,
        f"{count} messages are stamped {abs(seconds)} s {'ahead' if seconds > 0 else 'behind'}"
        + ("" if ends else ", to the end of the log"), (back,) if falls else (),
    )  # fmt: skip
