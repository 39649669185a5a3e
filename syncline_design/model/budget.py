"""The error budget of a system: everything the Syncline says about it, term by term.

Equations: E. R. Jellum et al., arXiv:2209.01136v2, by their labels; a chain adds its stages'
terms [eq:sync_error_survey].  Two sync models: `syncline`, (sum of v + d omega) * tau_sys with
tau_sys the largest relative bound of any pair; and `per_sensor`, each pair's rate times its own
bound, which is never larger.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from syncline_design.model import syncline
from syncline_design.model.ends import at_ends, stage_ends
from syncline_design.model.known import NOTHING_KNOWN, Known
from syncline_design.model.pairing import (
    PairRow,
    distance_m,
    largest,
    offset_s,
    pair_rows,
    tau_s,
)
from syncline_design.model.roles import RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System
from syncline_design.model.underway import underway

SyncModelName = Literal["syncline", "per_sensor"]
TermKind = Literal["sensor", "sync", "systematic", "underway"]
Systematic = Sequence[tuple[str, str, float]]  # (term, stage name, value [m])

V_TAU = "v_max*tau"
D_OMEGA_TAU = "d*omega_max*tau"
LEVER_ARM_THRESHOLD = 1.10  # the lever arm is worth a warning when it changes a figure by > 10 %


@dataclass(frozen=True, slots=True)
class LedgerTerm:
    """One term of the total error [m]; share: its part of the total, 0 to 1."""

    term: str
    stage: str
    value_m: float
    kind: TermKind
    share: float


@dataclass(frozen=True, slots=True)
class SensorRow:
    """One sensor: its timestamp error bound against its own tau_crit.

    tau_crit_s: the paper's; tau_crit_lever_arm_s: with v_max + b omega_max in place of v_max.
    ratio: tau_s / tau_crit_s; below 1 the sensor's noise outweighs its timestamp error.
    """

    stage: str
    role: RoleName
    sensor: str
    timeline: str
    tau_s: float
    tau_crit_s: float
    tau_crit_lever_arm_s: float
    sensor_error_m: float
    ratio: float


@dataclass(frozen=True, slots=True)
class StageRow:
    """One stage: its part of the chain's errors, its tau (largest of its pairs) and tau_crit."""

    stage: str
    vehicle: str
    v_max_mps: float
    omega_max_radps: float
    distance_m: float
    lever_arm_m: float
    sensor_error_m: float
    sync_rate_mps: float
    tau_s: float
    tau_crit_s: float
    sync_error_m: float
    sync_error_per_sensor_m: float


@dataclass(frozen=True, slots=True)
class LeverArm:
    """The same with v_max + b omega_max in place of v_max in every stage.

    differs: some tau_crit or the total changes by more than 10 % (LEVER_ARM_THRESHOLD).
    """

    sync_rate_mps: float
    tau_crit_s: float
    sync_error_m: float
    sync_error_per_sensor_m: float
    total_m: float
    total_per_sensor_m: float
    differs: bool


@dataclass(frozen=True, slots=True)
class Budget:
    """What the Syncline says about a system; `_per_sensor` fields hold the tighter sync model."""

    sensors: tuple[SensorRow, ...]
    pairs: tuple[PairRow, ...]
    stages: tuple[StageRow, ...]
    sensor_error_m: float
    systematic_m: float
    sync_rate_mps: float
    tau_s: float
    tau_crit_s: float
    ratio: float
    sync_ratio: float  # largest of `ratio` and every sensor's: what a sync requirement limits
    sync_error_m: float
    sync_error_per_sensor_m: float
    total_m: float
    total_per_sensor_m: float
    lever_arm: LeverArm
    ledger: tuple[LedgerTerm, ...]
    ledger_per_sensor: tuple[LedgerTerm, ...]

    def total(self, model: SyncModelName) -> float:
        """Total error [m] under a sync model."""
        return self.total_m if model == "syncline" else self.total_per_sensor_m

    def sync_error(self, model: SyncModelName) -> float:
        """Sync-induced error [m] under a sync model."""
        return self.sync_error_m if model == "syncline" else self.sync_error_per_sensor_m

    def ledger_of(self, model: SyncModelName) -> tuple[LedgerTerm, ...]:
        """All terms of the total under a sync model."""
        return self.ledger if model == "syncline" else self.ledger_per_sensor


