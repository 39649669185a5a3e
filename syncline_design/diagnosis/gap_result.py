"""The gap between a log and a model in a diagnosis: before, after, and what remains."""

from __future__ import annotations

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional

LEAST_SHARE = 0.02  # of the RMS: a gap of less is not worth a percentage of it


@dataclass(frozen=True, slots=True)
class Fit(Record):
    """How well a model predicts rows: 3-D RMS, chi-square and NLL per component, 95 % coverage."""

    rms_m: float
    reduced_chi2: float
    nll_per_sample: float
    coverage_95: float


@dataclass(frozen=True, slots=True)
class HeldOut(Record):
    """Held-out rows before, after and at best.

    fitted: at best, the same effects fitted to all rows, the held-out ones too.  floor: that, or
    what the spec's own noise would give, whichever is lower, in RMS and in NLL: down to where a
    closed fraction counts, which no model need reach.
    """

    before: Fit
    after: Fit
    floor: Fit
    fitted: Fit

    @property
    def slight(self) -> bool:
        """Whether what could be closed is next to nothing."""
        return self.before.rms_m - self.floor.rms_m <= LEAST_SHARE * self.before.rms_m


@dataclass(frozen=True, slots=True)
class Saved(Record):
    """NLL saved per sample, and its standard error over the blocks: None of one block."""

    value: float
    standard_error: float | None


@dataclass(frozen=True, slots=True)
class Gap(Record):
    """The gap on rows that the fit has not seen; held_out: None where none could be held out.

    added: what was added for it, of a step and of the placebo.  held_rows: which rows a regime is.
    expected_rms_m: what the spec's noise gives.
    closed_fraction: (before - after) / (before - floor), in NLL or in RMS, whichever is less; None
    where nothing was held out (findings that only change the noise), and where there was no gap to
    speak of (`HeldOut.slight`).
    """

    added: str | None = optional()
    held_out: HeldOut | None = None
    expected_rms_m: float | None = optional()
    closed_fraction: float | None = None
    nll_saved_per_sample: Saved | None = optional()
    held_rows: str | None = optional()


@dataclass(frozen=True, slots=True)
class UnseenBlock(Record):
    """A block of the log against what was found without it: effects, values, noise, thresholds.

    found: what was.  closed_fraction: (before - after) / (before - expected), in NLL or in RMS,
    whichever is less; None where there was no gap to speak of.
    """

    from_s: float
    to_s: float
    rows: int
    found: tuple[str, ...]
    before: Fit
    after: Fit
    expected_rms_m: float
    closed_fraction: float | None


@dataclass(frozen=True, slots=True)
class WholeGap(Gap):
    """The gap on blocks of the log, on its fastest part, and with a placebo added.

    unseen: on a block that nothing has seen; None where nothing was found or the log is too short.
    """

    regime: Gap = Gap()
    placebo: Gap = Gap()
    unseen: UnseenBlock | None = None


@dataclass(frozen=True, slots=True)
class Regime(Record):
    """Part of a log told by a covariate, and an axis: the mean error over its standard error."""

    covariate: str
    low: float
    high: float
    unit: str
    axis: str
    score: float
    mean_m: float
    rows: int


@dataclass(frozen=True, slots=True)
class Remaining(Record):
    """What is left when everything named is in; p: chance that noise alone leaves it.

    size_m: RMS of what is left beyond the model; spec_m: the RMS that the spec's noise expects.
    material: whether it matters; what does not is left unnamed and changes no verdict.  p is null
    where the test fails: it rests on a model that was just refuted.
    """

    unexplained: bool
    spec_m: float | None
    beyond_noise: bool
    p: float | None
    where: tuple[Regime, ...]
    size_m: float | None = None
    material: bool = False
