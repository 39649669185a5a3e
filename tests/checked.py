"""The verdict of a spec file, as `check` reaches it."""

from __future__ import annotations

from pathlib import Path

from syncline_design.spec.load import load
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded


def check_file(path: Path, settings: CheckSettings | None = None) -> Verdict:
    """Load and check, with the settings of a bare `check` unless others are given."""
    return check_loaded(load(path), settings or CheckSettings())
