"""Find where simulation and measurement disagree, and name what is missing."""

from __future__ import annotations

from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.run import diagnose
from syncline_design.diagnosis.settings import DiagnosisSettings

__all__ = ["Diagnosis", "DiagnosisSettings", "diagnose"]
