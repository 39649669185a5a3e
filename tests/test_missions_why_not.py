"""Why an entry is not in the payload of several missions: against specs that hold it, tried out."""

from __future__ import annotations

import copy
from collections import Counter
from pathlib import Path

import pytest
import yaml

from plain_enumeration import number
from syncline_design.report.on_choice import on_choice
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from syncline_design.verdict.optimization import OptimizeSettings
from syncline_design.verdict.optimize import optimize
from syncline_design.verdict.why_not import HeldBack, NotTaken
from test_missions_fixes import ROLES, _least, _spec


@pytest.mark.parametrize("seed", [13])
def test_each_entry_is_answered_as_trying_it_out_says(seed: int, tmp_path: Path) -> None:
    spec = _spec(seed)
    path = tmp_path / "spec.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    entries = {name: role for role, names in ROLES.items() for name in names}
    found = optimize(load(path), OptimizeSettings(why_not=tuple(entries)))
    budget = number(spec["requirements"][1]["limit"])
    seen: Counter[str] = Counter()
    for answer in found.result.why_not or ():
        with_it = copy.deepcopy(spec)
        with_it["stages"][0][entries[answer.entry]] = {"candidates": [answer.entry]}
        least = _least(with_it)
        if isinstance(answer, HeldBack):
            assert answer.best_with.cost == pytest.approx(least[None, "COST"], abs=0.005)
            assert least[None, "COST"] <= budget
            seen["held"] += 1
            continue
        assert isinstance(answer, NotTaken)
        if answer.code in ("cost", "accuracy"):
            assert isinstance(answer.figure, float)
            assert any(answer.figure == pytest.approx(v, rel=1e-9) for v in least.values())
            seen["missed"] += 1
        elif answer.code == "requirements":
            assert not least
            seen["together"] += 1
        else:
            seen[answer.code] += 1
    assert seen["held"] + seen["missed"] + seen["together"] >= 3
    assert "Why not" in console(on_choice(found))
