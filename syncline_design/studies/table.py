"""A study's result table: one row per case, the same columns for CSV, Parquet and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from syncline_design.machine.sentences import sentence_list
from syncline_design.model.unit_table import SI_UNITS
from syncline_design.studies.definition import Factor, figure_of
from syncline_design.studies.finished import CaseResult, Finished
from syncline_design.studies.record import CaseRecord
from syncline_design.verdict.obstacle import obstacle_sentence, remedies_sentence

FIGURES = (
    "cost", "mass_kg", "power_w", "error_m", "sensor_error_m", "sync_error_m", "tau_s",
    "tau_crit_s",
)  # fmt: skip
Value = str | int | float | None  # of a cell
Row = dict[str, Value]


def si_unit(factor: Factor) -> str | None:
    """The SI unit that all values of a factor share; None when they are no such figures."""
    figures = [figure_of(value) for value in factor.values]
    kinds = {figure[1] if figure is not None else "" for figure in figures}
    if len(kinds) != 1 or "" in kinds:
        return None
    kind = kinds.pop()
    return next((unit for d, unit in SI_UNITS.items() if d.value == kind), kind)


def columns(result: Finished) -> list[str]:
    """The columns of the table: case, factors, verdict, figures, payload, reasons."""
    names = ["case", "base"]
    for factor in result.study.factors:
        unit = si_unit(factor)
        names += [factor.key] if unit is None else [factor.key, f"{factor.key} [{unit}]"]
    names += ["verdict", *FIGURES, "currency"]
    for role in _roles(result):
        names += [role, f"{role} timestamping"]
    return [*names, "failing", "waived", "not_simulated", "reason"]


def text_columns(result: Finished) -> set[str]:
    """Columns that hold text; the others hold figures."""
    numeric = {f"{f.key} [{si_unit(f)}]" for f in result.study.factors}
    return {c for c in columns(result) if c not in FIGURES and c not in numeric} - {"case"}


def _roles(result: Finished) -> list[str]:
    roles: dict[str, None] = {}
    for base in result.study.bases:
        for index, stage in enumerate(base.document.data["stages"]):
            named = ("position", "attitude", "ranging")
            for role in named:
                if role in stage and not (index and role == "position"):
                    roles[f"{stage['name']}.{role}"] = None
    return list(roles)


def rows(result: Finished) -> Iterator[Row]:
    """A row per case, in the order of the study."""
    units = {factor.key: si_unit(factor) for factor in result.study.factors}
    for case in result.cases():
        yield row(case, units)


def row(case: CaseResult, units: Mapping[str, str | None]) -> Row:
    """One case as a row; what it lacks is None."""
    found: Row = {"case": case.number, "base": case.file, "verdict": case.verdict}
    labels, record = case.labels, case.record
    for key, value in case.settings:
        found[key] = labels[key]
        figure = figure_of(value) if units[key] is not None else None
        if figure is not None:
            found[f"{key} [{units[key]}]"] = figure[0]
    found |= zip(FIGURES, _figures(record), strict=True)
    found["currency"] = case.currency if record.cost is not None else None
    for pick in record.picks:
        found[pick.role] = pick.sensor
        found[f"{pick.role} timestamping"] = pick.timestamping
    found["failing"] = " ".join(record.failing)
    found["waived"] = " ".join(record.excused)
    found["not_simulated"] = " ".join(record.not_simulated)
    found["reason"] = reason(case)
    return found


def _figures(record: CaseRecord) -> tuple[float | None, ...]:
    design, syncline = record.design, record.syncline
    sums = (None,) * 3 if design is None else (design.cost, design.mass, design.power)
    if syncline is None:
        return (*sums, None, None, None, None, None)
    return (
        *sums, syncline.total_m, syncline.sensor_error_m, syncline.sync_error_m, syncline.tau_s,
        syncline.tau_crit_s,
    )  # fmt: skip


def reason(case: CaseResult) -> str:
    """Why a case has no design, and what would give it one; empty where it has."""
    record = case.record
    if record.reason:
        return record.reason
    if record.problems:
        return "; ".join(f"{problem.path}: {problem.message}" for problem in record.problems)
    why = record.infeasibility
    if why is None:
        return _undecided(record) if record.verdict == "indeterminate" else ""
    return " ".join(filter(None, (obstacle_sentence(why), remedies_sentence(why))))


def _undecided(record: CaseRecord) -> str:
    """Why there is no verdict, where nothing went wrong."""
    if record.provisional:
        return "its time limit was over before the choice was proven"
    ids = [row.id for row in record.requirements if row.status == "indeterminate"]
    return f"{sentence_list(ids)} undecided" if ids else ""
