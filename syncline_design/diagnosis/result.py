"""What a diagnosis says: typed, and written as JSON (schema syncline-design/diagnosis/v1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Final, Literal

from typing_extensions import TypeAliasType

from syncline_design.diagnosis.gap_result import Gap, Regime, Remaining, WholeGap
from syncline_design.diagnosis.one_of_several import note_of
from syncline_design.diagnosis.plotted import Plots
from syncline_design.effects import registry
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.spec.effects_listed import EffectChoice

SCHEMA: Final = "syncline-design/diagnosis/v1"
LogOutcome = Literal["agrees", "explained", "unexplained"]
Told = TypeAliasType("Told", "bool | float | str | list[Told] | dict[str, Told] | None")  # as JSON
RULED_OUT: Final = 0.01  # probability of an alias that is not held open
Kind = Literal["cause", "noise", "stand_in"]
Severity = Literal["contradiction", "caution"]
Scope = Literal["build", "start", "log"]
EXIT_CODES: Final[Mapping[LogOutcome, int]] = {"agrees": 0, "explained": 1, "unexplained": 1}
NOT_SHOWN: Final = 3
LOUD_SHARE = 0.7  # of the loudest reading's deviation: a reading that is loud as well
MEANT = 1.1  # deviations over the spec's up to which a reading is as the spec says


@dataclass(frozen=True, slots=True)
class Check(Record):
    """One thing that is wrong with a log before anything is named.

    code: speed, turn_rate, range, velocity_columns, rate_columns or frozen_readings.  value,
    limit: a quantile against the platform's figure (SI), the factor between columns and its 1, or
    the age of a reading that is repeated and 0; share: of rows beyond the limit.
    """

    code: str
    stage: str
    severity: Severity
    message: str
    value: float
    limit: float
    unit: str
    share: float


@dataclass(frozen=True, slots=True)
class Estimate(Record):
    """One parameter: its value and standard uncertainty in SI; a convention is a word.

    standard_uncertainty: None where nothing bounds it, as where the log says nothing of it.
    seen: whether the log does; a lever arm has no seen down part in a planar log.
    text: as every output prints it.
    interval95: the interval to rely on, also in noise that is not the model's.
    """

    value: float | str
    standard_uncertainty: float | None
    unit: str
    seen: bool
    text: str
    interval95: tuple[float, float] | None = optional()


@dataclass(frozen=True, slots=True)
class Rival(Record):
    """Another effect beside the named one; nats_worse counts the freedom of both.

    possible: whether it fits with values that the effect can have.  refitted: with noise fitted
    anew, as the evidence is; otherwise to first order with the named effect's noise.
    probability: posterior odds inside the class, of an alias.  parameters: its figures in the named
    one's place, where it was refitted.
    """

    effect: str
    sensor: str
    stage: str
    cosine: float
    nats_worse: float
    possible: bool = True
    refitted: bool = True
    probability: float | None = optional()
    parameters: Mapping[str, Estimate] | None = optional()


@dataclass(frozen=True, slots=True)
class Stretch(Record):
    """A stretch of the log and the value of a parameter in it, in SI and as outputs print it."""

    from_s: float
    to_s: float
    value: float
    text: str


@dataclass(frozen=True, slots=True)
class WithinNoise(Record):
    """The sensor whose noise, the same over the whole log, would do what an effect does, at how
    many of the spec's standard deviations of the reading that needs most, and in what share of logs
    noise that never changes is as large."""

    stage: str
    sensor: str
    sigmas: float
    chance: float


@dataclass(frozen=True, slots=True)
class PerLog(Record):
    """An effect in one of several logs, by its number from 1; start: of the system."""

    log: int
    file: str
    start: str
    parameters: Mapping[str, Estimate]


def readings_words(times: Mapping[str, float]) -> str:
    """`in down alone`: which readings of a sensor are the loud ones."""
    most = max(times.values())
    loud = [name for name, own in times.items() if own > LOUD_SHARE * most]
    alone = all(own <= MEANT for name, own in times.items() if name not in loud)
    return f"{'' if alone else 'most '}in {' and '.join(loud)}{' alone' if alone else ''}"


@dataclass(frozen=True, slots=True)
class Finding(Record):
    """One missing effect: what is wrong, with figures, and how sure this is.

    aliases: what this log cannot tell it from.  lookalikes: of the same signature, or as good in
    its place, but not it.  excluded: told apart on this log.
    kind: a cause deserves its name; noise is what the noise does otherwise than the spec says; a
    stand-in is the best word for something that the dictionary does not hold.
    material: whether it matters, by its own RMS size_m on this log or by what it does to the
    requirements.  probability: posterior odds inside the class with its aliases.
    varying: its one parameter in four quarters of the log, where it is not one value; where it is
    another one every varying_over_s, in stretches so long, varying_std their standard deviation.
    also: other sensors that share it, of a delay of a whole system.
    from_s, to_s: the stamps between which it acts, where it does so in a part of the log alone.
    changed_once: of what is built in, that its being cut to a part that one end of the log ends is
    all that makes it a stand-in: it does not come and go, but a knock may have changed it.
    readings: of a sensor's noise, deviations over the spec's by reading, where they are unlike.
    within_noise: of a cause, that constant noise within the spec's would do the same.
    scope: of several logs together, whether it is one value in all (build), one a start of the
    system, or one a log; per_log: its values where it is not one.  each_log: what every log by
    itself tells of one that is one value.  one_value: chance by which the logs would differ so much
    if it were one.
    """

    effect: str
    sensor: str
    stage: str
    parameters: Mapping[str, Estimate]
    aliases: tuple[Rival, ...]
    lookalikes: tuple[Rival, ...]
    excluded: tuple[Rival, ...]
    sentence: str
    evidence: str
    gain_nat: float
    log10_p: float | None
    confused_with: str
    separated_by: str
    source: str
    kind: Kind = "cause"
    material: bool = True
    size_m: float | None = optional()
    probability: float | None = optional()
    varying: tuple[Stretch, ...] | None = optional()
    varying_std: Estimate | None = optional()
    varying_over_s: float | None = optional()
    also: tuple[str, ...] | None = optional()
    from_s: float | None = optional()
    to_s: float | None = optional()
    changed_once: bool | None = optional()
    scope: Scope | None = optional()
    per_log: tuple[PerLog, ...] | None = optional()
    one_value: float | None = optional()
    each_log: tuple[PerLog, ...] | None = optional()
    readings: Mapping[str, float] | None = optional()
    within_noise: WithinNoise | None = optional()

    @property
    def open_aliases(self) -> tuple[Rival, ...]:
        """The aliases that are not as good as ruled out."""
        return tuple(a for a in self.aliases if a.probability is None or a.probability >= RULED_OUT)

    @property
    def fits_a_spec(self) -> bool:
        """Whether a spec can hold it."""
        effect = registry().get(self.effect)
        values = {name: one.value for name, one in self.parameters.items()}
        return (
            effect is not None
            and self.scope in (None, "build")
            and not any(effect.misfits(self.sensor, values))
        )

    def as_entries(self) -> tuple[EffectChoice, ...]:
        """The finding in a spec's `effects:`, one entry for each sensor that has it."""
        sensors = (self.sensor, *(self.also or ()))
        return tuple(replace(self, sensor=sensor).as_entry() for sensor in sensors)

    def as_entry(self) -> EffectChoice:
        """The finding as an entry of a spec's `effects:`."""
        spreads = {name: e.standard_uncertainty for name, e in self.parameters.items()}
        return EffectChoice(
            effect=self.effect,
            sensor=self.sensor,  # type: ignore[arg-type]  # a sensor of the effect's record
            stage=self.stage,
            parameters={name: e.value for name, e in self.parameters.items()},
            standard_uncertainty={
                n: s for n, s in spreads.items() if s is not None and math.isfinite(s)
            },
            source="diagnose",
            note=note_of(self),
        )


