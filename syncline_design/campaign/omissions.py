"""Runs of a store that are counted no more, and those that are counted again: lines of the chain.

Nothing is taken off the file.  A run is left out by a line of its own and comes back by another,
each with its date and its reason; the last of them holds, and all of them are told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final

from syncline_design.machine.quick_dataclass import dataclass

LEFT_OUT: Final = "left_out"
TAKEN_BACK: Final = "taken_back"
KINDS: Final = (LEFT_OUT, TAKEN_BACK)


class OmissionError(ValueError):
    """A line that no run of the store can have."""


@dataclass(frozen=True, slots=True)
class Omission:
    """That a run is counted no more (back: counts again): since when, and why."""

    run: int
    since: str
    reason: str
    back: bool

    @property
    def body(self) -> dict[str, Any]:
        """As a line of the store holds it."""
        kind = TAKEN_BACK if self.back else LEFT_OUT
        return {"kind": kind, "run": self.run, "since": self.since, "reason": self.reason}


def omission_of(body: Mapping[str, Any], known: Sequence[Omission], runs: int) -> Omission:
    """A line's omission; OmissionError where it is none that follows from those before it."""
    try:
        found = Omission(int(body["run"]), str(body["since"]), str(body["reason"]),
                         body["kind"] == TAKEN_BACK)  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise OmissionError(f"no run, date or reason ({error})") from None
    demand_following(found, known, runs)
    return found


def demand_following(one: Omission, known: Sequence[Omission], runs: int) -> None:
    """Refuse to leave out what is left out or not there, and to take back what counts."""
    if not 1 <= one.run <= runs:
        raise OmissionError(f"there is no run {one.run}, of {runs}")
    own = left_out(known).get(one.run)
    if own is not None and not one.back:
        raise OmissionError(f"run {one.run} is left out since {own.since} already")
    if own is None and one.back:
        raise OmissionError(f"run {one.run} is not left out")


def begun_now(run: int, reason: str, *, back: bool) -> Omission:
    """An omission, or its end, from now on."""
    return Omission(run, datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), reason, back)


def left_out(known: Sequence[Omission]) -> dict[int, Omission]:
    """The runs that are counted no more, by their numbers."""
    last = {one.run: one for one in known}
    return {number: one for number, one in last.items() if not one.back}


def words(known: Sequence[Omission], files: Sequence[Sequence[str]]) -> Iterator[str]:
    """What happened to each run, in sentences without their full stop.  files: of every run."""
    for number in sorted({one.run for one in known}):
        own = [one for one in known if one.run == number]
        name = f"run {number} ({', '.join(files[number - 1])})"
        out, last = own[-2 if own[-1].back else -1], own[-1]
        if last.back:
            yield (
                f"{name} counts again since {last.since}: {last.reason} "
                f"(it was left out at {out.since}: {out.reason})"
            )
        else:
            yield f"{name} is left out since {out.since}: {out.reason}"