def budget(system: System, known: Known = NOTHING_KNOWN) -> Budget:
    """The error budget of a system with what known effects add.

    Raises ValueError for a chain that makes no sense.
    """
    _demand_chain(system, known)
    pairs = pair_rows(system, known)
    stages = tuple(_stage_row(stage, i == 0, pairs) for i, stage in enumerate(system.stages))
    sensors = _sensor_rows(system, known)
    sensor_error = math.fsum(row.sensor_error_m for row in sensors)
    moved = [(one.term, system.stages[one.stage].name, one.value_m) for one in underway(system)]
    beside = (*known.systematic, *moved)
    systematic_m = math.fsum(value for _, _, value in beside)
    rate = math.fsum(row.sync_rate_mps for row in stages)
    tau = largest(pair.tau_s for pair in pairs)
    tau_crit = min(syncline.tau_crit_s(*_sums(end)) for end in at_ends(system))
    sync_error = syncline.sync_error_m(tau, rate)
    per_sensor = math.fsum(pair.sync_error_m for pair in pairs)
    error_m = sensor_error + systematic_m
    ledgers = (
        _ledger(system, known.systematic, moved, _sync_terms(pairs, tau)),
        _ledger(system, known.systematic, moved, _sync_terms(pairs, None)),
    )
    ratio = _ratio(tau, tau_crit)
    return Budget(
        sensors=sensors,
        pairs=pairs,
        stages=stages,
        sensor_error_m=sensor_error,
        systematic_m=systematic_m,
        sync_rate_mps=rate,
        tau_s=tau,
        tau_crit_s=tau_crit,
        ratio=ratio,
        sync_ratio=largest([ratio, *(row.ratio for row in sensors)]),
        sync_error_m=sync_error,
        sync_error_per_sensor_m=per_sensor,
        total_m=error_m + sync_error,
        total_per_sensor_m=error_m + per_sensor,
        lever_arm=_lever_arm(system, stages, pairs, sensors, tau, systematic_m),
        ledger=ledgers[0],
        ledger_per_sensor=ledgers[1],
    )


def _sums(system: System) -> tuple[float, float]:
    """Sensor error [m] and sync rate [m/s] of a system at one distance a stage."""
    terms = (_stage_terms(stage) for stage in system.stages)
    error = math.fsum(value for own in terms for _, value in own)
    platforms = ((one.platform, distance_m(one)) for one in system.stages)
    return error, math.fsum(p.v_max_mps + d * p.omega_max_radps for p, d in platforms)


def lever_arm_m(stage: Stage, first: bool) -> float:
    """Length b [m] of the lever arm to the point whose position is measured.

    The antenna's (first stage) or the transponder's (later stages) where it is given, otherwise
    the platform's largest lever arm.
    """
    given = stage.transponder_lever_arm_m
    if first:
        given = None if stage.position is None else stage.position.lever_arm_m
    return float(stage.platform.baseline_m) if given is None else math.hypot(*given)


def differs(paper: float, lever_arm: float) -> bool:
    """Whether two readings of a figure are more than 10 % apart (the larger over the smaller)."""
    small, large = sorted((paper, lever_arm))
    return large > LEVER_ARM_THRESHOLD * small


def _demand_chain(system: System, known: Known) -> None:
    names = [stage.name for stage in system.stages]
    if not names or len(set(names)) != len(names):
        raise ValueError(f"a system needs stages with different names, found {names}")
    if len(names) > 1 and any(stage.ranging is None for stage in system.stages):
        raise ValueError("in a chain every stage needs a ranging sensor")
    if any(stage.position is not None for stage in system.stages[1:]):
        raise ValueError("only the first stage of a chain has a position sensor")
    unknown = {stage for stage, _ in known.extra_tau_s} | {
        stage for _, stage, _ in known.systematic
    }
    if unknown - set(names):
        raise ValueError(f"effects name stages that do not exist: {sorted(unknown - set(names))}")
    added = (*known.extra_tau_s.values(), *(value for *_, value in known.systematic))
    if any(value < 0.0 for value in added):
        raise ValueError("what an effect adds must not be negative")


