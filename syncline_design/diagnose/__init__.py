"""Find where simulation and measurement disagree, and name what is missing."""

from __future__ import annotations

from syncline_design.diagnose.result import Diagnosis
from syncline_design.diagnose.run import diagnose
from syncline_design.diagnose.settings import DiagnosisSettings
from syncline_design.diagnose.summary import summary_text

__all__ = ["Diagnosis", "DiagnosisSettings", "diagnose", "summary_text"]
