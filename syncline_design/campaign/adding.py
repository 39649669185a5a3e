"""A log to what is kept of it: searched alone, its statistics taken."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from syncline_design import __version__
from syncline_design.campaign.kept import NamedAlone, Run, date_of, statistics_of
from syncline_design.diagnosis.consequence import SpecPromise
from syncline_design.diagnosis.one_of_several import rivals_words
from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.run import weigh
from syncline_design.diagnosis.searched import SearchedLog, examined
from syncline_design.diagnosis.settings import DiagnosisSettings, SearchProgress, silent
from syncline_design.diagnosis.sufficient import sufficient
from syncline_design.diagnosis.system import measured
from syncline_design.effects import registry
from syncline_design.machine.input_files import content_of
from syncline_design.machine.sentences import or_rivals
from syncline_design.spec.case import Case


def run_of(
    case: Case,
    paths: Sequence[Path],
    settings: DiagnosisSettings,
    promise: SpecPromise | None = None,
    progress: SearchProgress = silent,
) -> Run:
    """What is kept of one run, read from one file or several."""
    digest = content_hash(paths)
    inputs = measured(case, list(paths))
    return kept(examined(inputs, settings, progress), digest, promise)


def content_hash(paths: Sequence[Path]) -> str:
    """SHA-256 of what the files of a run hold, whatever their names and order."""
    files = [f for path in paths for f in _plain(path)]
    own = sorted(content_of(path) for path in files)
    return own[0] if len(own) == 1 else hashlib.sha256("".join(own).encode()).hexdigest()


def _plain(path: Path) -> list[Path]:
    """The files of a log; of a folder (a recording split by size), all in it."""
    return sorted(f for f in path.rglob("*") if f.is_file()) if path.is_dir() else [path]


def kept(one: SearchedLog, digest: str, promise: SpecPromise | None) -> Run:
    """What is kept of a searched log."""
    data, model = one.data, one.result.model
    weighed = weigh(one, promise)
    log = data.view.log
    white = zip(data.structure.white, model.level.factor, strict=True)
    first_s = log.since_s + float(log.time_s[0])
    return Run(
        files=one.inputs.files,
        sha256=digest,
        kind=log.kind,
        first_s=first_s,
        date=date_of(first_s),
        duration_s=log.duration_s,
        rows=one.inputs.log.rows_read,
        used=len(one.inputs.log),
        rejected=dict(one.inputs.log.rejected),
        verdict=weighed.verdict,
        left_m=weighed.remaining.size_m or 0.0,
        left_material=weighed.remaining.material or not weighed.sound,
        spec_m=weighed.remaining.spec_m or 0.0,
        white_factor={"/".join(w.sensor): float(f) for w, f in white},
        named=tuple(_named(f) for f in weighed.findings),
        version=__version__,
        checks=tuple(c for c in weighed.checks if c.severity == "contradiction"),
        **statistics_of(sufficient(data, model, one.search.states)),  # type: ignore[arg-type]
    )


def _named(one: Finding) -> NamedAlone:
    effect = registry().get(one.effect)
    undone = effect is not None and effect.undoing is not None
    words = one.sentence + or_rivals([rivals] if (rivals := rivals_words(one)) else [])
    kept = one.parameters if undone else None
    return NamedAlone(one.effect, one.sensor, one.stage, words, undone, kept)