def _ratio(tau: float, tau_crit: float) -> float:
    """tau / tau_crit; 0 where no timestamp error matters (tau_crit inf), inf where none is free."""
    if math.isinf(tau_crit) and math.isfinite(tau):
        return 0.0
    return tau / tau_crit if tau_crit != 0.0 else math.inf


def _enters(stage: Stage, sensor: Sensor) -> bool:
    """Whether a sensor enters the estimate: without a ranging sensor only the position does."""
    return stage.ranging is not None or sensor.role == "position"


def _sensor_rows(system: System, known: Known) -> tuple[SensorRow, ...]:
    return tuple(
        _sensor_row(stage, sensor, i == 0, _own_tau_s(system, stage, sensor, known))
        for i, stage in enumerate(system.stages)
        for sensor in stage.sensors()
    )


def _own_tau_s(system: System, stage: Stage, sensor: Sensor, known: Known) -> float:
    """tau [s] of a sensor for its own tau_crit: against its timeline, where others share it.

    A stage without a ranging sensor is held against true time, so there the clock counts too.
    """
    own = tau_s(system, stage, sensor, known)
    return own if stage.ranging is not None else own + offset_s(system, sensor.timeline, UTC)


def _sensor_row(stage: Stage, sensor: Sensor, first: bool, tau: float) -> SensorRow:
    """One sensor's row; one that does not enter has no error and no tau_crit to keep (inf)."""
    v, omega = stage.platform.v_max_mps, stage.platform.omega_max_radps
    moving = syncline.position_rate_mps(v, omega, lever_arm_m(stage, first))
    error = tau_crit = with_lever_arm = math.inf
    if _enters(stage, sensor):
        error = syncline.sensor_error_m(sensor.role, sensor.sigma, distance_m(stage))
        tau_crit, with_lever_arm = (
            min(
                _own_tau_crit_s(getattr(end, sensor.role), speed, omega, distance_m(end))
                for end in stage_ends(stage)
            )
            for speed in (v, moving)
        )
    return SensorRow(
        stage=stage.name,
        role=sensor.role,
        sensor=sensor.id,
        timeline=sensor.timeline,
        tau_s=tau,
        tau_crit_s=tau_crit,
        tau_crit_lever_arm_s=with_lever_arm,
        sensor_error_m=error if _enters(stage, sensor) else 0.0,
        ratio=_ratio(tau, tau_crit),
    )


def _own_tau_crit_s(sensor: Sensor, speed: float, omega: float, d: float) -> float:
    """A sensor's tau_crit [s] at a speed and a distance."""
    error = syncline.sensor_error_m(sensor.role, sensor.sigma, d)
    return syncline.tau_crit_s(error, syncline.sensor_rate_mps(sensor.role, speed, omega, d))


def _stage_row(stage: Stage, first: bool, pairs: Sequence[PairRow]) -> StageRow:
    own = [pair for pair in pairs if pair.stage == stage.name]
    rate = math.fsum(pair.rate_mps for pair in own)
    error = math.fsum(value for _, value in _stage_terms(stage))
    tau = largest(pair.tau_s for pair in own)
    return StageRow(
        stage=stage.name,
        vehicle=stage.vehicle,
        v_max_mps=float(stage.platform.v_max_mps),
        omega_max_radps=float(stage.platform.omega_max_radps),
        distance_m=distance_m(stage),
        lever_arm_m=lever_arm_m(stage, first),
        sensor_error_m=error,
        sync_rate_mps=rate,
        tau_s=tau,
        tau_crit_s=min(_stage_tau_crit_s(end, own) for end in stage_ends(stage)),
        sync_error_m=syncline.sync_error_m(tau, rate),
        sync_error_per_sensor_m=math.fsum(pair.sync_error_m for pair in own),
    )


