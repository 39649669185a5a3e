"""What logs showed as an entry of a catalog: YAML with its claim, and the values beside it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Final

from syncline_design.clocks.files import refused
from syncline_design.clocks.result import CatalogEntry, ClockEntryKind, Timing
from syncline_design.clocks.study import TimingStudy
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.result_files import write_files
from syncline_design.machine.streams import harmless
from syncline_design.model.figure_text import to_digits
from syncline_design.spec.files import read_values
from syncline_design.spec.load import load_builtin
from syncline_design.spec.timestamp_errors import read_error
from syncline_design.spec.yaml_text import parse

# as `catalog check` wants ids: specs name them for years
_ID: Final = re.compile(r"(?=.{1,80}\Z)[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_SECTIONS: Final[dict[ClockEntryKind, str]] = {"clock": "clocks", "timestamping": "timestamping"}
_KEYS: Final[dict[ClockEntryKind, str]] = {"clock": "offset", "timestamping": "error"}
_MOST_EVENTS: Final = 20
_MARK: Final = "# Measured by `syncline-design timing`"


@dataclass(frozen=True, slots=True)
class EntryFiles:
    """What is to be written: catalog and values."""

    catalog: Path
    values: Path

    @property
    def paths(self) -> tuple[Path, Path]:
        """Both."""
        return self.catalog, self.values


def entry_files(identity: str, catalog: Path | None) -> EntryFiles:
    """Where an entry goes; refused for an id that no catalog takes, or a file of somebody else."""
    if not _ID.fullmatch(identity):
        raise refused(Path(f"--as {identity[:40]}"), "not an id",
                      expected="lower case, such as maker_clock_2")  # fmt: skip
    known = load_builtin()
    if any(identity in getattr(known, section) for section in _SECTIONS.values()):
        raise refused(Path(f"--as {identity}"), "a built-in catalog has an entry of that id",
                      hint="take another id")  # fmt: skip
    path = catalog or Path(f"{identity}.yaml")
    if path.exists():
        try:
            head = path.read_bytes()[:4096].decode("utf-8", "replace") if path.is_file() else ""
        except OSError:
            head = ""
        if not head.startswith(_MARK) or f"\n  {identity}:\n" not in head:
            raise refused(
                path,
                "is there already and is not this entry",
                hint="write the entry elsewhere and name both files in the spec",
            )
    return EntryFiles(
        path,
        path.with_name(
            f"{path.stem}_{identity}_values.txt"
            if path.stem != identity
            else f"{identity}_values.txt"
        ),
    )


def with_entry(
    study: TimingStudy, identity: str, kind: ClockEntryKind, files: EntryFiles,
    currency: str = "EUR",
) -> Timing:  # fmt: skip
    """The result with its entry; nothing is written yet."""
    text = entry_text(study.timing, identity, kind, files.values.name, currency)
    text = _sealed(text, identity, kind, values_text(study, kind))
    entry = CatalogEntry(identity, kind, str(files.catalog), str(files.values), text)
    return replace(study.timing, entry=entry)


def write_entry(study: TimingStudy, timing: Timing, files: EntryFiles) -> None:
    """Catalog and values, both or none."""
    assert timing.entry is not None
    values = values_text(study, timing.entry.kind)
    write_files([(files.values, values.encode()), (files.catalog, timing.entry.text.encode())])


def values_text(study: TimingStudy, kind: ClockEntryKind) -> str:
    """Quantiles of the error, one a line; of a method mu = -offset (valid at stamp + mu)."""
    of = study.timing.source
    name = harmless(of.name, one_line=True)
    meaning = "host minus UTC" if of.of_host else f"{name} minus its reference"
    if kind == "timestamping":
        meaning = "mu: data were valid at their stamp plus mu"
    lines = [f"# {meaning}, quantiles of the time in lock, each session with the same weight", "s"]
    lines += [f"{value:.9g}" for value in values_of(study, kind)]
    return "\n".join(lines) + "\n"


def values_of(study: TimingStudy, kind: ClockEntryKind) -> list[float]:
    """Quantiles of the error [s]: clock minus reference of a clock, mu of a method."""
    sign = 1.0 if kind == "clock" else -1.0
    return sorted((sign * study.offsets_s).tolist())


def entry_text(
    timing: Timing, identity: str, kind: ClockEntryKind, values_file: str, currency: str
) -> str:  # fmt: skip
    """One catalog file with one entry."""
    claim, key = timing.claim, _KEYS[kind]
    lines = [
        f"{_MARK} {timing.version}.",
        f"{_SECTIONS[kind]}:",
        f"  {identity}:",
        f"    name: {_quoted(f'{identity}, measured')}",
    ]
    if kind == "timestamping":
        lines += [f"    primitives: [{_primitive(timing)}]", "    timeline: host"]
    lines += [
        f"    {key}:",
        "      distribution: empirical",
        f"      file: {_quoted(values_file)}",
        f"      bound: {_time(timing.bound_s or 0.0)}",
        *_event_bound(timing),
        "      claim:",
        *(f"        {name}: {value}" for name, value in _claim(timing)),
        "      evidence:",
        *(f"        - {{file: {_quoted(one.file)}, sha256: {one.sha256}}}"
          for one in timing.evidence),
        f"      conditions: {_quoted(timing.conditions or 'as in the logs, not stated')}",
        "      events:",
        *_events(timing),
    ]  # fmt: skip
    if lines[-1] == "      events:":
        lines[-1] = "      events: []"
    lines += [
        f"    cost: 0 {currency}",
        "    mass: 0 g",
        "    power: 0 W",
        "    basis: {cost: assumption, mass: assumption, power: assumption}",
        f"    source: {_quoted(_source(timing))}",
        "    note: " + _quoted("what disciplines this clock is taken as there already: fill in "
                               "cost, mass and power"),
    ]  # fmt: skip
    assert claim.made
    return "\n".join(lines) + "\n"


def _sealed(text: str, identity: str, kind: ClockEntryKind, values: str) -> str:
    """The entry with the digest of its figures, as loading will read them."""
    data = parse(text).data[_SECTIONS[kind]][identity][_KEYS[kind]]
    read = read_error({**data, "values": tuple(read_values(values, "values"))})
    before = "      conditions: "
    return text.replace(before, f"      digest: {read.figures_sha256}\n{before}", 1)


def _quoted(text: str) -> str:
    """A double-quoted scalar; what a catalog may not hold is written as an escape."""
    return json.dumps(harmless(text, one_line=True), ensure_ascii=False)


def _time(value_s: float) -> str:
    """A bound, rounded up in its sixth figure: what is written may not be less."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if value_s >= scale or unit == "ns":
            break
    digits = f"{value_s / scale:.6g}"
    if float(digits) * scale < value_s * (1.0 - 1e-12):  # 5 * 1e-6 is no less than 5e-6
        digits = f"{value_s / scale * (1.0 + 1e-5):.6g}"
    return f"{digits} {unit}" if "e" not in digits else f"{float(digits):.12f} {unit}"


