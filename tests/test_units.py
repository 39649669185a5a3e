"""Units against pint, pi against mpmath, figures against decimal arithmetic."""

from __future__ import annotations

import copy
import math
import pickle
import random
import time
from decimal import Decimal, getcontext
from fractions import Fraction

import mpmath
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import (
    CURRENCIES,
    EXAMPLES,
    PI,
    UNITS,
    Dimension,
    Quantity,
    UnitError,
    parse_number,
    parse_quantity,
    si_name,
    split_suffix,
    suffix_unit,
)

D = Dimension
REGISTRY = pint.UnitRegistry()
# Names that pint spells otherwise, or reads as something else.
PINT_NAMES = {
    "deg": "degree", "mdeg": "millidegree", "deg/s": "degree/second",
    "mdeg/s": "millidegree/second", "deg/min": "degree/minute", "deg/h": "degree/hour",
    "nmi": "nautical_mile", "kn": "knot", "%": "percent", "min": "minute", "h": "hour", "d": "day",
    "g": "gram", "mg": "milligram", "kg": "kilogram", "m/s2": "m/s**2", "m/s^2": "m/s**2",
    **{f"{angle}/{square}": f"{name}/s**2" for square in ("s2", "s^2") for angle, name in (
        ("rad", "radian"), ("mrad", "milliradian"), ("deg", "degree"), ("mdeg", "millidegree"))},
    "ppb": "1e-9*dimensionless", "degC": "delta_degC",
}  # fmt: skip
SI_UNITS = {
    D.LENGTH: "meter", D.TIME: "second", D.ANGLE: "radian", D.SPEED: "meter/second",
    D.ANGULAR_RATE: "radian/second", D.MASS: "kilogram", D.POWER: "watt",
    D.RATIO: "dimensionless", D.FREQUENCY: "hertz", D.ACCELERATION: "meter/second**2",
    D.ANGULAR_ACCELERATION: "radian/second**2", D.TEMPERATURE: "delta_degC",
}  # fmt: skip


@pytest.mark.parametrize("unit", sorted(set(UNITS) - set(CURRENCIES)))
def test_every_unit_agrees_with_pint(unit: str) -> None:
    dimension, factor = UNITS[unit]
    expression = PINT_NAMES.get(unit, unit)
    magnitude = REGISTRY.parse_expression(expression).to(SI_UNITS[dimension]).magnitude
    assert float(factor) == pytest.approx(magnitude, rel=1e-15)


@pytest.mark.parametrize("unit", sorted(set(UNITS) - set(CURRENCIES)))
def test_every_unit_has_the_dimension_that_pint_gives_it(unit: str) -> None:
    dimension, _ = UNITS[unit]
    quantity = REGISTRY.parse_expression(PINT_NAMES.get(unit, unit))
    assert quantity.dimensionality == REGISTRY.parse_expression(SI_UNITS[dimension]).dimensionality


def test_pi_has_at_least_50_digits() -> None:
    with mpmath.workdps(80):
        error = mpmath.mpf(PI.numerator) / PI.denominator - mpmath.pi
        assert abs(error) < mpmath.mpf(10) ** -59


def test_degrees_are_rounded_once_from_many_digits() -> None:
    rng = random.Random(20240501)
    with mpmath.workdps(60):
        for _ in range(200):
            text = f"{rng.uniform(-360, 360):.6f}"
            expected = float(mpmath.radians(mpmath.mpf(text)))
            assert float(parse_quantity(f"{text} deg", D.ANGLE)) == expected