@dataclass(frozen=True, slots=True)
class Smallest(Record):
    """The SI value of a parameter at which half of such logs would have shown the effect.

    None: no value that the effect can have.  sure: the value at which 19 of 20 would have.
    within: the size that this log does not exclude at 19 of 20.
    """

    effect: str
    sensor: str
    stage: str
    parameter: str
    value: float | None
    sure: float | None = optional()
    within: float | None = optional()


@dataclass(frozen=True, slots=True)
class BlindSpot(Record):
    """An effect that the log may hide although it would turn a requirement.

    smallest_seen: of the parameter, as in `Smallest`; turns_at: the least value that does.
    """

    effect: str
    sensor: str
    stage: str
    parameter: str
    smallest_seen: float | None
    turns_at: float


@dataclass(frozen=True, slots=True)
class Informative(Record):
    """Whether the log could have shown whatever would turn the verdict on the spec."""

    ok: bool
    blind_to: tuple[BlindSpot, ...] = ()


@dataclass(frozen=True, slots=True)
class MotionQuantiles(Record):
    """5 and 95 % quantile of one covariate; most: its largest size."""

    low: float
    high: float
    unit: str
    most: float | None = optional()


@dataclass(frozen=True, slots=True)
class LogRead(Record):
    """What was read and what was left out: rows = used + thinned + all that was rejected."""

    kind: str
    rows: int
    used: int
    rejected: Mapping[str, int]
    thinned: int
    notes: tuple[str, ...]
    duration_s: float
    interval_s: float
    fitted: int
    motion: Mapping[str, MotionQuantiles]


