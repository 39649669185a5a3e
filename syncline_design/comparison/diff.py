"""What changed between two specs, or two verdict files: causes, payload, price, margins.

Causes are what the files say differently.  Where both are specs and several things differ, each
change is also put into the old spec alone and chosen anew, so that the report can say which of
them moves the payload and the price.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from syncline_design.comparison.diff_result import Cause, Compared, Diff, changes, diff_of
from syncline_design.comparison.limits import limit_texts
from syncline_design.comparison.verdict_file import read_verdict, text_of
from syncline_design.machine.deadline import NoVerdict, in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Json
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import SECTIONS
from syncline_design.spec.files import Collection
from syncline_design.spec.keys import PLATFORM_KEYS, label, put, without
from syncline_design.spec.load import BadInput, catalogs_of, load_document
from syncline_design.spec.spec import Requirement
from syncline_design.spec.yaml_text import KeyPath, ParsedFile, parse
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import RequirementResult, Verdict
from syncline_design.verdict.verify import check_loaded

MOST_TRIED = 8  # changes that are also tried one by one
_ABSENT = object()
_NAMED = {"stages": "name", "requirements": "id", "missions": "name"}
_SILENT_KEYS = {"note", "name", "source"}  # words about things, not things


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two files: its verdict, and the spec where it is one."""

    file: str
    verdict: Verdict
    case: Case | None = None
    document: ParsedFile | None = None
    catalogs: Collection | None = None


Found = Iterator[tuple[Cause, KeyPath | None]]  # with its place in the old spec, where it has one


def diff(old: str | Path, new: str | Path, settings: CheckSettings | None = None) -> Diff:
    """The difference of two specs or verdict files (schema syncline-design/diff/v1)."""
    chosen = settings or CheckSettings()
    before, after = read_side(Path(old), chosen), read_side(Path(new), chosen)
    in_force().check()  # what a verdict lacks for want of time is no difference
    causes = list(_causes(before, after))
    if before.case is not None and after.case is not None and 1 < len(causes) <= MOST_TRIED:
        causes = [(_tried(cause, path, before, after, chosen), path) for cause, path in causes]
    found = changes(before.verdict, after.verdict)
    sides = (
        Compared(before.file, found.verdict.old, before.verdict.provenance),
        Compared(after.file, found.verdict.new, after.verdict.provenance),
    )
    return diff_of(sides, tuple(cause for cause, _ in causes), found, after.verdict.exit_code)


def read_side(path: Path, settings: CheckSettings) -> Side:
    """A verdict file as it is; a spec is checked."""
    if path.suffix == ".json":
        return Side(str(path), read_verdict(path))
    document = parse(text_of(path), str(path))
    if document.data is None:
        raise BadInput(document.problems)
    catalogs = catalogs_of(document, path)
    case = load_document(document, path, catalogs)
    return Side(str(path), check_loaded(case, settings), case, document, catalogs)


def _causes(before: Side, after: Side) -> Found:
    if before.case is not None and after.case is not None:
        yield from _spec_causes(_expanded(before), _expanded(after), (), "")
        yield from _catalog_causes(before.case, after.case)
    else:
        yield from _verdict_causes(before.verdict, after.verdict)


def _expanded(side: Side) -> Any:
    """A spec's data with every platform written out, so that its figures can be compared."""
    assert side.document is not None
    assert side.case is not None
    stages = []
    for stage, chosen in zip(side.document.data["stages"], side.case.stages, strict=True):
        entry = chosen.platform.entry
        figures = {key: _figure(getattr(entry, key)) for key in PLATFORM_KEYS}
        stages.append({**stage, "platform": {"use": chosen.choice.platform.use or "", **figures}})
    return {**side.document.data, "stages": tuple(stages)}


def _platform_causes(old: Json, new: Json, path: KeyPath, shown: str) -> Found:
    if old["use"] != new["use"]:
        yield Cause(shown, old["use"] or "in place", new["use"] or "in place"), path
        return
    stage = shown.removesuffix(".platform")
    for key in PLATFORM_KEYS:
        if old[key] != new[key]:
            yield Cause(f"{stage}.{key}", old[key], new[key]), (*path, key)


