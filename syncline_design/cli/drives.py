"""The command about test drives: plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncline_design.cli.completions import effect_terms
from syncline_design.cli.shared import (
    PlanOutput,
    QuietOption,
    SeedOption,
    SpecArgument,
    TimeLimitOption,
    deadline_of,
    emit,
    guarded,
    output_targets,
    pictured,
    watched,
)
from syncline_design.report.formats import GEODETIC_FORMATS, PLAN_FORMATS

if TYPE_CHECKING:
    from syncline_design.diagnosis import Diagnosis
    from syncline_design.planning.wanted import PlanWanted
    from syncline_design.report.write import OutputTarget
    from syncline_design.spec.case import Case

MOST_BYTES = 64 << 20  # of a diagnosis; the longest logs leave less than a hundredth of that


@guarded
def plan(
    spec: SpecArgument,
    diagnosis: Annotated[
        Path | None,
        typer.Option(metavar="D.json", help="Tell apart what this diagnosis could not."),
    ] = None,
    separate: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="A B",
            help='"latency(position)" "lever_arm(position)"; "latency(position)=100 ms" where its '
            'size is known; several rivals in one text: "latency(position)" "B, C".',
        ),
    ] = None,
    reach: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            autocompletion=effect_terms,
            help='Standard uncertainties: "latency(position)=1 ms, lever_arm(position)=1 cm".',
        ),
    ] = None,
    minutes: Annotated[float, typer.Option(help="Time for the drive at most.")] = 10.0,
    flown: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="What a drive that was flown tells; of several, what all tell together.",
        ),
    ] = None,
    output: PlanOutput = None,
    seed: SeedOption = 0,
    quiet: QuietOption = False,
    time_limit: TimeLimitOption = None,
) -> int:
    """Plan the test drive that tells effects apart, leg by leg, within the platform's limits."""
    deadline = deadline_of(time_limit)
    from syncline_design.planning.fixed_targets import fixed_targets
    from syncline_design.planning.run import plan as plan_drive
    from syncline_design.planning.setup import PlanRequest
    from syncline_design.report.on_plan import on_plan
    from syncline_design.report.plans import render_plan
    from syncline_design.report.render_console import console
    from syncline_design.spec.load import load
    from syncline_design.verdict.pinned import as_measured

    asked = _asked(separate, reach)
    reads = [spec, *([diagnosis] if diagnosis is not None else []), *(flown or ())]
    targets = output_targets(output, pictured(PLAN_FORMATS), reads)
    with watched(deadline, targets, quiet=quiet):
        case = load(spec)
        _demand_origin(case, targets)
        found = None if diagnosis is None else _diagnosis(diagnosis)
        request = PlanRequest(asked, found, minutes, tuple(flown or ()), seed, fixed_targets(case))
        run = plan_drive(as_measured(case, seed), request)
    emit(console(on_plan(run)), targets, lambda name: render_plan(name, run), quiet=quiet,
         charts=lambda: {"": on_plan(run)})  # fmt: skip
    return run.result.exit_code


def _asked(separate: tuple[str, str] | None, reach: str | None) -> PlanWanted:
    from syncline_design.planning.wanted import PlanWanted, reach_of, separate_of

    pairs = () if separate is None else separate_of(*separate)
    return PlanWanted(() if reach is None else reach_of(reach), pairs)


def _diagnosis(path: Path) -> Diagnosis:
    """A diagnosis read back; BadInput where the file holds none."""
    from syncline_design.diagnosis.result import SCHEMA, Diagnosis
    from syncline_design.machine.input_files import UnsuitableError, read_plain
    from syncline_design.machine.records import NotThisResultError, read_as
    from syncline_design.planning.wanted import PlanError

    try:
        return read_as(Diagnosis, read_plain(path, MOST_BYTES))
    except NotThisResultError as error:
        first = str(error).splitlines()[0]
        raise PlanError(f"--diagnosis {path}: expected a diagnosis ({SCHEMA}), as `diagnose "
                        f"--output json:PATH` writes it; found {first}") from None  # fmt: skip
    except (OSError, UnsuitableError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PlanError(f"--diagnosis {path}: cannot read: {reason}") from None


def _demand_origin(case: Case, targets: Sequence[OutputTarget]) -> None:
    """Waypoints on the globe need to know where the local frame is."""
    from syncline_design.spec.load import BadInput
    from syncline_design.spec.yaml_text import Flaw

    wanted = sorted({t.format for t in targets if t.format in GEODETIC_FORMATS})
    if not wanted or (case.spec.log is not None and case.spec.log.origin is not None):
        return
    flaw = Flaw(
        str(case.path),
        *case.position(("log",)),
        "log.origin",
        f"missing, and {' and '.join(wanted)} hold places on the globe",
        "log: {origin: [47.3 deg, 8.55 deg, 460 m]}",
        hint="latitude, longitude and height of the drive's start on the WGS 84 ellipsoid",
    )
    raise BadInput((flaw,))