@given(st.decimals(-(10**6), 10**6, allow_nan=False, allow_infinity=False, places=6))
def test_figures_are_exact(number: Decimal) -> None:
    """Fractions against 60-digit decimal arithmetic."""
    getcontext().prec = 60
    text = f"{number:f}"
    millimetres = parse_quantity(f"{text} mm", D.LENGTH)
    expected = number / Decimal(1000)
    assert millimetres.exact == Fraction(expected)
    assert float(millimetres) == float(expected)
    assert millimetres.exact * 10**6 == parse_quantity(f"{text} km", D.LENGTH).exact


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("10 ns", D.TIME, 1e-8),
        ("77.9 deg/s", D.ANGULAR_RATE, math.radians(77.9)),
        ("1.5 m", D.LENGTH, 1.5),
        ("12 us", D.TIME, 12e-6),
        ("12 \u00b5s", D.TIME, 12e-6),
        ("400 EUR", D.MONEY, 400.0),
        ("  1e3   mm ", D.LENGTH, 1.0),
        ("+.5 m", D.LENGTH, 0.5),
        ("5. m", D.LENGTH, 5.0),
        ("-6.92 us", D.TIME, -6.92e-6),
        ("0 s", D.TIME, 0.0),
        ("3 kn", D.SPEED, 1.5433333333333332),
        ("20 ppm", D.RATIO, 2e-5),
    ],
)
def test_reads(text: str, dimension: Dimension, value: float) -> None:
    quantity = parse_quantity(text, dimension)
    assert float(quantity) == pytest.approx(value, rel=3e-16, abs=0)
    assert quantity.low == quantity.high == quantity
    assert not quantity.has_tolerance
    assert quantity.text == text.strip()


@pytest.mark.parametrize(
    ("text", "low", "nominal", "high"),
    [
        ("1 cm +/- 20 %", "0.008", "0.01", "0.012"),
        ("1 cm +/- 20%", "0.008", "0.01", "0.012"),
        ("1 cm \u00b1 2 mm", "0.008", "0.01", "0.012"),
        ("1 cm +/- 2 mm", "0.008", "0.01", "0.012"),
        ("0.8 cm .. 1.2 cm", "0.008", "0.01", "0.012"),
        ("8 mm .. 1.2 cm", "0.008", "0.01", "0.012"),
        ("-1 m +/- 10 %", "-1.1", "-1", "-0.9"),
        ("1 m +/- 0 %", "1", "1", "1"),
    ],
)
def test_tolerances(text: str, low: str, nominal: str, high: str) -> None:
    quantity = parse_quantity(text, D.LENGTH)
    assert (quantity.low, quantity.high) == (float(low), float(high))
    assert quantity.exact == Fraction(nominal)
    assert quantity.has_tolerance is (low != high)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,5 mm", "decimal comma"),
        ("5 MM", "did you mean mm?"),
        ("5 Ms", "did you mean ms?"),
        ("5 meters", "did you mean m?"),
        ("5 mmm", "did you mean mm?"),
        ("5 5 mm", "two numbers"),
        ("10**10**8 m", "not a number"),
        ("5 deg", "wrong dimension"),
        ("5", "without a unit"),
        ("5mm", "no space"),
        ("5 mm mm", "unknown unit"),
        ("\u22125 m", "minus"),
        ("\u0665 m", "not a number"),
        ("0123 m", "leading zero"),
        ("1e400 m", "range of a float"),
        ("1e99999999 m", "range of a float"),
        ("1e-31 m", "magnitude"),
        ("1e31 m", "magnitude"),
        ("nan m", "finite"),
        ("inf m", "finite"),
        ("1_0 m", "not a number"),
        ("1 m +/- -1 mm", "negative tolerance"),
        ("2 m .. 1 m", "swapped"),
        ("1 m .. 2 s", "wrong dimension"),
        ("1 m +/- 2 s", "wrong dimension"),
        ("1 m +/- 2", "without a unit"),
        ("", "empty"),
        ("9" * 5000 + " m", "5000 characters"),
        ("m", "not a number"),
        ("m 5", "not a number"),
        ("1\n m", "not a number"),
    ],
)
def test_refuses(text: str, words: str) -> None:
    with pytest.raises(UnitError) as caught:
        parse_quantity(text, D.LENGTH)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 300


