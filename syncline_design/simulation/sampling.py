"""Plain Monte Carlo: jobs of fixed size, each with its own stream, on all cores.

A job's numbers depend on the seed and the job's number only, so neither the number of workers nor
the order in which they finish changes a bit of the result, and a longer run begins with the
samples of a shorter one.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable

import numpy as np

from syncline_design.effects import acting as acting_effects
from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.random_numbers import generator
from syncline_design.model.system import System
from syncline_design.simulation import known_effects
from syncline_design.simulation.draws import RandomSource, stage_draw, timing_draws
from syncline_design.simulation.settings import SimulationSettings, demand_simulable
from syncline_design.simulation.surroundings import moment_draw, tilt_draw
from syncline_design.simulation.trajectory import trajectory_errors

JOB = 16384  # samples: what a job works on stays in the second-level cache
PLAIN_STREAM = 1  # first word of the stream key, see draws.generator
EFFECTS_STREAM = 4  # apart, so that a spec with and without an effect shares its other numbers
Consume = Callable[[int, Array], None]


def job_errors(system: System, settings: SimulationSettings, job: int, count: int = JOB) -> Array:
    """Errors [m] of the whole chain, NED, of the first `count` samples of one job, (3, count).

    They are the same whatever the count; noise that effects draw, row by row, is drawn for all.
    """
    acting = acting_effects.by_stage(system)
    needed = JOB if any(map(_scatters, acting.values())) else count
    stream = generator(settings.seed, PLAIN_STREAM, job)
    source = RandomSource(stream, needed, JOB)
    if settings.envelope == "trajectory":
        apart = RandomSource(generator(settings.seed, EFFECTS_STREAM, job), needed, JOB)
        return trajectory_errors(system, settings, source, apart)[:, :count]
    if acting:
        apart = RandomSource(generator(settings.seed, EFFECTS_STREAM, job), needed, JOB)
        return _errors_with_effects(system, settings, source, apart)[:, :count]
    shifts = timing_draws(system, source)
    carried: known_effects.Carried | None = None
    for index in range(len(system.stages)):
        draw = stage_draw(system, index, shifts, source, settings.envelope == "inside")
        carried = known_effects.level_error(draw, carried)
    assert carried is not None
    return carried.error_m


def _scatters(acting: tuple[acting_effects.Acting, ...]) -> bool:
    return any(one.effect.kind == "stochastic" for one in acting)


def _errors_with_effects(
    system: System, settings: SimulationSettings, source: RandomSource, apart: RandomSource
) -> Array:
    """The same with known effects: times, places and tilts over the horizon."""
    acting = acting_effects.by_stage(system)
    moment = moment_draw(system.horizon, apart)
    shifts = timing_draws(system, source)
    carried: known_effects.Carried | None = None
    for index, stage in enumerate(system.stages):
        draw = stage_draw(system, index, shifts, source, settings.envelope == "inside")
        where = (moment, lean_draw(system, apart))
        effects = acting.get(stage.name, ())
        carried = known_effects.placed_error(draw, where, effects, apart.generator, carried)
    assert carried is not None
    return carried.error_m


def lean_draw(system: System, source: RandomSource) -> Array:
    """(roll, pitch) [rad] (2, n): level, unless an effect acts by tilt."""
    if acting_effects.tilts(system):
        return tilt_draw(system.horizon, source)
    return np.zeros((2, source.count))


def sample_errors(system: System, settings: SimulationSettings) -> Array:
    """Errors [m] of every sample, NED, (samples, 3)."""
    demand_simulable(system)
    out = np.empty((settings.samples, 3))

    def keep(start: int, errors: Array) -> None:
        out[start : start + errors.shape[1]] = errors.T

    run_jobs(system, settings, 0, settings.samples, keep)
    return out


def run_jobs(
    system: System, settings: SimulationSettings, first: int, last: int, consume: Consume
) -> None:
    """Hand the samples first .. last - 1 to `consume`, job by job, in any order.

    `first` must begin a job.  consume(start, errors (3, n)): the samples from `start` on.  Threads
    share the work: NumPy frees the interpreter in every operation on a job's arrays.
    """
    keep_freed_memory()
    jobs = iter(range(first // JOB, -(-last // JOB)))
    failures: list[BaseException] = []
    lock = threading.Lock()
    deadline = in_force()

    def work() -> None:
        try:
            while not failures:
                deadline.check()
                with lock:
                    job = next(jobs, None)
                if job is None:
                    return
                first_of_job = job * JOB
                count = min(JOB, last - first_of_job)
                consume(first_of_job, job_errors(system, settings, job, count)[:, :count])
        except BaseException as failure:
            failures.append(failure)

    count = min(workers(settings), -(-(last - first) // JOB))
    threads = [threading.Thread(target=work) for _ in range(count - 1)]
    for thread in threads:
        thread.start()
    work()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]


def keep_freed_memory() -> None:
    """Make the C library hold on to freed memory instead of returning it after every array.

    glibc raises its thresholds for mmap and for trimming the heap when a large block is freed
    (mallopt(3), M_MMAP_THRESHOLD); without this, page faults cost as much as the arithmetic.  The
    block is never touched, so it costs no memory; elsewhere it does nothing.
    """
    np.empty(3_900_000)


def workers(settings: SimulationSettings) -> int:
    """Threads to use: as asked for, else one per core this process may use."""
    if settings.workers is not None:
        return settings.workers
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
