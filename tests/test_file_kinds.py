"""A file of another kind is called what it is, and who takes it is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from study_specs import SPEC, STUDY, write
from syncline_design.spec.load import BadInput, load
from syncline_design.studies.loading import load_study

CATALOG = "sensors:\n  own: {modality: position}\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [(STUDY, "expected a spec (`syncline: 1` at its top), found a study (`study`); "
             "`syncline-design study` takes it"),
     (CATALOG, "found a catalog (`sensors`); `syncline-design catalog check` takes it")],
    ids=["study", "catalog"],
)  # fmt: skip
def test_what_is_no_spec_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as refused:
        load(path)
    [line] = str(refused.value).splitlines()
    assert line.startswith(f"{path}:1:1: another kind of file; ")
    assert said in line


@pytest.mark.parametrize("text", [SPEC, CATALOG], ids=["spec", "catalog"])
def test_what_is_no_study_is_named(tmp_path: Path, text: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(BadInput) as refused:
        load_study(path)
    assert "expected a study (`study: 1` at its top), found a" in str(refused.value)


@pytest.mark.parametrize(
    "text", [SPEC.replace("syncline:", "sincline:"), SPEC.replace("syncline: 1\n", "")]
)
def test_a_spec_without_its_first_line_is_told_key_by_key(tmp_path: Path, text: str) -> None:
    path = tmp_path / "spec.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as refused:
        load(path)
    assert "another kind" not in str(refused.value)
    assert "syncline: missing key" in str(refused.value)