def _stage_tau_crit_s(stage: Stage, pairs: Sequence[PairRow]) -> float:
    """tau_crit [s] of a stage at one distance, against the rates of its pairs."""
    error = math.fsum(value for _, value in _stage_terms(stage))
    turning = distance_m(stage) * float(stage.platform.omega_max_radps)
    rates = (turning if pair.role == "attitude" else pair.rate_mps for pair in pairs)
    return syncline.tau_crit_s(error, math.fsum(rates))


def _stage_terms(stage: Stage) -> tuple[tuple[str, float], ...]:
    """The sensor-error terms of a stage, in the order position, attitude, ranging."""
    return tuple(
        term
        for sensor in stage.sensors()
        if _enters(stage, sensor)
        for term in syncline.sensor_error_terms(sensor.role, sensor.sigma, distance_m(stage))
    )


def _sync_terms(pairs: Sequence[PairRow], tau: float | None) -> tuple[tuple[str, str, float], ...]:
    """(term, stage, value [m]) of the sync error: each pair's rate times tau, or its own tau."""
    names: Mapping[RoleName, str] = {"position": V_TAU, "attitude": D_OMEGA_TAU}
    return tuple(
        (names[pair.role], pair.stage, pair.rate_mps * (pair.tau_s if tau is None else tau))
        for pair in pairs
    )


def _ledger(
    system: System, systematic: Systematic, moved: Systematic, sync_terms: Systematic
) -> tuple[LedgerTerm, ...]:
    """All terms: per stage its sensor errors, then its sync errors; last those beside them."""
    rows: list[tuple[str, str, float, TermKind]] = []
    for stage in system.stages:
        rows += [(term, stage.name, value, "sensor") for term, value in _stage_terms(stage)]
        rows += [(t, s, value, "sync") for t, s, value in sync_terms if s == stage.name]
    rows += [(term, stage_name, value, "systematic") for term, stage_name, value in systematic]
    rows += [(term, stage_name, value, "underway") for term, stage_name, value in moved]
    total = math.fsum(value for _, _, value, _ in rows)
    return tuple(
        LedgerTerm(term, stage_name, value, kind, value / total if total != 0.0 else 0.0)
        for term, stage_name, value, kind in rows
    )


def _lever_arm(
    system: System,
    stages: Sequence[StageRow],
    pairs: Sequence[PairRow],
    sensors: Sequence[SensorRow],
    tau: float,
    systematic_m: float,
) -> LeverArm:
    """The budget's sums with b omega_max added to each stage's v_max."""
    extra = {row.stage: row.lever_arm_m * row.omega_max_radps for row in stages}
    position = {pair.stage: pair.tau_s for pair in pairs if pair.role == "position"}
    paper_rate = math.fsum(row.sync_rate_mps for row in stages)
    rate = paper_rate + math.fsum(extra.values())
    per_sensor = math.fsum(
        [*(p.sync_error_m for p in pairs), *(extra[stage] * t for stage, t in position.items())]
    )
    sensor_error = math.fsum(row.sensor_error_m for row in sensors)
    error_m = sensor_error + systematic_m
    added, ends = math.fsum(extra.values()), [_sums(end) for end in at_ends(system)]
    tau_crit = min(syncline.tau_crit_s(error, own + added) for error, own in ends)
    figures = [
        (error_m + tau * paper_rate, error_m + tau * rate),
        (min(syncline.tau_crit_s(*end) for end in ends), tau_crit),
        *((row.tau_crit_s, row.tau_crit_lever_arm_s) for row in sensors),
    ]
    return LeverArm(
        sync_rate_mps=rate,
        tau_crit_s=tau_crit,
        sync_error_m=tau * rate,
        sync_error_per_sensor_m=per_sensor,
        total_m=error_m + tau * rate,
        total_per_sensor_m=error_m + per_sensor,
        differs=any(differs(paper, other) for paper, other in figures),
    )
