"""Whether the time step resolves the flow: the step that was asked for, the one that the flow needs, and what it does to losses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.prepared import Prepared
from multicor_cli.checks.recorded import Recorded
from multicor_cli.model import Model
from multicor_cli.running.time_step import Scales, StepReview, largest_friction

_SOLID_FRACTION = 0.8
"""Of a dense packing in the plane."""

_DENSE = 0.5
"""Contacts within reach per grain from which on grains are a dense flow. In a rain or a gas, P and γ̇ say nothing about the step."""


def _compare(names: Sequence[str], steps: Sequence[float], reviews: Sequence[StepReview | None]) -> Iterator[Measured]:
    for name, dt, review in zip(names, steps, reviews, strict=True):
        if review is not None and review.automatic is not None:
            ratio = 1.0 if review.is_automatic else dt / review.automatic
            yield Measured(ratio, f"{dt:.3g} s in stage {name}; the automatic one is set by {review.set_by}")


def _asked_for(run: Prepared) -> Iterator[Measured]:
    stages = run.plan.stages
    return _compare([stage.name for stage in stages], [stage.dt for stage in stages], run.reviews)


def _used(run: Recorded) -> Iterator[Measured]:
    if run.planned is None:
        return iter(())
    stages = run.planned[1].stages
    return _compare([stage.name for stage in stages], [stage.dt for stage in stages], run.reviews)


def _needed(run: Recorded) -> Iterator[Measured]:
    """The step over the limit of a stage, from the mean pressure and the mean rate of shear that its rows show.

    With the trace of the stress, Σ f·ℓ = 2 P V, the mean pressure P; and with the work of sliding Ẇ ≈ μ P V γ̇ the rate of shear
    γ̇ that would dissipate as much.
    """
    model, steps = run.run.model, np.asarray(run.run.frames.column("steps/dt"))
    mass = total(model.grains.mass) / model.grain_count
    area = math.pi * total(model.grains.radius * model.grains.radius) / _SOLID_FRACTION
    for stage, name in enumerate(run.run.stages):
        rows = run.rows(stage)
        used = steps[np.asarray(run.run.frames.stage) == stage]
        if rows.size < 2 or not used.size:
            continue
        weight = run.series("window_duration")[rows]
        if total(weight * run.series("contacts_mean")[rows]) < _DENSE * model.grain_count * total(weight):
            continue
        virial = run.series("virial_rate")[rows]
        trace = total(weight * (virial[:, 0, 0] + virial[:, 1, 1])) / total(weight)
        sliding = run.series("friction_sliding")
        work = float(sliding[rows[-1]] - sliding[max(0, rows[0] - 1)]) / total(weight)
        if trace <= 0.0:
            continue
        friction = largest_friction(model, run.laws(stage))
        rate = work / (0.5 * trace * friction) if friction > 0.0 else 0.0
        scales = Scales(math.sqrt(mass * area / (0.5 * trace)), 1.0 / rate if rate > 0.0 else math.inf, math.inf, friction)
        yield Measured(float(used.max()) / scales.limit, f"{used.max():.3g} s in stage {name}")


def _negative(run: Recorded) -> Iterator[Measured]:
    """The share, unless the grains rest: losses of a step are then below the energy ½ M (g Δt)² of what gravity does in one.

    A bed at rest loses a hundredth of that, with any share; flows lose more than ten times as much.

    Impacts with a coefficient of restitution e take up more than they lose, 1/(1 − e²) times as much, and give the rest back. The
    errors of a step follow what is taken up: over that, their share is the same for all e; over what is lost it has no bound.
    """
    steps = float(run.series("window_steps").sum())
    if not run.has_steps or steps == 0.0:
        return
    model, dt = run.run.model, float(np.asarray(run.run.frames.column("steps/dt")).max(initial=0.0))
    kick = run.largest_gravity * dt
    lost = run.book("friction_loss") + run.book("impact_loss") - run.book("negative_loss")
    squared = _least_restitution(model) ** 2
    if lost > steps * 0.5 * total(model.grains.mass) * kick * kick and squared < 1.0:
        given_back = max(0.0, run.book("impact_loss")) * squared / (1.0 - squared)
        yield Measured(run.info["negative_loss_share"] * lost / (lost + given_back))


def _least_restitution(model: Model) -> float:
    """Smallest coefficient of restitution between two grains."""
    materials = np.unique(model.grains.material)
    return float(model.laws.restitution[np.ix_(materials, materials)].min())


_AUTOMATIC = 'Use dt = "auto", or a step of that size.'

_RATIO = (
    "Given time step over the automatic one, at which friction and solid fraction of plane shear are within 0.01 and 0.004 of what "
    "small steps give. A step four times as long raises friction by up to 0.08 and lowers the solid fraction by up to 0.02. "
    "What walls, loads and gravity are told to do is looked at once in a step: of a period of ten steps or fewer little is left."
)


def _heat_error(run: Recorded) -> Iterator[Measured]:
    heat = run.info["heat"]
    if run.has_steps and heat is not None and heat.get("integration_error") is not None:
        yield Measured(heat["integration_error"])


BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule("time step", _asked_for, _RATIO, _AUTOMATIC, unit="automatic steps", warning=1.25, bad=5.0),
)  # fmt: skip
"""What is checked before a run."""

OF_RUN: tuple[Rule[Recorded], ...] = (
    Rule("time step", _used, _RATIO, _AUTOMATIC, unit="automatic steps", warning=1.25, bad=5.0),
    Rule(
        "time step for the flow", _needed,
        "Time step over the longest that the flow of a stage would have needed, by the rules of the automatic one, with the mean "
        "pressure and the work of friction that were recorded in place of those that the scenario lets expect. Stages with fewer "
        "contacts within reach than half of the grains (a rain, a gas) are left out.",
        "Give a shorter dt in this stage.", unit="of the longest step", warning=2.0, bad=5.0,
    ),
    Rule(
        "negative losses", _negative,
        "Energy that contacts gained over what others took up: what friction lost, and what impacts lost or gave back, by their "
        "coefficient of restitution. The loss of a contact in a step is -p·½(u⁻ + u⁺): negative where the "
        "mean of both velocities points along the impulse, although the impulse brakes at the end of the step. A long step, in "
        "which many impacts and reversals of sliding are one, has many of those; a share of some percent is the error of the step. "
        "In slow flows under a load the error that the solver leaves in velocities makes them, too. "
        "Left out where the grains rest: what is lost there is next to nothing; and where e = 1: impacts lose nothing else.",
        "Use a shorter dt: the share falls with it. Where the checks of the time step are well, the flow is slow: lower "
        "tolerance_rms.", unit="of the energy taken up", warning=0.05, bad=0.1,
    ),
    Rule(
        "error of temperatures", _heat_error,
        "Largest estimated error of temperatures in a sub-step of the heat flow so far, over their spread; where a step is short "
        "against the time constants C/ΣH and Euler's rule does, half of their ratio, by which differences decay too fast or too "
        "slowly. Sub-steps are as short as tolerance in [heat] asks for.",
        "Lower tolerance in [heat].", unit="of the spread", warning=2e-3, bad=0.05,
    ),
)  # fmt: skip
"""What is checked of a run."""
