"""Which file tells of what: told by its content, and by what it was assigned to."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from syncline_design.clocks.reading import is_clock_log
from syncline_design.comparison.acceptance import EvidenceFile, ReadAs
from syncline_design.logs import delimited
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
        yield from (_record(path, "stamps") for path in self.stamps)
        yield from (_record(path, "log") for path in self.places)


def evidence_files(
    case: Case, logs: Sequence[Path], assigned: Mapping[str, tuple[Path, ...]]
) -> EvidenceFiles:
    """Sort the files of a call; BadInput where it cannot be told whose clock a log is of."""
    _demand_places(case, assigned)
    for name, paths in assigned.items():
        _demand_clocks(name, paths)
    clocks = dict(assigned)
    plain = tuple(path for path in logs if is_clock_log(path))
    if plain:
        owner = _only_vehicle(case, plain[0])
        clocks[owner] = (*clocks.get(owner, ()), *plain)
    kinds = {path: _kinds(path) for path in logs if path not in plain}
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
        raise BadInput((Flaw(str(case.path), 0, 0, "", f"--assign {wrong}: not in the spec",
                             expected, repr(wrong), ""),))  # fmt: skip


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


def _only_vehicle(case: Case, log: Path) -> str:
    """Whose clock an unassigned clock log tells of."""
    clocked = [name for name in _vehicles(case) if case.clocks(name)]
    known = clocked or _vehicles(case)
    if len(known) > 1:
        raise BadInput((Flaw(str(log), 0, 0, "", "a clock log, and the spec has several vehicles",
                             "--assign VEHICLE=LOG for each", ", ".join(known), ""),))  # fmt: skip
    return known[0]


def _record(path: Path, read_as: ReadAs, of: str = "") -> EvidenceFile:
    """With the file's SHA-256; of a folder none."""
    digest = ""
    if path.is_file():
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return EvidenceFile(str(path), read_as, of, digest)