def test_wrong_dimension_names_both() -> None:
    with pytest.raises(UnitError) as caught:
        parse_quantity("5 s", D.LENGTH)
    assert "time" in str(caught.value)
    assert "length" in str(caught.value)


def test_a_tolerance_is_refused_where_none_is_taken() -> None:
    with pytest.raises(UnitError, match="tolerance"):
        parse_quantity("1 m +/- 5 %", D.LENGTH, tolerance=False)


@pytest.mark.parametrize("value", [True, False, None, 5, 0.5, [1], {"a": 1}])
def test_what_is_no_text_is_no_quantity(value: object) -> None:
    with pytest.raises(UnitError):
        parse_quantity(value, D.LENGTH)


def test_money_keeps_its_currency() -> None:
    assert parse_quantity("400 USD", D.MONEY).currency == "USD"
    assert parse_quantity("400 m", D.LENGTH).currency is None
    with pytest.raises(UnitError, match="two currencies"):
        parse_quantity("400 USD .. 500 EUR", D.MONEY)


def test_every_dimension_has_an_example_that_reads() -> None:
    for dimension in D:
        if dimension is not D.DIMENSIONLESS:
            assert parse_quantity(EXAMPLES[dimension], dimension) > 0


@given(st.from_regex(r"\A[-+]?(0|[1-9][0-9]{0,20})(\.[0-9]{0,20})?([eE][-+]?[0-9]{1,2})?\Z"))
def test_numbers_read_as_python_reads_them(text: str) -> None:
    assert float(parse_number(text)) == float(text)


@given(st.text(max_size=30))
def test_any_text_reads_or_raises_unit_error(text: str) -> None:
    for dimension in (D.LENGTH, D.MONEY, D.RATIO):
        try:
            quantity = parse_quantity(text, dimension)
        except UnitError:
            continue
        assert quantity.low <= quantity <= quantity.high


def test_a_quantity_is_a_read_only_float() -> None:
    quantity = parse_quantity("1 cm +/- 20 %", D.LENGTH)
    assert isinstance(quantity, float)
    assert quantity + 1.0 == 1.01
    assert f"{quantity:.3f}" == "0.010"
    with pytest.raises(AttributeError):
        quantity.text = "2 cm"  # type: ignore[misc]
    for twin in (
        copy.copy(quantity),
        copy.deepcopy(quantity),
        pickle.loads(pickle.dumps(quantity)),
    ):
        assert isinstance(twin, Quantity)
        assert (twin, twin.text, twin.exact) == (quantity, quantity.text, quantity.exact)
        assert (twin.low, twin.high) == (quantity.low, quantity.high)


@pytest.mark.parametrize(
    ("value", "dimension", "text"),
    [
        (0.0025, D.TIME, "2.5 ms"),
        (0.00099996, D.TIME, "1 ms"),
        (0.000999949, D.TIME, "999.9 us"),
        (12e-9, D.TIME, "12 ns"),
        (-0.0025, D.TIME, "-2.5 ms"),
        (0.0, D.TIME, "0 s"),
        (0.0, D.LENGTH, "0 m"),
        (0.0, D.ANGLE, "0 deg"),
        (0.0, D.RATIO, "0 ppm"),
        (1.4127, D.LENGTH, "1.413 m"),
        (12345.0, D.LENGTH, "12.35 km"),
        (0.0174532925199433, D.ANGLE, "1 deg"),
        (math.radians(77.9), D.ANGULAR_RATE, "77.9 deg/s"),
        (21.0, D.SPEED, "21 m/s"),
        (0.09, D.MASS, "90 g"),
        (40000.0, D.MONEY, "40 000 EUR"),
        (59862.35, D.MONEY, "59 862.35 EUR"),
        (-5.5, D.MONEY, "-5.50 EUR"),
        (1.5, D.DIMENSIONLESS, "1.5"),
        (float("inf"), D.TIME, "unlimited"),
        (float("nan"), D.TIME, "not a number"),
        (1e-15, D.TIME, "0.001 ps"),
    ],
)
def test_formats(value: float, dimension: Dimension, text: str) -> None:
    assert format_quantity(value, dimension) == text


