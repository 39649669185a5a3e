"""What `timing` says of sessions that are not alike in their order, and whether its claim holds.

    python -m benchmarks.timing_order [--studies 400] [--seed 0] [--write docs/timing.md]

As in benchmarks.timing: a study is N sessions of 8 h of one simulated clock.  Clocks that are alike
are to be left alone; those that grow are to be found; of those whose level keeps a share of what it
was in the session before, the claim has to hold where it is made.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.docs_tables import put
from benchmarks.timing import CONFIDENCE, COVERAGE, FAMILIES, SAMPLES, SHARE, SIGMA_S, Make
from syncline_design import __version__
from syncline_design.clocks.tolerance import tolerance_bound
from syncline_design.clocks.trend import SessionCourse

Array = NDArray[np.float64]
Ordered = Callable[[np.random.Generator, int], Array]
SESSIONS = (5, 20, 60)
POPULATION = 20_000
BEGIN, END = "<!-- order: begin -->", "<!-- order: end -->"


def remembering(keep: float) -> Ordered:
    """A level that keeps so much of what it was in the session before (stationary), and noise."""

    def made(source: np.random.Generator, count: int) -> Array:
        level = source.normal(size=count)
        for k in range(1, count):
            level[k] = keep * level[k - 1] + np.sqrt(1.0 - keep**2) * level[k]
        return SIGMA_S * (2.0 * level[:, None] + 0.5 * source.normal(size=(count, SAMPLES)))

    return made


def growing(rate: float, spread: float) -> Ordered:
    """Scatter that grows by `rate` a session, log-normal about that."""

    def made(source: np.random.Generator, count: int) -> Array:
        scatter = (1.0 + rate) ** np.arange(count) * np.exp(spread * source.normal(size=count))
        return SIGMA_S * scatter[:, None] * source.normal(size=(count, SAMPLES))

    return made


def season(source: np.random.Generator, count: int) -> Array:
    """A daily swing from 3 us in winter to 15 us in summer, 120 sessions later."""
    swing = 3.0 + 12.0 * np.arange(count) / 120.0
    hours = np.arange(SAMPLES) / 60.0 + source.uniform(0.0, 24.0, (count, 1))
    noise = 0.3 * source.normal(size=(count, SAMPLES))
    return SIGMA_S * (swing[:, None] * np.sin(2.0 * np.pi * hours / 24.0) + noise)


GROWING: dict[str, Ordered] = {
    "scatter + 1 %, sessions alike to 10 %": growing(0.01, 0.1),
    "scatter + 2 %, alike to 10 %": growing(0.02, 0.1),
    "scatter + 2 %, alike to 20 %": growing(0.02, 0.2),
    "daily swing of 3 to 15 us over 120": season,
}
REMEMBERING: dict[str, float] = {f"level keeps {100 * k:.0f} %": k
                                 for k in (0.5, 0.8, 0.9, 0.95, 0.98)}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Told:
    """Of all studies of a cell: how many are said something of, how many carry a claim and hold.

    before: how many would hold if all sessions counted as independent.
    """

    family: str
    sessions: int
    studies: int
    said: int
    made: int
    held: int
    before: int


def told(name: str, make: Ordered, count: int, studies: int, seed: int, true_s: float) -> Told:
    """One cell; true_s: what 95 % of such sessions keep to for 95 % of their time [s]."""
    source = np.random.default_rng([seed, count, *name.encode()])
    said = made = held = before = 0
    for _ in range(studies):
        x = make(source, count)
        figures = np.quantile(np.abs(x), COVERAGE, axis=1, method="inverted_cdf")
        course = SessionCourse.of_figures(np.median(x, axis=1), figures, COVERAGE)
        said += bool(course.words or course.forbids)
        before += tolerance_bound(figures, SHARE, CONFIDENCE)[0] >= true_s
        if course.forbids is None:
            bound = tolerance_bound(figures, SHARE, CONFIDENCE, course.effective)[0]
            made, held = made + 1, held + (bound >= true_s)
    return Told(name, count, studies, said, made, held, before)


def truth(make: Make, seed: int) -> float:
    x = make(np.random.default_rng(seed), POPULATION)
    figures = np.quantile(np.abs(x), COVERAGE, axis=1, method="inverted_cdf")
    return float(np.quantile(figures, SHARE))


def cells(studies: int, seed: int) -> Iterator[Told]:
    ordered = {**FAMILIES, **GROWING}
    for name, make in ordered.items():
        yield from (told(name, make, n, studies, seed, 0.0) for n in SESSIONS)
    for name, keep in REMEMBERING.items():
        true_s = truth(remembering(0.0), seed)  # each level alone is drawn from the same
        yield from (told(name, remembering(keep), n, studies, seed, true_s) for n in SESSIONS)


def _row(found: Sequence[Told], name: str, words: Callable[[Told], str]) -> str:
    return f"| {name} | " + " | ".join(words(c) for c in found if c.family == name) + " |"


def _holding(cell: Told) -> str:
    made = f"{100 * cell.held / cell.made:.1f} % of {cell.made}" if cell.made else "none made"
    return f"{100 * cell.before / cell.studies:.1f} %; {made}"


def report(found: Sequence[Told], studies: int, seed: int) -> str:
    """The tables of the documentation."""
    head = " | ".join(f"{n} sessions" for n in SESSIONS)
    top = ["", f"| clock | {head} |", "|---|" + "---|" * len(SESSIONS)]
    day = datetime.now(UTC).strftime("%Y-%m-%d")
    lines = [f"Measured {day} with syncline-design {__version__}, seed {seed}, {studies} studies a "
             "cell (`python -m benchmarks.timing_order`).", "",
             "**Share of studies of which something is said**", *top]  # fmt: skip
    lines += [_row(found, name, lambda c: f"{100 * c.said / c.studies:.1f} %")
              for name in dict.fromkeys(cell.family for cell in found)]  # fmt: skip
    lines += ["", "**Claims that hold: of sessions taken as independent; those that are made, of "
              "how many studies**", *top]  # fmt: skip
    lines += [_row(found, name, _holding) for name in REMEMBERING]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", type=Path)
    chosen = parser.parse_args()
    text = report(list(cells(chosen.studies, chosen.seed)), chosen.studies, chosen.seed)
    print(text)
    if chosen.write is not None:
        put(chosen.write, text, BEGIN, END)


if __name__ == "__main__":
    main()
