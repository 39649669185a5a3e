"""Which file tells of what: told by its content, and by what it was assigned to."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from syncline_design.auditing.run import files_of
from syncline_design.clocks.reading import is_clock_log, read_logs
from syncline_design.comparison.acceptance import EvidenceFile, ReadAs
from syncline_design.logs import delimited
from syncline_design.logs.given_once import demand_once
from syncline_design.logs.readers import reader_of
from syncline_design.logs.readers.csv_names import RECEIVE, time_columns
from syncline_design.logs.readers.reader import head_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw


@dataclass(frozen=True, slots=True)
class EvidenceFiles:
    """clocks: clock logs by the vehicle or STAGE/ROLE that they tell of; stamps: files whose
    messages carry two times; places: measured logs for a diagnosis (a recording can be both)."""

    clocks: Mapping[str, tuple[Path, ...]]
    stamps: tuple[Path, ...]
    places: tuple[Path, ...]

    @property
    def records(self) -> Iterator[EvidenceFile]:
        """Every file as it is written, once for each way in which it was read."""
        for name, paths in self.clocks.items():
            yield from (_record(path, "clock", name) for path in paths)
        yield from (_record(one, "stamps") for path in self.stamps for one in files_of(path))
        yield from (_record(one, "log") for path in self.places for one in files_of(path))


def evidence_files(
    case: Case, logs: Sequence[Path], assigned: Mapping[str, tuple[Path, ...]]
) -> EvidenceFiles:
    """Sort the files of a call; BadInput where it cannot be told whose clock a log is of."""
    _demand_places(case, assigned)
    for name, paths in assigned.items():
        _demand_clocks(name, paths)
        _demand_other_logs(name, paths, logs)
    clocks = dict(assigned)
    plain = tuple(path for path in logs if is_clock_log(path))
    if plain:
        owner = _only_vehicle(case, plain[0])
        clocks[owner] = (*clocks.get(owner, ()), *plain)
    others = [path for path in logs if path not in plain]
    demand_once(others)
    kinds = {path: _kinds(path) for path in others}
    return EvidenceFiles(
        clocks,
        tuple(path for path, found in kinds.items() if "stamps" in found),
        tuple(path for path, found in kinds.items() if "log" in found),
    )


def _kinds(path: Path) -> tuple[ReadAs, ...]:
    """A table with a column of receipts holds stamps alone; a recording may hold places too."""
    reader = reader_of(head_of(path))
    if reader is None:
        return ("log",)
    if not reader.format.startswith("CSV"):
        return ("stamps", "log")
    return ("stamps",) if time_columns(delimited.dialect(path).names, RECEIVE) else ("log",)


def _vehicles(case: Case) -> list[str]:
    return list(dict.fromkeys(stage.choice.vehicle_name for stage in case.stages))


def _demand_places(case: Case, assigned: Mapping[str, Sequence[Path]]) -> None:
    sensors = [f"{s.choice.name}/{role.role}" for s in case.stages for role in s.roles]
    known = [*_vehicles(case), *sensors]
    wrong = next((name for name in assigned if name not in known), None)
    if wrong is not None:
        expected = "a vehicle or STAGE/ROLE: " + ", ".join(known)
        near = get_close_matches(wrong, known, 1)
        hint = f"--assign {near[0]}={assigned[wrong][0]}" if near else ""
        raise BadInput((Flaw(str(case.path), 0, 0, "", f"--assign {wrong}: not in the spec",
                             expected, repr(wrong), hint),))  # fmt: skip


def _demand_clocks(name: str, paths: Sequence[Path]) -> None:
    """Refuse tables of stamps: they are not assigned, but told by their names."""
    for path in paths:
        if not path.is_file() or is_clock_log(path) or "stamps" not in _kinds(path):
            continue
        table, role = f"{name.replace('/', '_')}.csv", name.split("/")[-1]
        hint = (f"give it without --assign: it is told by its file's name ({table}), or by the "
                f"spec's `log: {{streams: {{{role}: {path.stem}}}}}`")  # fmt: skip
        raise BadInput((Flaw(str(path), 0, 0, "", f"--assign {name}: messages with two times, no "
                             "clock log", "a log of a clock", path.name, hint),))  # fmt: skip


def _demand_other_logs(name: str, paths: Sequence[Path], logs: Sequence[Path]) -> None:
    """Refuse a log that is given a second time without its owner."""
    given = {path.absolute() for path in paths}
    for path in logs:
        if path.absolute() in given:
            raise BadInput((Flaw(str(path), 0, 0, "", f"given with --assign {name} and without",
                                 "each log once", path.name, f"--assign {name}={path} alone"),)
                           )  # fmt: skip


def _only_vehicle(case: Case, log: Path) -> str:
    """Whose clock an unassigned clock log tells of."""
    clocked = [name for name in _vehicles(case) if case.clocks(name)]
    known = clocked or _vehicles(case)
    if len(known) > 1:
        raise BadInput((Flaw(str(log), 0, 0, "", "a clock log, and the spec has several vehicles",
                             "--assign VEHICLE=LOG for each", ", ".join(known),
                             f"say whose it is: --assign {known[0]}={log}"),))  # fmt: skip
    return known[0]


def demand_own_clocks(case: Case, clocks: Mapping[str, Sequence[Path]]) -> None:
    """Refuse logs of one clock that are given for several vehicles: each has a clock of its own,
    and no two clocks are off by the same from row to row.

    The logs of each are known to be readable, and to hold each session once.
    """
    aboard = {s.choice.name: s.choice.vehicle_name for s in case.stages}
    of = {name: aboard.get(name.partition("/")[0], name) for name in clocks}
    if len(set(of.values())) < 2:
        return
    by_vehicle: dict[str, dict[Path, None]] = {}
    for name, paths in clocks.items():
        by_vehicle.setdefault(of[name], {}).update(dict.fromkeys(paths))
    try:
        read_logs([path for paths in by_vehicle.values() for path in paths])
    except BadInput as error:
        flaw = error.problems[0]
        raise BadInput((Flaw(flaw.file, flaw.line, flaw.column, "", f"one clock's log for several "
                             f"vehicles ({', '.join(by_vehicle)}): {flaw.message}",
                             "a log of each vehicle's own clock", flaw.found,
                             "where one clock serves them, say so in the spec: the same `vehicle` "
                             "in their stages"),)) from None  # fmt: skip


def _record(path: Path, read_as: ReadAs, of: str = "") -> EvidenceFile:
    """With the file's SHA-256; "" of one that cannot be read."""
    digest = ""
    if path.is_file():
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return EvidenceFile(str(path), read_as, of, digest)