def test_formats_with_a_currency_and_digits() -> None:
    assert format_quantity(400.0, D.MONEY, currency="USD") == "400 USD"
    assert format_quantity(1.41268, D.LENGTH, 6) == "1.41268 m"


@given(st.floats(1e-9, 1e6))
def test_what_is_formatted_reads_back_within_its_digits(value: float) -> None:
    for dimension in (D.LENGTH, D.TIME, D.ANGLE, D.SPEED, D.MASS, D.POWER, D.ACCELERATION):
        shown = format_quantity(value, dimension, 6)
        assert parse_quantity(shown, dimension) == pytest.approx(value, rel=5.1e-6)


@pytest.mark.parametrize(
    ("name", "factor", "dimension"),
    [
        ("time_s", 1.0, D.TIME),
        ("age_ms", 1e-3, D.TIME),
        ("range_m", 1.0, D.LENGTH),
        ("range_mm", 1e-3, D.LENGTH),
        ("range_cm", 1e-2, D.LENGTH),
        ("roll_deg", 0.017453292519943295, D.ANGLE),
        ("roll_rad", 1.0, D.ANGLE),
        ("velocity_north_mps", 1.0, D.SPEED),
        ("rate_x_degps", 0.017453292519943295, D.ANGULAR_RATE),
        ("rate_x_radps", 1.0, D.ANGULAR_RATE),
        ("gain", 1.0, D.DIMENSIONLESS),
        ("target_id", 1.0, D.DIMENSIONLESS),
        ("_s", 1.0, D.DIMENSIONLESS),
    ],
)
def test_suffixes(name: str, factor: float, dimension: Dimension) -> None:
    assert suffix_unit(name) == (factor, dimension)


def test_names_with_an_si_suffix() -> None:
    assert [si_name(n) for n in ("latency_ms", "bias_deg", "x_cm", "gain", "rate_degps")] == [
        "latency_s",
        "bias_rad",
        "x_m",
        "gain",
        "rate_radps",
    ]
    assert split_suffix("rate_x_degps") == ("rate_x", "_degps")


LONG = 100_000
FLOODS = (
    " " * LONG,
    "1" + " " * LONG + "m",
    "1 m" + " " * LONG + "..",
    "1 m" + " " * LONG + "x",
    "1 m" + "\t" * LONG + "+",
    ". " * LONG,
    " .. " * LONG,
    "1 m +/-" + " " * LONG,
    "1 m" + " " * LONG + "%",
    "+/-" * LONG,
    "1" * LONG,
    "1" * LONG + ".m",
    "1 " + "m" * LONG,
    "1:" * LONG,
)


@pytest.mark.parametrize("text", FLOODS, ids=lambda text: repr(text[:8]))
def test_a_flood_is_refused_at_once(text: str) -> None:
    """Time grows with the length, not with its square: the square would take half a minute."""
    start = time.process_time()
    with pytest.raises(UnitError) as caught:
        parse_quantity(text, D.LENGTH)
    assert time.process_time() - start < 0.5
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("1 m  ..  2 m", 1.0, 2.0),
        ("1 m\t..\t2 m", 1.0, 2.0),
        ("2 m   +/-   10 %", 1.8, 2.2),
        ("2 m+/-10%", 1.8, 2.2),
        ("2 m \u00b1 5 cm", 1.95, 2.05),
    ],
)
def test_spaces_about_a_tolerance_are_free(text: str, low: float, high: float) -> None:
    read = parse_quantity(text, D.LENGTH)
    assert (read.low, read.high) == (pytest.approx(low), pytest.approx(high))
