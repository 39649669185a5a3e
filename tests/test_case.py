"""A case is looked up once: in its catalogs, and in no other way again."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from syncline_design.choice.variations import (
    quantity,
    sigma_figures,
    with_figure,
    with_platform_figure,
)
from syncline_design.comparison.meaning import meaning
from syncline_design.model.quantity import Dimension
from syncline_design.spec import edit, yaml_text
from syncline_design.spec import load as load_module
from syncline_design.spec.catalog import SECTIONS, Catalog
from syncline_design.spec.load import load
from syncline_design.spec.spec import EffectChoice
from syncline_design.spec.yaml_text import ParsedFile
from syncline_design.verdict.pinned import as_measured
from syncline_design.verdict.verify import CheckSettings, check_loaded

ROOT = Path(__file__).parents[1]
UAV = ROOT / "specs" / "uav_corridor.yaml"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Whoever reads a section of a catalog, by the file that does."""
    found: Counter[str] = Counter()
    plain = Catalog.__getattribute__

    def noted(self: Catalog, name: str) -> Any:
        if name in SECTIONS:
            found[Path(sys._getframe(1).f_code.co_filename).name] += 1
        return plain(self, name)

    monkeypatch.setattr(Catalog, "__getattribute__", noted)
    return found


def test_one_check_asks_the_catalogs_only_while_the_case_is_made(asked: Counter[str]) -> None:
    case = load(UAV)
    roles = sum(len(stage.roles) for stage in case.stages)
    del asked["files.py"]  # the entries as they are drawn together
    # A platform and its clocks a stage, methods and sensors a role, and the shared hardware.
    assert asked == {"case.py": 2 * roles + len(case.stages) + 1}
    asked.clear()
    check_loaded(case, CheckSettings())
    # but for the recheck: what it adds up is the entries' own, not what the choice made of them
    assert set(asked) == {"recheck.py"}


@pytest.mark.parametrize("name", ["infeasible_example", "rov_relay"])
def test_no_verdict_asks_for_what_the_spec_names_again(name: str, asked: Counter[str]) -> None:
    """Remedies look further: at methods that the spec does not name, and at other cases.

    So does what asks whether a figure is meant: at all platforms there are.  The recheck looks by
    itself.
    """
    case = load(ROOT / "specs" / f"{name}.yaml")
    asked.clear()
    check_loaded(case, CheckSettings(monte_carlo=False))
    assert set(asked) <= {"case.py", "fixes.py", "plausibility.py", "recheck.py"}


def test_what_a_diagnosis_means_is_found_without_reading_anything_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The measured system and the spec with the findings are cases made from the first one."""
    parsed: Counter[str] = Counter()

    def counted(text: str, file: str = "<text>") -> ParsedFile:
        parsed[file] += 1
        return plain(text, file)

    plain = yaml_text.parse
    for module in (yaml_text, load_module, edit):
        monkeypatch.setattr(module, "parse", counted)
    case = load(UAV)
    assert len(case.stages[0].role("position").sensors) > 1  # type: ignore[union-attr]
    measured = as_measured(case, seed=0)
    assert len(measured.stages[0].role("position").sensors) == 1  # type: ignore[union-attr]
    entry = EffectChoice(
        effect="latency", sensor="position", stage="uav", parameters={"latency_s": 1e-5}
    )
    found = meaning(case, [entry], seed=0)
    assert found is not None
    assert found.after.design is not None
    assert parsed == dict.fromkeys(parsed, 1)
    assert str(UAV) in parsed


def test_a_what_if_is_looked_up_anew() -> None:
    case = load(UAV)
    nearer = with_platform_figure(case, 0, "distance", quantity(31.0, Dimension.LENGTH))
    assert nearer.stages[0].platform.entry.distance == 31.0
    assert case.stages[0].platform.entry.distance != 31.0
    figure = next(sigma_figures(case))
    doubled = with_figure(case, figure, quantity(2 * float(figure.quantity), figure.dimension))
    entries = [role.sensor(figure.sensor) for role in doubled.stages[0].roles]
    assert doubled.catalog.sensors[figure.sensor] in entries
    assert doubled.catalog.sensors[figure.sensor] != case.catalog.sensors[figure.sensor]


def test_every_candidate_says_where_it_is_defined() -> None:
    case = load(UAV)
    for stage in case.stages:
        assert case.origins["platforms", stage.platform.id] == stage.platform.origin
        for role in stage.roles:
            for one in role.sensors:
                file, line, column = one.origin.rsplit(":", 2)
                assert file.startswith("builtin:sensors")
                assert one.origin == case.origins["sensors", one.id]
                assert int(line) > 1
                assert int(column) > 1
