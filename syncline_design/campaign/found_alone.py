"""What the search of each log alone found and no joint search looks for.

What is common to logs is looked for along slopes of the error, once gross faults are undone; how a
sensor scatters, or what happened at one moment, is a log's own and found by that log's search.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from syncline_design.campaign.kept import NamedAlone
from syncline_design.campaign.pool import Pool
from syncline_design.campaign.store import Entry
from syncline_design.diagnosis.result import Finding, PerLog
from syncline_design.effects import registry

MOST_TOLD = 3  # logs whose own words a sentence has


def found_alone(entries: Sequence[Entry], pool: Pool, stages: Sequence[str]) -> Iterator[Finding]:
    """A finding for each effect at each place, with the logs that it explains alone."""
    looked = {(*term.label[:2], stages[term.label[2]]) for term in (*pool.terms, *pool.untold)}
    groups: dict[tuple[str, str, str], list[tuple[Entry, NamedAlone]]] = {}
    for entry in entries:
        for one in entry.run.named if entry.run.verdict == "explained" else ():
            place = one.effect, one.sensor, one.stage
            if not one.undone and place not in looked:
                groups.setdefault(place, []).append((entry, one))
    for (name, sensor, stage), own in groups.items():
        yield Finding(
            name, sensor, stage, {}, (), (), (), _sentence(own),
            "found by the search of each log alone", 0.0, None, *_about(name),
            scope="log", per_log=_in_logs(own),
        )  # fmt: skip


def undone_in_logs(entries: Sequence[Entry]) -> Iterator[Finding]:
    """Gross faults that were undone in logs, each with the logs that have it."""
    groups: dict[tuple[str, str, str, str], list[tuple[Entry, NamedAlone]]] = {}
    for entry in entries:
        for one in entry.run.named:
            if one.undone:
                key = one.effect, one.sensor, one.stage, one.words
                groups.setdefault(key, []).append((entry, one))
    for (name, sensor, stage, words), own in groups.items():
        every = len(own) == len(entries)
        files = ", ".join(entry.run.files[0] for entry, _ in own)
        said = f"undone in {'every log' if every else files} before anything was fitted"
        logs = None if every else _in_logs(own)
        yield Finding(
            name, sensor, stage, dict(own[0][1].parameters or {}), (), (), (), words, said, 0.0,
            None, *_about(name), scope="build" if every else "log", per_log=logs,
        )  # fmt: skip


def _about(name: str) -> tuple[str, str, str]:
    """What an effect is confused with, what separates them, and its source."""
    effect = registry().get(name)
    if effect is None:
        return "", "", ""
    return effect.confused_with, effect.separated_by, effect.source


def _in_logs(own: Sequence[tuple[Entry, NamedAlone]]) -> tuple[PerLog, ...]:
    return tuple(PerLog(entry.number, entry.run.files[0], entry.start, {}) for entry, _ in own)


def _sentence(own: Sequence[tuple[Entry, NamedAlone]]) -> str:
    told = [f"In {entry.run.files[0]}: {one.words.rstrip('.')}" for entry, one in own[:MOST_TOLD]]
    more = len(own) - len(told)
    return "; ".join([*told, *([f"and so in {more} further logs"] if more else [])])