def _claim(timing: Timing) -> list[tuple[str, str]]:
    claim = timing.claim
    found = [
        ("coverage", f"{claim.coverage:g}"),
        ("session_share", f"{claim.session_share:g}"),
        ("confidence", f"{claim.confidence:g}"),
        ("sessions", str(claim.sessions)),
        ("hours", f"{claim.hours:.6g}"),
        ("rests_on", claim.rests_on),
    ]
    if claim.session_s is not None:
        found.append(("session_length", f"{claim.session_s:.6g} s"))
    if timing.declared:
        terms = ", ".join(f"{_quoted(k)}: {_time(v)}" for k, v in timing.declared.items())
        found.append(("declared", f"{{{terms}}}"))
    if timing.reservations:
        words = ", ".join(_quoted(one) for one in timing.reservations)
        found.append(("reservations", f"[{words}]"))
    return found


def _event_bound(timing: Timing) -> list[str]:
    """Where it is more than the bound."""
    most = timing.event_bound_s or 0.0
    return [f"      event_bound: {_time(most)}"] if most > (timing.bound_s or 0.0) else []


def _events(timing: Timing) -> list[str]:
    """One line a kind: how often, and the largest."""
    lines = []
    for kind in dict.fromkeys(event.kind for event in timing.events):
        sizes = [event.size_s for event in timing.events if event.kind == kind]
        lines.append(f"        - {{kind: {kind}, count: {len(sizes)}, "
                     f"largest: {_time(max(sizes))}}}")  # fmt: skip
    return lines[:_MOST_EVENTS]


def _primitive(timing: Timing) -> str:
    name = timing.source.name
    if "ptp4l" in name or name.startswith(("phc2sys", "ts2phc")):
        return "network"
    return "pps" if name.startswith(("gpsd PPS", "ppstest", "chrony refclock")) else "arrival"


def _source(timing: Timing) -> str:
    claim = timing.claim
    return (f"measured: {timing.source.name}, {claim.sessions} sessions, "
            f"{to_digits(claim.hours, 3)} h")  # fmt: skip
