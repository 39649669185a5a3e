"""Trade studies: one spec or several, checked over grids and samples of their keys."""

from syncline_design.study.loading import Study, load_study
from syncline_design.study.progress import Progress
from syncline_design.study.result import CaseResult, StudyResult
from syncline_design.study.run import StudyError, StudySettings, StudyStoppedError, run_study

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
