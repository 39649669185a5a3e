"""Commands that judge and choose designs: check, optimize, study, diff."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from syncline_design.cli.completions import among, catalog_ids
from syncline_design.cli.shared import (
    CheckOutput,
    DiffOutput,
    OptimizeOutput,
    QuietOption,
    RoadOption,
    SeedOption,
    SpecArgument,
    StudyOutput,
    StudyTimeLimit,
    TimeLimitOption,
    deadline_of,
    emit,
    guarded,
    known_road,
    output_targets,
    pictured,
    refuse,
    watched,
)
from syncline_design.machine.streams import say
from syncline_design.report.formats import NEXT_TO_TEXT, PICTURED

if TYPE_CHECKING:
    from syncline_design.report.document import Document
    from syncline_design.report.write import OutputTarget
    from syncline_design.verdict.optimization import Optimized
    from syncline_design.verdict.tree import Checked, Refused, Verdict

Amount = Literal["cost", "mass", "power"]
Figure = Literal["worst_case", "thu", "tvu", "rmse", "quantile"]
ExplainOption = Annotated[
    list[str] | None,
    typer.Option("--explain", metavar="ID", help="Work a requirement out step by step."),
]
BaselineOption = Annotated[
    Path | None,
    typer.Option(metavar="PATH", help="An earlier JSON: only what got worse since then fails."),
]
SkipOthersOption = Annotated[
    bool, typer.Option("--skip-others", help="Pass over named files that are no specs too.")
]
BestOption = Annotated[int, typer.Option(min=1, help="How many designs that differ in a sensor.")]
EveryOption = Annotated[
    bool, typer.Option("--every", help="Of --best: rank every design, whatever differs.")
]
ParetoOption = Annotated[bool, typer.Option("--pareto", help="The exact Pareto front too.")]
ResourceOption = Annotated[
    Amount, typer.Option("--resource", help="What the front sets against error.")
]
AgainstOption = Annotated[
    Literal[Amount, Figure] | None,
    typer.Option(
        "--against",
        help="Draw the front over this: an amount against error, or cost (or --resource) "
        "against this figure of the error.",
    ),
]
WhyNotOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="ENTRY",
        help="Say why a catalog entry is not in it. Repeatable.",
        autocompletion=among(catalog_ids),
    ),
]
WriteDesignOption = Annotated[
    Path | None, typer.Option(metavar="PATH", help="Write the spec with the design pinned.")
]


@guarded
def check(
    spec: Annotated[list[Path], typer.Argument(help="Specs; of a folder, the specs in it.")],
    output: CheckOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    road: RoadOption = "auto",
    time_limit: TimeLimitOption = None,
    skip_others: SkipOthersOption = False,
    explain: ExplainOption = None,
    baseline: BaselineOption = None,
) -> int:
    """Validate a spec, choose what is open, verify, cross-check by Monte Carlo, say the verdict."""
    deadline = deadline_of(time_limit)
    from syncline_design.comparison.verdict_file import read_verdicts
    from syncline_design.report.checks import CHECK_FORMATS
    from syncline_design.report.several import skipped_text
    from syncline_design.spec.folders import spec_files
    from syncline_design.verdict.settings import CheckSettings
    from syncline_design.verdict.verify import check_files

    with watched(deadline, quiet=quiet):
        found = spec_files(spec, skip_others=skip_others)
    given = [] if baseline is None else [baseline]
    targets = output_targets(output, pictured(CHECK_FORMATS), [*found.files, *given])
    settings = CheckSettings(seed=seed, road=known_road(road), explain=tuple(explain or ()),
                             cloud=any(t.format in PICTURED for t in targets),
                             others=any(t.format not in NEXT_TO_TEXT for t in targets))  # fmt: skip
    with watched(deadline, targets, quiet=quiet):
        earlier = None if baseline is None else read_verdicts(baseline)
        verdicts = check_files(found.files, settings)
    if earlier is not None:
        verdicts = [_since(one, earlier, str(baseline)) for one in verdicts]
    _demand_known(verdicts, settings.explain)
    for verdict in _refused(verdicts):
        say(verdict.text)
    if found.skipped and not quiet:
        say(skipped_text(found.skipped))
    several = len(found.files) != 1 or any(path.is_dir() for path in spec)
    _emit_checks(verdicts, targets, several=several, quiet=quiet)
    return max((verdict.exit_code for verdict in verdicts), default=0)


def _refused(verdicts: Sequence[Checked]) -> list[Refused]:
    from syncline_design.verdict.tree import Refused

    return [verdict for verdict in verdicts if isinstance(verdict, Refused)]


def _emit_checks(
    verdicts: Sequence[Checked], targets: list[OutputTarget], *, several: bool, quiet: bool
) -> None:
    """The text and the files; where a spec was refused nothing but what goes to standard output."""
    from syncline_design.report.checks import render_checks
    from syncline_design.report.write import STDOUT, OutputError

    refused = _refused(verdicts)
    if refused:
        targets = [target for target in targets if target.path == STDOUT]
    text = _checks_text(verdicts, several=several)
    try:
        emit(text, targets, lambda name: render_checks(name, verdicts), quiet=quiet,
             charts=lambda: _pictures(verdicts))  # fmt: skip
    except OutputError as error:
        if len(refused) < len(verdicts):
            raise
        say(f"syncline-design: {error}")  # nothing was computed: that the specs are bad stands


def _checks_text(verdicts: Sequence[Checked], *, several: bool) -> str:
    """Verdict after verdict; of several specs a summary at the end."""
    from syncline_design.report.on_verdict import on_verdict
    from syncline_design.report.render_console import console
    from syncline_design.report.several import summary_line
    from syncline_design.verdict.tree import Verdict

    text = "\n".join(console(on_verdict(v)) for v in verdicts if isinstance(v, Verdict))
    if not several:
        return text
    summary = summary_line(verdicts)
    return f"{text}\n{summary}\n" if text else f"{summary}\n"


def _since(verdict: Checked, earlier: Sequence[Verdict], file: str) -> Checked:
    """The verdict against its baseline; what could not be read has none."""
    from syncline_design.verdict.baseline import against
    from syncline_design.verdict.tree import Verdict

    return against(verdict, earlier, file) if isinstance(verdict, Verdict) else verdict


def _pictures(verdicts: Sequence[Checked]) -> dict[str, Document]:
    """The documents of the specs; of several, the figures' names begin with the spec's."""
    from syncline_design.report.on_verdict import on_verdict
    from syncline_design.verdict.tree import Verdict

    found = [verdict for verdict in verdicts if isinstance(verdict, Verdict)]
    if len(verdicts) == 1:
        return {"": on_verdict(found[0])} if found else {}
    named: dict[str, Document] = {}
    for one in found:
        stem = Path(one.file).stem
        count = sum(name == stem or name.startswith(f"{stem}-") for name in named)
        named[f"{stem}-{count + 1}" if stem in named else stem] = on_verdict(one)
    return named


def _demand_known(verdicts: Sequence[Checked], ids: Sequence[str]) -> None:
    """Refuse to explain what no spec requires."""
    known = [row.id for found in verdicts for row in getattr(found, "requirements", ())]
    for one in ids:
        if known and one not in known:
            listed = ", ".join(dict.fromkeys(known))
            refuse(f"syncline-design: --explain {one}: no such requirement; there are {listed}")


@guarded
def optimize(
    spec: SpecArgument,
    output: OptimizeOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    road: RoadOption = "auto",
    time_limit: TimeLimitOption = None,
    best: BestOption = 1,
    every: EveryOption = False,
    pareto: ParetoOption = False,
    resource: ResourceOption = "cost",
    against: AgainstOption = None,
    why_not: WhyNotOption = None,
    write_design: WriteDesignOption = None,
) -> int:
    """Find the best design, proven: optimum, exact front, runners-up, prices, what it hinges on."""
    deadline = deadline_of(time_limit)
    from syncline_design.report.on_choice import on_choice
    from syncline_design.report.optimizations import (
        OPTIMIZE_FORMATS,
        on_optimized,
        render_optimize,
    )
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load
    from syncline_design.verdict.admitted import NoSuchEntry
    from syncline_design.verdict.optimization import OptimizeSettings
    from syncline_design.verdict.optimize import optimize

    targets = output_targets(output, pictured(OPTIMIZE_FORMATS), [spec], [write_design])
    drawn, figure = _axes(resource, against)
    settings = OptimizeSettings(
        best, pareto, drawn, figure, known_road(road), seed=seed,
        every=every, why_not=tuple(dict.fromkeys(why_not or ())),
        report=any(target.format in PICTURED for target in targets),
    )  # fmt: skip
    with watched(deadline, targets, quiet=quiet):
        case = load(spec)
        if write_design is not None:
            _refuse_elsewhere(write_design, case.spec.catalogs)
        try:
            found = optimize(case, settings)
        except NoSuchEntry as error:
            refuse(f"syncline-design: --why-not {error}")
    if write_design is not None and found.result.exit_code == 0:
        _write_design(found, write_design)
    emit(console(on_choice(found)), targets, lambda n: render_optimize(n, found), quiet=quiet,
         charts=lambda: {"": on_optimized(found)})  # fmt: skip
    return found.result.exit_code


def _axes(resource: Amount, against: Amount | Figure | None) -> tuple[Amount, Figure | None]:
    """The resource of a front and the figure of the error that it is drawn over, if any."""
    if against is None:
        return resource, None
    if against == "cost" or against == "mass" or against == "power":
        return against, None
    return resource, against


def _refuse_elsewhere(path: Path, catalogs: Sequence[str]) -> None:
    """A design lies where its catalogs are found from."""
    for name in catalogs:
        if not (path.parent / name).exists():
            refuse(
                f"syncline-design: --write-design {path}: the spec draws in {name}, which "
                "is not in that folder; write the design beside the spec"
            )


def _write_design(found: Optimized, path: Path) -> None:
    from syncline_design.spec.edit import write_spec
    from syncline_design.verdict.pinned import pinned_text

    text = found.text or pinned_text(found.case, found.problem, found.designs[0])
    write_spec(text, path)
    say(f"design written to {path}")


@guarded
def study(
    study_file: Annotated[
        Path, typer.Argument(metavar="STUDY", help="Study (YAML).", show_default=False)
    ],
    output: StudyOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    output_format: Annotated[
        str | None,
        typer.Option(
            "--format", metavar="FORMAT", help="Print this format (as --output) to standard output."
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Local worker processes.")] = 2,
    store: Annotated[
        Path | None, typer.Option(help="Folder of the case files; default: beside the study.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Run on this Dask scheduler.")
    ] = None,
    dask: Annotated[bool, typer.Option("--dask", help="Run on a local Dask cluster.")] = False,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Believe no case file that is there: compute all anew.")
    ] = False,
    time_limit: StudyTimeLimit = None,
) -> int:
    """Sweep specs over grids or samples of their keys; a stopped study resumes."""
    deadline = deadline_of(time_limit)
    from syncline_design.report.on_study import on_study
    from syncline_design.report.progress_line import ProgressLine
    from syncline_design.report.render_console import console, paragraph
    from syncline_design.report.studies import STUDY_FORMATS, render_study
    from syncline_design.report.study_words import stored_text
    from syncline_design.studies import StudySettings, run_study
    from syncline_design.studies.store import FOLDER

    wanted = [*(output or ()), *([f"{output_format}:-"] if output_format else ())]
    targets = output_targets(wanted, pictured(STUDY_FORMATS), [study_file])
    if store is not None and os.path.lexists(store) and not store.is_dir():
        refuse(
            f"syncline-design: --store {store}: is no folder; give a folder, or a name not taken"
        )
    _keep_cases([Path(t.path) for t in targets], store or study_file.parent / FOLDER)
    settings = StudySettings(seed, workers, store, scheduler, dask, fresh=fresh)
    with watched(deadline, targets, quiet=quiet, steps=False):
        result = run_study(study_file, settings, None if quiet else ProgressLine())
    text = "" if quiet else f"{console(on_study(result))}\n{paragraph(stored_text(result))}"
    emit(text, targets, lambda name: render_study(name, result), quiet=quiet,
         charts=lambda: {"": on_study(result)})  # fmt: skip
    return result.exit_code


def _keep_cases(outputs: list[Path], store: Path) -> None:
    """Refuse a result that would lie among the files of cases."""
    for path in outputs:
        inside = Path(os.path.realpath(path)).parent
        if inside.parent == Path(os.path.realpath(store)) and len(inside.name) == 2:
            refuse(f"syncline-design: {path}: lies among the files of cases; write it elsewhere")


@guarded
def diff(
    old: Annotated[Path, typer.Argument(help="Spec, or verdict written as JSON.")],
    new: Annotated[Path, typer.Argument(help="Spec, or verdict written as JSON.")],
    output: DiffOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Say in words what changed between two specs or verdicts; the exit code is the new one's."""
    deadline = deadline_of(time_limit)
    from syncline_design.comparison.diff import diff as compare
    from syncline_design.report.on_diff import DIFF_FORMATS, on_diff, render_diff
    from syncline_design.report.render_console import console
    from syncline_design.verdict.settings import CheckSettings

    targets = output_targets(output, DIFF_FORMATS, [old, new])
    with watched(deadline, targets, quiet=quiet):
        found = compare(old, new, CheckSettings(seed=seed))
    emit(console(on_diff(found)), targets, lambda name: render_diff(name, found), quiet=quiet)
    return found.exit_code
