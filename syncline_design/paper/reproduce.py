"""`reproduce`: every printed figure of the paper, computed anew from the built-in catalog.

A tau_crit cell agrees when the exact value lies within one unit of its last printed digit (the
paper sometimes cuts and sometimes rounds).  One that does not must be a documented erratum and
come out at the documented value; anything else makes the reproduction fail.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Annotated, Any, Final, Literal

from syncline_design import __version__
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName
from syncline_design.model import syncline
from syncline_design.model.budget import budget
from syncline_design.model.quantity import Dimension, Quantity, parse_quantity
from syncline_design.paper.errata import COMES_OUT_AT, ERRATA, Erratum, Key
from syncline_design.paper.plots import (
    FIGURE_1_SENSOR_ERROR_M,
    SURVEY_PAYLOAD,
    PlottedFigure,
    compare,
    platform_of,
    plots,
    plotted,
    sigma_axes,
    survey_system,
)
from syncline_design.paper.printed import PRINTED
from syncline_design.spec.catalog import Catalog
from syncline_design.spec.load import load_builtin

SCHEMA: Final = "syncline-design/reproduction/v1"
TAU_CRIT_TABLES = ("tau_crit_georeferencing", "tau_crit_survey")

Agreement = Literal["agrees", "erratum", "differs"]


@dataclass(frozen=True, slots=True)
class PrintedCell(Record):
    """One printed figure and the same computed, both in `unit`."""

    table: str
    row: str
    column: str
    printed: float
    printed_text: str
    computed: float
    unit: str
    status: Agreement
    note: str


@dataclass(frozen=True, slots=True)
class FigureCount(Record):
    """How many figures are printed, agree, are documented errata, differ."""

    printed: int
    agrees: int
    erratum: int
    differs: int


@dataclass(frozen=True, slots=True)
class CellCounts(Record):
    """The cells of the tau_crit tables, the figures in the text, the platforms and sensors."""

    tau_crit: FigureCount
    text: FigureCount
    inputs: FigureCount


@dataclass(frozen=True, slots=True)
class Reproduction(Record):
    """What came out, schema `syncline-design/reproduction/v1`.

    ok: whether every printed figure agrees or is a documented erratum; cells: the paper's results;
    inputs: its platform and sensor figures against the catalog.
    """

    schema: Annotated[str, SchemaName(SCHEMA)]
    version: str
    seed: int
    ok: bool
    counts: CellCounts
    cells: tuple[PrintedCell, ...]
    inputs: tuple[PrintedCell, ...]
    errata: tuple[Erratum, ...]
    figures: tuple[PlottedFigure, ...]


def reproduce(catalog: Catalog | None = None, simulate: bool = True, *, seed: int) -> Reproduction:
    """Compute every printed figure from a catalog, the built-in one unless another is given.

    simulate: whether to add the simulated points of figures 3 and 7 (takes a second or two).
    seed: of the starting points of their search; nothing else here is random.
    """
    in_force().doing("computing what the paper prints")
    catalog = load_builtin(families=False) if catalog is None else catalog
    cells = tuple(
        _cell((table, row, column), printed, _computed_si(catalog, table, row, column))
        for table in (*TAU_CRIT_TABLES, "text")
        for row, column, printed in _entries(table)
    )
    inputs = tuple(
        _cell((table, row, column), printed, _catalog_si(catalog, table, row, column), exact=True)
        for table in ("platforms", "sensors")
        for row, column, printed in _entries(table)
    )
    in_force().doing("simulating points of the figures")
    return Reproduction(
        schema=SCHEMA,
        version=__version__,
        seed=seed,
        ok=all(cell.status != "differs" for cell in (*cells, *inputs)),
        counts=_counts(cells, inputs),
        cells=cells,
        inputs=inputs,
        errata=ERRATA,
        figures=tuple(
            plotted(one, compare(one, seed=seed) if simulate else ()) for one in plots(catalog)
        ),
    )


def _entries(table: str) -> Iterator[tuple[str, str, str]]:
    for row, columns in PRINTED[table].items():
        for column, printed in columns.items():
            yield row, column, printed


def _computed_si(catalog: Catalog, table: str, row: str, column: str) -> float:
    """A result of the paper in SI: a sensor's tau_crit, a system's, or a roof."""
    if table in TAU_CRIT_TABLES:
        return _sensor_tau_crit_s(catalog, row, column)
    if row == "survey_tau_crit":
        return budget(survey_system(catalog, column, SURVEY_PAYLOAD)).tau_crit_s
    if row == "survey_roof":
        return budget(survey_system(catalog, "large_sv", SURVEY_PAYLOAD)).sensor_error_m
    p = platform_of(catalog, column)
    rate = syncline.sync_rate_mps(p.v_max_mps, p.omega_max_radps, p.distance_m)
    return syncline.accuracy_per_m(syncline.syncline_m(0.0, FIGURE_1_SENSOR_ERROR_M, rate))


def _sensor_tau_crit_s(catalog: Catalog, sensor: str, platform: str) -> float:
    entry, p = catalog.sensors[sensor], platform_of(catalog, platform)
    role = entry.modality
    error = syncline.sensor_error_m(role, sigma_axes(entry), p.distance_m)
    rate = syncline.sensor_rate_mps(role, p.v_max_mps, p.omega_max_radps, p.distance_m)
    return syncline.tau_crit_s(error, rate)


def _catalog_si(catalog: Catalog, table: str, row: str, column: str) -> Quantity:
    """A figure of the catalog that the paper prints as an input."""
    if table == "platforms":
        value: Any = getattr(catalog.platforms[row], column)
        return _quantity(value)
    entry = catalog.sensors[row]
    field, axis = {
        "position": ("sigma_position", 0),
        "roll": ("sigma_attitude", 0),
        "pitch": ("sigma_attitude", 1),
        "yaw": ("sigma_attitude", 2),
        "range": ("sigma_range", 0),
        "azimuth": ("sigma_bearing", 0),
        "elevation": ("sigma_bearing", 1),
    }[column]
    value = getattr(entry, field)
    return _quantity(value[axis] if isinstance(value, tuple) else value)


def _quantity(value: Any) -> Quantity:
    if not isinstance(value, Quantity):
        raise TypeError(f"expected a figure with a unit, found {value!r}")
    return value


_DIMENSIONS = {
    "m": Dimension.LENGTH, "cm": Dimension.LENGTH, "mm": Dimension.LENGTH,
    "us": Dimension.TIME, "ms": Dimension.TIME, "deg": Dimension.ANGLE,
    "m/s": Dimension.SPEED, "deg/s": Dimension.ANGULAR_RATE,
}  # fmt: skip


def _unit_si(unit: str) -> Fraction:
    """One display unit in SI, exactly; 1/m (figure 1's axis) is SI itself."""
    if unit == "1/m":
        return Fraction(1)
    return parse_quantity(f"1 {unit}", _DIMENSIONS[unit]).exact


def _last_digit(number: str) -> Fraction:
    """One unit of the last digit: `16` -> 1, `4.330` -> 1/1000."""
    return Fraction(1, 10 ** len(number.partition(".")[2]))


def _cell(key: Key, text: str, computed_si: float, *, exact: bool = False) -> PrintedCell:
    """Compare a printed figure with the computed one: within one unit of the last digit.

    exact: an input, which has to be the printed figure itself.
    """
    number, unit = text.split(" ")
    computed = (
        computed_si.exact if isinstance(computed_si, Quantity) else Fraction(computed_si)
    ) / _unit_si(unit)
    distance = abs(computed - Fraction(number))
    agrees = distance == 0 if exact else distance < _last_digit(number)
    status, note = _agreement(key) if agrees else _explain(key, computed)
    return PrintedCell(*key, float(number), text, float(computed), unit, status, note)


def _agreement(key: Key) -> tuple[Agreement, str]:
    """A figure that agrees, with what it was computed with where that is not the printed row."""
    table, row, column = key
    uses_auv = table in TAU_CRIT_TABLES and column == "auv"
    corrected = uses_auv or row == "survey_tau_crit"
    return "agrees", "with the corrected AUV row" if corrected else ""


def _explain(key: Key, computed: Fraction) -> tuple[Agreement, str]:
    """A figure that does not agree: an erratum if it is documented and comes out as documented."""
    for erratum in ERRATA:
        if key not in erratum.cells:
            continue
        documented = COMES_OUT_AT[key]
        if abs(computed - Fraction(documented)) <= _last_digit(documented) / 2:
            return "erratum", f"{erratum.id}: {erratum.reason}"
        return "differs", f"documented as {documented} (erratum {erratum.id})"
    return "differs", "neither agrees nor is a documented erratum"


def tau_crit_cells(cells: Iterable[PrintedCell]) -> tuple[PrintedCell, ...]:
    """The cells of the paper's two tau_crit tables."""
    return tuple(cell for cell in cells if cell.table in TAU_CRIT_TABLES)


def _counts(cells: Iterable[PrintedCell], inputs: Iterable[PrintedCell]) -> CellCounts:
    text = [cell for cell in cells if cell.table == "text"]
    return CellCounts(_count(tau_crit_cells(cells)), _count(text), _count(inputs))


def _count(cells: Iterable[PrintedCell]) -> FigureCount:
    found = Counter(cell.status for cell in cells)
    return FigureCount(found.total(), found["agrees"], found["erratum"], found["differs"])
