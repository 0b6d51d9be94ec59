"""What a run will cost before it is started, roughly: steps, memory, disk, time; and the basis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from multicor_cli.arithmetic import power
from multicor_cli.engine.heat.hertz import largest_deflection
from multicor_cli.engine.jit.threads import PARALLEL_GRAINS
from multicor_cli.model import Model, State
from multicor_cli.running.plan import RunPlan, StagePlan, foresee_steps
from multicor_cli.running.time_step import (
    Scales,
    largest_gravity,
    largest_pressure,
    scales_of_stage,
)
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.settings import Output
from multicor_cli.store import schema
from multicor_cli.store.hdf5 import Precision, dtype_of
from multicor_cli.store.schema import Dataset
from multicor_cli.store.segments import model_dims

# ---- What a step will cost, from what the stage is about to do: sweeps of the solver, and time.
#
# Fitted to the shipped scenarios on one core of an AMD EPYC (AVX2): what is said here is 0.5 to
# 1.5 times what whole runs take, for the steps that they do. Most of the rest is the number of
# sweeps.

CONTACTS_PER_GRAIN = 1.3
"""Contacts within reach, loaded or not, per grain on average: 1.0 in fast flows, 1.8 in beds."""

SWEEPS = 30.0
"""Sweeps of a step at `INERTIAL_NUMBER`, or where nothing sets one, and at `TOLERANCE`."""

INERTIAL_NUMBER, SLOWNESS = 0.03, 0.4
"""Slow flows need more sweeps, as the power -`SLOWNESS` of their inertial number."""

FEWEST, MOST = 0.4, 6.0
"""Bounds of that proportion."""

TOLERANCE, TIGHTNESS = 2e-3, 0.31
"""Likewise with ``tolerance_rms``."""

SECONDS_PER_CONTACT = 6.5e-9
"""One sweep over one contact on one core [s]."""

SECONDS_PER_GRAIN = 0.25e-6
"""Everything but the sweeps, per grain and step, on one core [s]."""

SECONDS_PER_STEP = 0.3e-3
"""What a step costs however few grains there are [s]."""

HEAT_PER_STEP, HEAT_PER_GRAIN = 0.3e-3, 0.1e-6
"""What heat adds to a step, and to that for each grain [s]."""

PER_CONTACT_OF_OUTLINES, PER_GRAIN_OF_OUTLINES = 2.5, 4e-6
"""How much longer a sweep over a contact of other grains than discs takes; and what finding their
points adds for each grain [s]."""

EXCHANGE_PER_STEP = 0.7e-3
"""What grains that come and go add to a step, on average [s]."""

SECONDS_PER_FROZEN_STEP, SECONDS_PER_FROZEN_GRAIN = 0.3e-3, 0.25e-6
"""Heat flow in one step of a frozen stage, and for each grain, on one core [s]."""


def sweeps_of_stage(scales: Scales, tolerance: float) -> float:
    """Rough number of sweeps of a step at a ``tolerance_rms``."""
    slowness = 1.0
    if scales.pressure < math.inf and scales.strain < math.inf:
        slowness = power(scales.pressure / scales.strain / INERTIAL_NUMBER, -SLOWNESS)
    return SWEEPS * min(max(slowness, FEWEST), MOST) * power(tolerance / TOLERANCE, -TIGHTNESS)


def seconds_per_step(
    grains: int, sweeps: float, stage: StagePlan, threads: int, *, comes_and_goes: bool = False,
    has_outlines: bool = False,
) -> float:  # fmt: skip
    """Rough wall-clock time of a step [s]; small problems do not profit from threads."""
    if stage.is_frozen:
        return SECONDS_PER_FROZEN_STEP + grains * SECONDS_PER_FROZEN_GRAIN
    sweep, rest = CONTACTS_PER_GRAIN * SECONDS_PER_CONTACT, SECONDS_PER_GRAIN
    if has_outlines:
        sweep, rest = PER_CONTACT_OF_OUTLINES * sweep, rest + PER_GRAIN_OF_OUTLINES
    work = grains * (sweeps * sweep + rest)
    fixed = SECONDS_PER_STEP + (EXCHANGE_PER_STEP if comes_and_goes else 0.0)
    if stage.heat is not None and stage.heat.is_on:
        fixed += HEAT_PER_STEP
        work += grains * HEAT_PER_GRAIN
    return fixed + (work / (0.8 * threads) if threads > 1 and grains >= PARALLEL_GRAINS else work)


# ---- The estimate

LOADED_PER_GRAIN = 1.1
"""Contacts with a force, which frames hold, per grain on average: 1.05 (fast) to 1.7 (beds)."""

SECONDS_TO_START = 1.5
"""From the command to the first step: modules and compiled kernels are loaded [s]."""

BYTES_AT_REST = 220e6
"""Memory of the interpreter with its libraries and kernels [bytes]."""

BYTES_PER_GRAIN = 1000.0
"""Memory per grain: state, contacts, neighbor list, solver [bytes]."""

BUFFER = 64e6
"""Frames that wait to be written take up to this much, or one frame [bytes]."""


def compilation(model: Model) -> str:
    """How long the kernels compile if none are kept, in words; those of outlines are as many."""
    return "half a minute" if model.outlines is None else "a minute"


@dataclass(frozen=True)
class Estimate:
    """What a run will cost; None where the number of steps is not known.

    Attributes:
        steps: Steps at most.
        frames: Frames at most.
        memory: Memory in use [bytes].
        frame_bytes: Size of one frame [bytes].
        disk: Size of the finished run directory [bytes].
        disk_peak: Largest size of the run directory [bytes], while ``results.h5`` is made.
        seconds: Wall-clock time, compilation left out [s].
        deflection: Elastic deflection that rigid grains neglect, over the diameter; None without
            elastic materials or load.
        basis: How time and memory were estimated.
    """

    steps: int | None
    frames: int | None
    memory: float
    frame_bytes: float
    disk: float | None
    disk_peak: float | None
    seconds: float | None
    deflection: float | None
    basis: str


def estimate(
    scenario: Scenario, plan: RunPlan, model: Model, state: State, threads: int
) -> Estimate:
    """Estimate the cost of a run that starts in ``state``."""
    n, stages = model.grain_count, plan.stages
    steps = foresee_steps(plan, state)
    costs = _costs(scenario, plan, model, threads)
    known = None if None in steps else [count for count in steps if count is not None]
    frame = _frame_bytes(model, plan.output)
    frames = disk = peak = seconds = None
    if known is not None:
        counts = list(zip(known, stages, strict=True))
        frames = 1 + sum(math.ceil(count / stage.frame_every) for count, stage in counts)
        rows = 1 + sum(math.ceil(count / stage.series_every) for count, stage in counts)
        series = rows * _row_bytes(schema.SERIES, model)
        results = frames * frame + series + n * 32.0
        disk = results + 2.0 * n * (7 * 8.0 + LOADED_PER_GRAIN * 24.0)  # two checkpoints
        peak = disk + results
        seconds = SECONDS_TO_START + math.fsum(
            count * cost.seconds for count, cost in zip(known, costs, strict=True)
        )
    slowest = max(costs, key=lambda cost: cost.seconds)
    step = f"{1e3 * slowest.seconds:.2g} ms"
    if slowest.sweeps:
        step += f" and {slowest.sweeps:.2g} sweeps"
    basis = (
        f"rough, to a factor of 1.5 in most shipped scenarios: {step} a step in stage "
        f"{slowest.name}; dilute flows need fewer sweeps, slow ones and tight tolerances more. "
        f"Memory: {BYTES_PER_GRAIN:g} B per grain"
    )
    if model.outlets is not None:
        basis += ", as if all of them were there from the start"
    return Estimate(
        steps=None if known is None else sum(known),
        frames=frames,
        memory=BYTES_AT_REST + n * BYTES_PER_GRAIN + min(max(BUFFER, frame), 64.0 * frame),
        frame_bytes=frame,
        disk=disk,
        disk_peak=peak,
        seconds=seconds,
        deflection=_deflection(scenario, plan, model),
        basis=basis,
    )


class _StepCost(NamedTuple):
    name: str
    sweeps: float
    seconds: float


def _costs(scenario: Scenario, plan: RunPlan, model: Model, threads: int) -> list[_StepCost]:
    costs = []
    for number, stage in enumerate(plan.stages):
        scales = scales_of_stage(scenario, model, number, stage)
        sweeps = 0.0 if stage.is_frozen else sweeps_of_stage(scales, stage.settings.tolerance_rms)
        seconds = seconds_per_step(
            model.grain_count, sweeps, stage, threads, comes_and_goes=model.outlets is not None,
            has_outlines=model.outlines is not None,
        )  # fmt: skip
        costs.append(_StepCost(stage.name, sweeps, seconds))
    return costs


def _frame_bytes(model: Model, output: Output) -> float:
    tables, precision = schema.STEPS + schema.OFFSETS + schema.WALLS, output.precision
    size = model.grain_count * _row_bytes(schema.PARTICLES, model, precision)
    if output.contacts:
        of_contact = _row_bytes(schema.CONTACTS, model, precision)
        size += LOADED_PER_GRAIN * model.grain_count * of_contact
    return size + _row_bytes(tables, model, precision)


def _row_bytes(table: tuple[Dataset, ...], model: Model, precision: Precision = "double") -> float:
    """Bytes of one row of all datasets of a table that a run of this model has."""
    return math.fsum(
        math.prod(spec.shape(model_dims(model))[1:]) * dtype_of(spec, precision).itemsize
        for spec in schema.select(table, schema.features_of(model))
    )


def _deflection(scenario: Scenario, plan: RunPlan, model: Model) -> float | None:
    """Deflection at the largest pressure of any stage, of the softest material's smallest grain."""
    zeros = [0.0] * len(plan.stages)
    pressure = max(
        largest_pressure(
            scenario, model, stage.drives.started(zeros), largest_gravity(stage, model)
        )
        for stage in plan.stages
    )
    elastic = {
        name: (table.young, table.poisson)
        for name, table in scenario.materials.items()
        if table.young is not None and table.poisson is not None
    }
    load = pressure * model.mean_diameter
    return largest_deflection(model, load, elastic) if pressure > 0.0 else None
