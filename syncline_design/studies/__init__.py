"""Trade studies: one spec or several, checked over grids and samples of their keys."""

from syncline_design.studies.finished import CaseResult
from syncline_design.studies.loading import Study, load_study
from syncline_design.studies.result import Progress, StudyResult
from syncline_design.studies.run import StudyError, StudySettings, StudyStoppedError, run_study

__all__ = [
    "CaseResult",
    "Progress",
    "Study",
    "StudyError",
    "StudyResult",
    "StudySettings",
    "StudyStoppedError",
    "load_study",
    "run_study",
]
