"""What fits work on, of a log of the hidden world."""

from __future__ import annotations

from pathlib import Path

from syncline_design.diagnosis.candidates import candidates, directed_parts
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import Data, data_of
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.world import WorldLog


def data_from(log: WorldLog, folder: Path) -> Data:
    """Scene and noise that its spec tells of, with nothing fitted."""
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    inputs = measured(load(spec), [log.to_csv(folder / "log.csv")])
    view = scene(inputs.system, inputs.log, inputs.known)
    return data_of(view, structure_of(view, directed_parts(view, candidates(view))))
