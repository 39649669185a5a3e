"""What the Python functions are handed: refused by its name where the commands refuse it too."""

from __future__ import annotations

import pickle
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncline_design as sd

ROOT = Path(__file__).parent.parent
SPEC = ROOT / "specs" / "position_track.yaml"
PINNED = ROOT / "specs" / "usv_wire_missing.yaml"
LOG = ROOT / "examples" / "hidden_latency.csv"


@pytest.mark.parametrize("seed", [-1, 1.5, "7", None, True, float("nan")])
@pytest.mark.parametrize(
    "name",
    ["check", "optimize", "simulate", "diagnose", "diff", "study", "timing", "audit", "plan"],
)
def test_a_seed_is_a_whole_number(name: str, seed: Any) -> None:
    """They gave a verdict, with that seed in its provenance."""
    words = (SPEC, SPEC) if name == "diff" else (SPEC,)
    with pytest.raises(ValueError, match=r"^seed: expected a whole number of at least 0, found"):
        getattr(sd, name)(*words, seed=seed)


@pytest.mark.parametrize(
    ("name", "handed"),
    [
        ("check", {"method": "nope"}),
        ("check", {"road": "nope"}),
        ("check", {"today": "2030-01-31"}),
        ("check", {"today": datetime(2030, 1, 31)}),
        ("check", {"time_limit_s": float("nan")}),
        ("check", {"time_limit_s": -0.1}),
        ("check", {"time_limit_s": "3"}),
        ("optimize", {"best": 0}),
        ("optimize", {"best": 1.5}),
        ("optimize", {"resource": "gold"}),
        ("simulate", {"samples": 0}),
        ("simulate", {"samples": 10.5}),
        ("simulate", {"workers": 0}),
        ("diagnose", {"false_alarm_rate": 0.0}),
        ("diagnose", {"false_alarm_rate": 0.7}),
        ("diagnose", {"max_effects": -1}),
        ("diagnose", {"max_effects": 21}),
        ("diagnose", {"logs": [7]}),
        ("study", {"workers": 0}),
        ("study", {"path": "a\0b"}),
    ],
    ids=str,
)
def test_what_a_command_refuses_is_refused_by_its_name(name: str, handed: dict[str, Any]) -> None:
    words = () if "path" in handed else (PINNED,)
    with pytest.raises(ValueError, match=f"^{next(iter(handed))}: expected "):
        getattr(sd, name)(*words, **handed)


@pytest.mark.parametrize("spec", [None, 7, b"x.yaml", {"syncline": 1}, "a\0b"])
def test_a_spec_is_a_path_or_a_case(spec: Any) -> None:
    with pytest.raises(ValueError, match=r"^spec: expected a path, found"):
        sd.check(spec)


def test_one_log_needs_no_list() -> None:
    """Its name was taken letter by letter."""
    with pytest.raises(sd.BadInput, match=r"there_is_none\.csv: cannot read the log"):
        sd.diagnose(SPEC.parent.parent / "examples" / "hidden_latency.yaml", "there_is_none.csv")


def test_bad_input_travels_between_processes() -> None:
    """Unpickling it failed, which breaks a pool of processes."""
    with pytest.raises(sd.BadInput) as caught:
        sd.check("there_is_none.yaml")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.problems, str(again)) == (caught.value.problems, str(caught.value))


def test_whole_numbers_of_arrays_are_whole_numbers() -> None:
    """A notebook's `for seed in np.arange(3)`; what comes out is a plain number."""
    verdict = sd.check(PINNED, seed=np.int64(3), monte_carlo=False, time_limit_s=np.float32(60.0))
    assert type(verdict.provenance.seed) is int
    assert verdict == sd.check(PINNED, seed=3, monte_carlo=False)