def _spec_causes(old: Any, new: Any, path: KeyPath, shown: str) -> Found:
    """Every place at which two specs' data differ; stages and requirements by their names."""
    if _same(old, new):
        return
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        if path[:1] == ("stages",) and path[2:] == ("platform",):
            yield from _platform_causes(dict(old), dict(new), path, shown)
            return
        for key in dict.fromkeys((*old, *new)):
            if key in _SILENT_KEYS:
                continue
            below = f"{shown}.{key}" if shown else str(key)
            one, other = old.get(key, _ABSENT), new.get(key, _ABSENT)
            yield from _spec_causes(one, other, (*path, key), below)
        return
    section = str(path[-1]) if path else ""
    name = _NAMED.get(section)
    if name is not None and isinstance(old, tuple) and isinstance(new, tuple):
        yield from _named_causes(old, new, path, shown, name)
        return
    yield Cause(shown, _text(old), _text(new)), path


def _named_causes(
    old: tuple[Any, ...], new: tuple[Any, ...], path: KeyPath, shown: str, key: str
) -> Found:
    before = {str(item.get(key)): (i, item) for i, item in enumerate(old)}
    after = {str(item.get(key)): item for item in new}
    for identity in dict.fromkeys((*before, *after)):
        below = f"{shown}[{identity}]"
        if identity in before and identity in after:
            index, item = before[identity]
            yield from _spec_causes(item, after[identity], (*path, index), below)
        else:
            one = before[identity][1] if identity in before else _ABSENT
            yield Cause(below, _text(one), _text(after.get(identity, _ABSENT))), None


def _same(old: Any, new: Any) -> bool:
    return old is not _ABSENT and new is not _ABSENT and bool(old == new)


def _text(value: Any) -> str | None:
    return None if value is _ABSENT else label(value)


def _verdict_causes(old: Verdict, new: Verdict) -> Found:
    """What two verdicts say differently about what they were asked, and by what they were made."""
    ids = {row.id for row in old.requirements} & {row.id for row in new.requirements}
    before, after = _asked(old, ids), _asked(new, ids)
    if old.design is not None and new.design is not None:
        before, after = before | _worked_on(old), after | _worked_on(new)
    limits = {
        f"requirements[{one.id}].limit": (one, other)
        for one in old.requirements
        for other in new.requirements
        if one.id == other.id
    }
    found = [
        (_as_limits(cause, *limits[cause.key]) if cause.key in limits else cause, place)
        for cause, place in _spec_causes(before, after, (), "")
    ]
    found += _provenance_causes(old, new)
    hashes = [one.provenance.spec_sha256[:12] for one in (old, new)]
    if not found:  # whatever it is that the verdicts do not repeat
        found = list(_one_cause("spec (hash)", *hashes))
    yield from found


def _as_limits(cause: Cause, old: RequirementResult, new: RequirementResult) -> Cause:
    """A limit that changed, with its unit."""
    before, after = limit_texts(old, new)
    return replace(cause, old=before, new=after)


def _asked(verdict: Verdict, both: set[str]) -> Json:
    """What a verdict repeats of its inputs, as a spec would hold it.

    both: requirements of both sides; an implied one of one side alone comes of the outcome.
    """
    spec = verdict.spec
    keys = ("sync_model", "objective", "coverage_factor", "currency")
    return {
        **{key: getattr(spec, key) for key in keys},
        "horizon": verdict.horizon.to_json(),
        "stages": tuple(
            {**stage.platform.to_json(), "name": stage.name, "vehicle": stage.vehicle}
            for stage in spec.stages
        ),
        "open_roles": ", ".join(spec.open_roles) or "none",
        "requirements": tuple(
            _required(row) for row in verdict.requirements if row.id in both or not row.implied
        ),
        "files": {one.file: one.sha256[:12] for one in verdict.provenance.files},
    }


def _required(row: RequirementResult) -> Json:
    """A requirement without its outcome."""
    keys = ("id", "kind", "limit", "quantile", "axis", "waiver")
    return {key: value for key, value in row.to_json().items() if key in keys}


