"""Whether grains may be taken for rigid, and each for a body of one temperature."""

from __future__ import annotations

import math
from collections.abc import Iterator

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.prepared import Prepared
from multicor_cli.checks.recorded import Recorded
from multicor_cli.engine.heat.hertz import contact_modulus
from multicor_cli.running.time_step import largest_gravity, largest_speed
from multicor_cli.scenario.heat import PrescribedForce

_SOFT = 1e-3
_TOO_SOFT = 1e-2
_BIOT = 0.1

_RIGID = (
    "Elastic deflection of a contact over the diameter (Hertz, spheres). Rigid grains leave it out: sizes of contacts, densities "
    "of packings and times of contacts are those of rigid grains only if it is far below 1."
)


def impact_deflection(speed: float, density: float, young: float, poisson: float) -> float:
    """Largest deflection of two equal elastic spheres that meet at a speed, over their diameter.

    δ = (15 m* v²/(16 E* √a*))^⅖ with m* = m/2, a* = a/2 and E* = E/(2(1−ν²)) (K. L. Johnson, Contact Mechanics (1985), eq. 11.23);
    with m = 4π a³ρ/3 the radius cancels.

    Args:
        speed: Relative speed v [m/s].
        density: ρ [kg/m³].
        young: Young's modulus E [Pa].
        poisson: Poisson's ratio ν.
    """
    ratio = density * speed * speed / contact_modulus(young, poisson, young, poisson)
    return float(0.5 * (5.0 * math.pi * math.sqrt(2.0) / 8.0 * ratio) ** 0.4)


def _under_load(run: Prepared) -> Iterator[Measured]:
    if run.cost.deflection is not None:
        yield Measured(run.cost.deflection)


def _in_impacts(run: Prepared) -> Iterator[Measured]:
    stages = zip(run.plan.stages, run.drives, strict=True)
    speed = max(largest_speed(run.scenario, run.model, drives, largest_gravity(stage, run.model)) for stage, drives in stages)
    for name, table in run.scenario.materials.items():
        if table.young is not None and table.poisson is not None and speed > 0.0:
            yield Measured(impact_deflection(speed, table.density, table.young, table.poisson), f"{name} at {speed:.3g} m/s")


def _predicted_biot(run: Prepared) -> Iterator[Measured]:
    """Bi = 2 λ a_c/(λ a) between equal grains, with the radius a_c = a √(δ/2a) of their contact (Hertz)."""
    heat, deflection = run.scenario.heat, run.cost.deflection
    if heat is not None and heat.conduction == "hertz" and deflection is not None and not isinstance(heat.force, PrescribedForce):
        yield Measured(2.0 * math.sqrt(deflection))


def _reached(run: Recorded) -> Iterator[Measured]:
    if run.has_steps and run.info["hertz_deflection"] is not None:
        yield Measured(run.info["hertz_deflection"])


def _reached_biot(run: Recorded) -> Iterator[Measured]:
    if run.has_steps and run.info["heat"] is not None:
        yield Measured(run.info["heat"]["max_biot"])


_STIFFER = "Lower loads or speeds, or read results as those of rigid grains; a soft-particle program computes soft ones."
_ONE_TEMPERATURE = (
    "Biot number of the contacts, H/(λ a): the resistance inside a grain over that of a contact. A grain has one temperature here, "
    "which is questionable above 0.1 and wrong above 1."
)
_LOWER_BIOT = "Read temperatures as means over grains; benchmarks/lattice14 measures the error."

BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule(
        "deflection", _under_load, _RIGID + " Predicted from the weight of the grains and the loads.", _STIFFER,
        unit="of a diameter", warning=_SOFT, bad=_TOO_SOFT,
    ),
    Rule(
        "deflection in impacts", _in_impacts,
        "As deflection, in an elastic impact at the largest of the speed of a free fall through the domain, those of grains at the "
        "start or at their release, and those of walls. It lasts for the time of an impact only.", _STIFFER,
        unit="of a diameter", warning=_TOO_SOFT, bad=5.0 * _TOO_SOFT,
    ),
    Rule(
        "Biot number", _predicted_biot, _ONE_TEMPERATURE + " Predicted from the weight of the grains and the loads.", _LOWER_BIOT,
        warning=_BIOT, bad=1.0,
    ),
)  # fmt: skip
"""What is checked before a run."""

OF_RUN: tuple[Rule[Recorded], ...] = (
    Rule(
        "Hertz deflection", _reached,
        _RIGID + " Of the largest contact force so far, which is an impulse over the time step.",
        _STIFFER + " If a single impact made it, which is far from the mean forces, it is no more than that.",
        unit="of a diameter", warning=_SOFT, bad=_TOO_SOFT,
    ),
    Rule("largest Biot number", _reached_biot, _ONE_TEMPERATURE, _LOWER_BIOT, warning=_BIOT, bad=1.0),
)  # fmt: skip
"""What is checked of a run."""