@dataclass(frozen=True, slots=True)
class SlowNoise(Record):
    """A sensor's slow noise per axis."""

    variance_over_spec: tuple[float, ...]
    time_constant_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Likelihoods(Record):
    """Negative log likelihood of all rows [nat]."""

    nll_before: float
    nll_after: float


@dataclass(frozen=True, slots=True)
class Noise(Record):
    """The fitted noise, by `stage/sensor`; white_factor: standard deviation over the spec's.

    survey_m: standard deviation of a coordinate of the surveyed targets; None where none shows.
    """

    white_factor: Mapping[str, float]
    slow: Mapping[str, SlowNoise]
    rows_fitted: int
    remainder: Likelihoods
    survey_m: float | None = None


@dataclass(frozen=True, slots=True)
class SpecRead(Record):
    """The spec beside the log."""

    name: str
    file: str


@dataclass(frozen=True, slots=True)
class DiagnosisProvenance(Record):
    """What the answer depends on besides the log."""

    version: str
    seed: int
    false_alarm_rate: float
    max_effects: int
    exclude_effects: tuple[str, ...]
    spec_sha256: str | None
    catalogs_sha256: str | None


@dataclass(frozen=True, slots=True)
class NextDrive(Record):
    """The test drive that tells a finding from its aliases, in short.

    first: the finding; second: the commonest alias that it is told from, others: all further ones.
    inseparable: aliases that no drive of this platform tells from it, by the size that was found;
    alike: of these the ones that make the same error on every leg that it can drive.
    least_minutes: the least that does; minutes, legs: of the drive told here, which does where
    `reached`.  targets: how many to survey.  command: prints the drive whole.
    why_none: why there is no drive, in words; then minutes is None and legs are empty, and command
    looks for the drive, or says at length why there is none.
    """

    first: str
    second: str
    minutes: float | None
    least_minutes: float | None
    reached: bool
    legs: tuple[str, ...]
    targets: int
    command: str
    why_none: str | None = optional()
    others: tuple[str, ...] | None = optional()
    inseparable: tuple[str, ...] | None = optional()
    alike: tuple[str, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class LogAlone(Record):
    """One of several logs: what was read of it, and what it says alone.

    number: from 1, in the order of adding.  date: of its first stamp, where its timeline is known.
    named: effects in words.  left_m: RMS that it leaves unexplained; spec_m: what the spec's noise
    makes on it.  new: whether this call added it.
    """

    number: int
    files: tuple[str, ...]
    start: str
    date: str | None
    rows: int
    used: int
    duration_s: float
    verdict: LogOutcome
    named: tuple[str, ...]
    left_m: float
    spec_m: float
    white_factor: Mapping[str, float]
    new: bool


@dataclass(frozen=True, slots=True)
class Other(Record):
    """Another effect that explains the same as well; nats_worse: by how much less."""

    effect: str
    sensor: str
    stage: str
    nats_worse: float


@dataclass(frozen=True, slots=True)
class UnlikeOthers(Record):
    """A log that is unlike all the others, and the effect in which it differs most clearly.

    differs: by how much from what the others together say, by parameter.  log10_chance: of so
    much by noise alone, over all logs and effects.  aliases: effects that do as well in its place.
    """

    number: int
    files: tuple[str, ...]
    effect: str
    sensor: str
    stage: str
    differs: Mapping[str, Estimate]
    log10_chance: float
    aliases: tuple[Other, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class Joint(Record):
    """Several logs of one system, taken together.

    starts: how many starts of the system they are of.  store: the file that keeps their
    statistics; last: hash of its last line.  torn: bytes at its end that a kill had left.
    unlike: logs that are unlike all others, and not among `logs`; unlike_rate: the chance that any
    of several alike logs is said to be.  left_out: runs of the store that count no more, in words.
    """

    logs: tuple[LogAlone, ...]
    starts: int
    store: str | None
    last: str | None
    torn: int
    unlike: tuple[UnlikeOthers, ...] | None = optional()
    unlike_rate: float | None = optional()
    left_out: tuple[str, ...] | None = optional()


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis(Record):
    """The outcome.

    sound: whether the log contradicts neither itself nor the limits of the spec's platform.
    where: the regimes that disagreed most before anything was named.  steps: the gap after each
    addition.  unseen: what this log could not show.  smallest_seen: what it would have shown.
    plan: the drive that would tell, where a finding has aliases.  joint: the logs that were taken
    together, each as a run of its own.  system: what it is a diagnosis of
    (`same_system.description`); None of a system that no spec describes.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: LogOutcome
    sound: bool
    checks: tuple[Check, ...]
    findings: tuple[Finding, ...]
    remaining: Remaining
    where: tuple[Regime, ...]
    first_disagreement_s: float | None
    gap: WholeGap
    steps: tuple[Gap, ...]
    unseen: tuple[str, ...]
    log: LogRead
    noise: Noise
    plots: Plots
    spec: SpecRead | None
    log_files: tuple[str, ...]
    provenance: DiagnosisProvenance
    informative: Informative = Informative(True)
    smallest_seen: tuple[Smallest, ...] = ()
    plan: NextDrive | None = optional()
    joint: Joint | None = optional()
    system: Mapping[str, Told] | None = optional()

    @property
    def exit_code(self) -> int:
        """0 agrees, 1 something is missing."""
        return EXIT_CODES[self.verdict]

    def demanded_exit_code(self, *, informative: bool) -> int:
        """The exit code; 3 for a log that agrees but could not have shown what matters."""
        hidden = informative and self.verdict == "agrees" and not self.informative.ok
        return NOT_SHOWN if hidden else self.exit_code

    def effects_entries(self) -> tuple[EffectChoice, ...]:
        """What was found as entries of a spec's `effects:`.

        Without stand-ins, what does not matter, and conventions that are to be mended in the log.
        """
        return tuple(
            entry
            for finding in self.findings
            for entry in finding.as_entries()
            if finding.material and finding.kind != "stand_in" and finding.fits_a_spec
        )