def _listed_effects(verdict: Verdict) -> Json:
    """Parameters of the known effects by `latency (boat.attitude)`."""
    found: dict[str, list[Json]] = {}
    for one in verdict.effects or ():
        name = f"{one.effect} ({one.stage}.{one.sensor})"
        found.setdefault(name, []).append(dict(one.parameters))
    return {name: one[0] if len(one) == 1 else tuple(one) for name, one in found.items()}


def _worked_on(verdict: Verdict) -> Json:
    """What only the verdict on a design tells of its inputs."""
    found = verdict.monte_carlo
    simulated = "none" if found is None else {"samples": found.samples}
    return {"effects": _listed_effects(verdict), "monte_carlo": simulated}


def _provenance_causes(old: Verdict, new: Verdict) -> Found:
    words = {"version": "version", "catalogs_sha256": "catalogs (hash)", "seed": "seed"}
    for key, word in words.items():
        yield from _one_cause(word, getattr(old.provenance, key), getattr(new.provenance, key))


def _one_cause(key: str, old: Any, new: Any) -> Found:
    if not _same(old, new):
        yield Cause(key, _text(old), _text(new)), None


def _catalog_causes(old: Case, new: Case) -> Found:
    """Catalog entries that both specs can see and that differ."""
    if old.catalogs_sha256 == new.catalogs_sha256:
        return
    for section in SECTIONS:
        before, after = getattr(old.catalog, section), getattr(new.catalog, section)
        for identity in before:
            if identity not in after:
                continue
            one, other = before[identity], after[identity]
            for key in type(one).model_fields:
                first, second = getattr(one, key), getattr(other, key)
                if first != second and key not in _SILENT_KEYS:
                    name = f"catalog.{section}[{identity}].{key}"
                    yield Cause(name, _figure(first), _figure(second)), None


def _figure(value: Any) -> str | None:
    """A catalog figure as it was written."""
    if value is None:
        return None
    if isinstance(value, tuple):
        return "[" + ", ".join(str(_figure(item)) for item in value) + "]"
    return str(getattr(value, "text", None) or value)


def _tried(
    cause: Cause, place: KeyPath | None, before: Side, after: Side, settings: CheckSettings
) -> Cause:
    """The cause with what it does alone; nothing where it cannot stand alone."""
    if place is None or before.case is None or after.document is None:
        return cause
    assert before.document is not None
    original = before.document.data
    whole = place[2:] == ("platform",)
    there = after.document.data if whole else _expanded(after)
    value = _value_there(there, place, original)
    if value is _ABSENT and cause.new is not None:
        return cause
    try:
        in_force().check()
        data = without(original, place) if value is _ABSENT else put(original, place, value)
        document = replace(before.document, data=data)
        path = before.case.path
        same = before.catalogs if place[0] != "catalogs" else None
        alone = load_document(document, path, same or catalogs_of(document, path))
    except (BadInput, NoVerdict):  # a change that needs the others; the whole stands without it
        return cause
    asked = any(
        r.kind == "monte_carlo" for one in (before.case, alone) for r in _requirements_of(one)
    )
    wanted = replace(settings, monte_carlo=settings.monte_carlo and asked)  # else for a picture
    start = before.verdict if asked else check_loaded(before.case, wanted)
    verdict = check_loaded(alone, wanted)
    if in_force().is_over:
        return cause
    return replace(cause, effect=changes(start, verdict))


def _requirements_of(case: Case) -> Iterator[Requirement]:
    """Every requirement of a spec, those of its missions included."""
    yield from case.spec.requirements
    for mission in case.missions:
        yield from mission.case.spec.requirements


def _value_there(new: Any, path: KeyPath, old: Any) -> Any:
    """The new value at a place of the old spec, list entries found again by their names."""
    for index, step in enumerate(path):
        if isinstance(step, int):
            key = _NAMED[str(path[index - 1])]
            identity = old[step].get(key)
            old = old[step]
            new = next((item for item in new if item.get(key) == identity), _ABSENT)
        else:
            old = old.get(step, {}) if isinstance(old, Mapping) else {}
            new = new.get(step, _ABSENT) if isinstance(new, Mapping) else _ABSENT
        if new is _ABSENT:
            return _ABSENT
    return new
