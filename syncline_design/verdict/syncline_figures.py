"""The Syncline of a verdict: totals by both models, per stage, and the ledger of terms."""

from __future__ import annotations

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.model.budget import SyncModelName, TermKind


@dataclass(frozen=True, slots=True)
class ModelTotal(Record):
    """What one sync model says."""

    sync_error_m: float
    total_m: float


@dataclass(frozen=True, slots=True)
class ModelTotals(Record):
    """Both sync models side by side."""

    syncline: ModelTotal
    per_sensor: ModelTotal


@dataclass(frozen=True, slots=True)
class LeverArmFigures(Record):
    """The same with the lever arm's rotation; differs: some figure changes by more than 10 %."""

    tau_crit_s: float | None
    total_m: float
    sync_rate_mps: float
    differs: bool


@dataclass(frozen=True, slots=True)
class StageSyncline(Record):
    """One stage's part; tau_crit_s None: it has no limit."""

    name: str
    sensor_error_m: float
    sync_rate_mps: float
    tau_s: float
    tau_crit_s: float | None


@dataclass(frozen=True, slots=True)
class LedgerRow(Record):
    """One term of the total error; share: its part of the total, 0 to 1."""

    term: str
    stage: str
    value_m: float
    kind: TermKind
    share: float


@dataclass(frozen=True, slots=True)
class SynclineFigures(Record):
    """What the Syncline says of a design, by the model of the spec and by both."""

    model: SyncModelName
    sensor_error_m: float
    sync_rate_mps: float
    tau_s: float
    tau_crit_s: float | None
    sync_error_m: float
    systematic_error_m: float
    total_m: float
    models: ModelTotals
    lever_arm: LeverArmFigures
    stages: tuple[StageSyncline, ...]
    ledger: tuple[LedgerRow, ...]
