"""The strict YAML reader: scalars of YAML 1.2, positions, both parsers alike, what is refused."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncline_design.spec import yaml_text as yaml_reader
from syncline_design.spec.edit import flow_text, yaml_text
from syncline_design.spec.yaml_text import Number, parse, plain_scalar, read, show_path

ROOT = Path(__file__).parent.parent
SHIPPED = sorted([*ROOT.glob("specs/*.yaml"), *ROOT.glob("catalogs/*.yaml")])
CORPUS = sorted((Path(__file__).parent / "corpus").rglob("*/*.yaml"))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1), ("-7", -7), ("+7", 7), ("0", 0), ("1e-3", 0.001), ("1.5", 1.5), (".5", 0.5),
        ("5.", 5.0), ("-1.5E+2", -150.0), ("true", True), ("False", False), ("null", None),
        ("~", None), ("", None), ("NO", "NO"), ("yes", "yes"), ("on", "on"), ("1:20", "1:20"),
        ("0123", "0123"), ("0x1F", "0x1F"), ("0o17", "0o17"), ("1,5", "1,5"), (".inf", ".inf"),
        (".nan", ".nan"), ("1e400", "1e400"), ("1e-400", "1e-400"), ("1_000", "1_000"),
        ("2027-01-31", "2027-01-31"), ("1.2.3", "1.2.3"), ("-", "-"), (".", "."), ("e5", "e5"),
        ("12345678901234567890", 12345678901234567890.0), ("\u0661", "\u0661"), ("0e0", 0.0),
    ],
)  # fmt: skip
def test_plain_scalars(text: str, value: object) -> None:
    found = plain_scalar(text)
    assert found == value
    assert isinstance(found, bool) == isinstance(value, bool)
    assert isinstance(found, str) == isinstance(value, str)


def test_quoted_scalars_stay_text() -> None:
    assert parse("a: '1'\nb: \"true\"\nc: '~'\n").data == {"a": "1", "b": "true", "c": "~"}


def test_decimals_keep_their_digits() -> None:
    number = parse("a: 0.10\n").data["a"]
    assert isinstance(number, Number)
    assert (number, number.text) == (0.1, "0.10")


def test_positions_are_those_an_editor_shows() -> None:
    text = "a:\n  - {b: 1, cc: [x,  y]}\n  - d: \u00f8 \U0001f600 'q'\n    e: |\n      z\nf: 1\n"
    document = parse(text)
    lines = text.split("\n")
    for path, needle in (
        (("a", 0, "b"), "1"),
        (("a", 0, "cc", 1), "y]"),
        (("a", 1, "d"), "\u00f8"),
        (("a", 1, "e"), "|"),
        (("f",), "1"),
    ):
        line, column = document.positions[path]
        assert lines[line - 1][column - 1 :].startswith(needle), path
    assert document.key_positions["a", 1, "e"] == (4, 5)
    assert document.position(("a", 0, "nothing", 7)) == document.positions["a", 0]


def test_lists_and_mappings_are_plain_and_frozen() -> None:
    data = parse("a: [1, {b: [2]}]\n").data
    assert data == {"a": (1, {"b": (2,)})}


def test_all_refusals_of_a_file_are_named() -> None:
    document = parse("a: &x 1\nb: *x\nb: 2\n1: 3\nc: !!str 4\nd: {<<: {e: 1}}\n", "f.yaml")
    assert [(p.line, p.column) for p in document.problems] == [
        (1, 4), (2, 4), (3, 1), (4, 1), (5, 4), (6, 5),
    ]  # fmt: skip
    assert all(str(p).startswith(f"f.yaml:{p.line}:{p.column}: ") for p in document.problems)


def test_line_ends_and_byte_order_mark_change_nothing() -> None:
    plain = parse("a: 1\nb:\n  - 2\n")
    for text in ("\ufeffa: 1\nb:\n  - 2\n", "a: 1\r\nb:\r\n  - 2\r\n", "a: 1\rb:\r  - 2\r"):
        other = parse(text)
        assert (other.data, other.sha256, other.positions) == (
            plain.data,
            plain.sha256,
            plain.positions,
        )
    assert parse("a: 1\nb:\n  - 3\n").sha256 != plain.sha256


@pytest.mark.parametrize("path", SHIPPED + CORPUS, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_both_parsers_read_alike(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """libyaml and the pure Python parser give the same data, places and refusals."""
    fast = read(path)
    monkeypatch.setattr(yaml_reader, "_CParser", None)
    slow = read(path)
    assert bool(fast.problems) == bool(slow.problems)
    if path.name != "lone_surrogate_escape.yaml":  # an error of syntax to libyaml only
        assert (fast.data is None) == (slow.data is None)
    if fast.data is not None:
        assert repr(fast.data) == repr(slow.data)
        assert fast.positions == slow.positions
        assert fast.key_positions == slow.key_positions
        assert fast.problems == slow.problems


def test_500_lines_read_quickly() -> None:
    """Five hundred lines; generous, so that a slow machine does not fail it."""
    text = "".join(f"key{i}: {{a: {i} mm, b: [1, 2, 3], c: text}}\n" for i in range(500))
    start = time.perf_counter()
    assert len(parse(text).data) == 500
    assert time.perf_counter() - start < 1.0


def test_pathological_input_ends_quickly() -> None:
    for text in (
        "? " * 50_000, "- " * 50_000, "a: " * 50_000, "!" * 100_000, "'" * 100_001, "&" * 100_000,
        "{a: " * 50_000, "|\n" * 50_000, "%" * 100_000, "[a, " * 20_000, "\\" * 100_000,
    ):  # fmt: skip
        start = time.perf_counter()
        assert parse(text).problems or isinstance(parse(text).data, str)
        assert time.perf_counter() - start < 4.0


@given(st.text(max_size=200))
def test_any_text_ends_as_data_or_problems(text: str) -> None:
    document = parse(text)
    assert document.problems or document.data is not None


@given(st.binary(max_size=100))
def test_any_bytes_end_as_data_or_problems(tmp_path_factory: object, content: bytes) -> None:
    path = Path(str(tmp_path_factory.getbasetemp())) / "bytes.yaml"  # type: ignore[attr-defined]
    path.write_bytes(content)
    document = read(path)
    assert document.problems or document.data is not None


WORDS = st.text(
    st.characters(codec="utf-8", exclude_characters="\0\ufffe\uffff"), max_size=20
).filter(
    lambda s: not any(c in s for c in "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
)
SCALARS = (
    WORDS
    | st.integers(-(10**12), 10**12)
    | st.booleans()
    | st.floats(-1e15, 1e15, allow_subnormal=False).map(lambda x: x if abs(x) > 1e-200 else 0.0)
    | st.sampled_from(["1e-3", "0123", "NO", "~", "true", "5 mm", "- a", "a: b", "# c", "{", "<<"])
)
KEYS = WORDS.filter(lambda s: s not in ("", "<<"))


@given(
    st.dictionaries(
        KEYS,
        st.recursive(
            SCALARS,
            lambda inner: (
                st.lists(inner, max_size=3).map(tuple) | st.dictionaries(KEYS, inner, max_size=3)
            ),
            max_leaves=8,
        ),
        min_size=1,
        max_size=4,
    )
)
def test_what_is_written_reads_back_the_same(data: dict[str, object]) -> None:
    """The writer's block and flow styles, against the reader."""
    for text in (yaml_text(data), flow_text(data)):
        document = parse(text)
        assert not document.problems, text
        assert document.data == data, text


def test_paths_are_shown_as_people_write_them() -> None:
    assert show_path(("stages", 0, "position", "sensor")) == "stages[0].position.sensor"
    assert show_path(()) == ""
    assert "\n" not in show_path(("a\nb", "c"))


@pytest.mark.parametrize(
    ("character", "escapable"), [("\x07", True), ("\0", False), ("\u202e", False)]
)
def test_a_hint_to_escape_is_given_only_where_the_escape_is_read(
    character: str, escapable: bool
) -> None:
    (raw,) = parse(f"name: 'a{character}b'\n", "x.yaml").problems
    escaped = parse(f'name: "a\\u{ord(character):04x}b"\n', "x.yaml").problems
    assert ("escape it" in raw.hint) == escapable == (not escaped)
