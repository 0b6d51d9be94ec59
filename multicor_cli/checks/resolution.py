"""Whether values suit flow and machine: step, stiffness, magnitudes, rounding, disk, memory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.checks.check import Measured, Prepared, Recorded, Rule, moments_of
from multicor_cli.engine.heat.hertz import contact_modulus
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import DofDrive
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.running.machine import available_memory, free_space
from multicor_cli.running.plan import StagePlan
from multicor_cli.running.time_step import (
    Scales,
    StepReview,
    largest_friction,
    largest_gravity,
    largest_restitution,
    largest_speed,
)
from multicor_cli.scenario.heat import PrescribedForce
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.text import format_bytes

# ---- Whether the step resolves the flow: what was asked for, what is needed, and losses

_SOLID_FRACTION = 0.8
"""Of a dense packing in the plane."""

_DENSE = 0.5
"""Contacts within reach per grain from which on a flow is dense, and no rain or gas."""


def _compared(
    stages: Sequence[StagePlan], reviews: Sequence[StepReview | None]
) -> Iterator[Measured]:
    for stage, review in zip(stages, reviews, strict=True):
        if review is not None and review.automatic is not None:
            ratio = 1.0 if review.is_automatic else stage.dt / review.automatic
            about = f"{stage.dt:.3g} s in stage {stage.name}"
            yield Measured(ratio, f"{about}; the automatic one is set by {review.set_by}")


def _needed(run: Recorded) -> Iterator[Measured]:
    """The step over the limit of a stage, from the mean pressure and rate of shear of its rows.

    With the trace of the stress, Σ f·ℓ = 2 P V, the mean pressure P; and with the work of sliding
    Ẇ ≈ μ P V γ̇ the rate of shear γ̇ that would dissipate as much. Where grains fly, P and γ̇ say
    nothing about the step, and the rms speed of the fastest row stands in for them.
    """
    model, steps = run.run.model, np.asarray(run.run.frames.column("steps/dt"))
    mass = total(model.grains.mass) / model.grain_count
    area = math.pi * total(model.disc_radius * model.disc_radius) / _SOLID_FRACTION
    for stage, name in enumerate(run.run.stages):
        rows = run.rows(stage)
        used = steps[np.asarray(run.run.frames.stage) == stage]
        if rows.size < 2 or not used.size:
            continue
        weight = run.series("window_duration")[rows]
        contacts = total(weight * run.series("contacts_mean")[rows])
        errors = run.planned[0].stage_solver(stage).error_factor if run.planned else 1.0
        said = f"{used.max():.3g} s in stage {name}"
        if contacts < _DENSE * model.grain_count * total(weight):
            kinetic = float(run.series("kinetic")[rows].max())
            if kinetic > 0.0:
                travel = model.mean_diameter / math.sqrt(2.0 * kinetic / total(model.grains.mass))
                flights = Scales(math.inf, math.inf, travel, errors=errors)
                yield Measured(float(used.max()) / flights.limit, f"{said}, in which grains fly")
            continue
        virial = run.series("virial_rate")[rows]
        trace = total(weight * (virial[:, 0, 0] + virial[:, 1, 1])) / total(weight)
        sliding = run.series("friction_sliding")
        work = float(sliding[rows[-1]] - sliding[max(0, rows[0] - 1)]) / total(weight)
        if trace <= 0.0:
            continue
        friction = largest_friction(model, run.laws(stage))
        rate = work / (0.5 * trace * friction) if friction > 0.0 else 0.0
        shear = 1.0 / rate if rate > 0.0 else math.inf
        scales = Scales(
            math.sqrt(mass * area / (0.5 * trace)), shear, math.inf, friction, errors=errors,
            restitution=largest_restitution(model),
        )  # fmt: skip
        yield Measured(float(used.max()) / scales.limit, said)


def _negative(run: Recorded) -> Iterator[Measured]:
    """The share, unless grains rest: losses of a step are then below ½ M (g Δt)², gravity's energy.

    A bed at rest loses a hundredth of that, with any share; flows lose more than ten times as much.

    Impacts with a coefficient of restitution e take up more than they lose, 1/(1 − e²) times as
    much, and give the rest back. The errors of a step follow what is taken up: over that, their
    share is the same for all e; over what is lost it has no bound. With e = 1 all is given back:
    errors are energy that the largest kinetic energy is too much or too little by.
    """
    steps = float(run.series("window_steps").sum())
    if not run.has_steps or steps == 0.0:
        return
    model, dt = run.run.model, float(np.asarray(run.run.frames.column("steps/dt")).max(initial=0.0))
    kick = run.largest_gravity * dt
    lost = run.book("friction_loss") + run.book("impact_loss") - run.book("negative_loss")
    materials = np.flatnonzero(np.bincount(model.grains.material))
    squared = float(model.laws.restitution[np.ix_(materials, materials)].min()) ** 2
    largest = float(run.series("kinetic").max(initial=0.0))
    if squared == 1.0:
        if largest > 0.5 * total(model.grains.mass) * kick * kick:
            yield Measured(run.info["negative_loss_share"] * lost / max(lost, largest))
    elif lost > steps * 0.5 * total(model.grains.mass) * kick * kick:
        given_back = max(0.0, run.book("impact_loss")) * squared / (1.0 - squared)
        yield Measured(run.info["negative_loss_share"] * lost / (lost + given_back))


_AUTOMATIC = 'Use dt = "auto", or a step of that size.'

_RATIO = (
    "Given time step over the automatic one, at which friction and solid fraction of plane shear "
    "are within 0.008 and 0.004 of what small steps give, with the accuracy that is asked for. A "
    "step four times as long raises friction by up to 0.04 and lowers the solid fraction by up to "
    "0.01. What walls, loads and "
    "gravity are told to do is looked at once in a step: of a period of ten steps or fewer little "
    "is left."
)


BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule("time step", lambda run: _compared(run.plan.stages, run.reviews), _RATIO, _AUTOMATIC,
        unit="automatic steps", warning=1.25, bad=5.0),
)  # fmt: skip

OF_RUN: tuple[Rule[Recorded], ...] = (
    Rule("time step", lambda run: _compared(run.stages, run.reviews), _RATIO, _AUTOMATIC,
        unit="automatic steps", warning=1.25, bad=5.0),
    Rule(
        "time step for the flow", _needed,
        ("Time step over the longest that the flow of a stage would have needed, by the rules of "
            "the automatic one, with the mean pressure and the work of friction that were "
            "recorded in place of those that the scenario lets expect. In stages with fewer "
            "contacts within reach than half of the grains (a rain, a gas) by the largest rms "
            "speed instead: grains that go farther than their own size in a step may meet others "
            "late, or not where they are."),
        "Give a shorter dt in this stage; its cost grows in proportion.",
        unit="of the longest step", warning=2.0, bad=5.0,
    ),
    Rule(
        "negative losses", _negative,
        ("Energy that contacts gained over what others took up: what friction lost, and what "
            "impacts lost or gave back, by their coefficient of restitution. The loss of a "
            "contact in a step is -p·½(u⁻ + u⁺): negative where the mean of both velocities "
            "points along the impulse, although the impulse brakes at the end of the step. A long "
            "step, in which many impacts and reversals of sliding are one, has many of those; a "
            "share of some percent is the error of the step. In slow flows under a load the error "
            "that the solver leaves in velocities makes them, too. Left out where the grains "
            "rest: what is lost there is next to nothing. Where e = 1 impacts lose nothing else: "
            "there the largest kinetic energy counts as taken up, if it is more."),
        ("Where the checks of the time step are ok the flow is slow: lower tolerance_rms (to a "
            "tenth), which a shorter dt needs all the more. Elsewhere use a shorter dt: the share "
            "falls with it."), unit="of the energy taken up", warning=0.05, bad=0.1,
    ),
    Rule(
        "error of temperatures", lambda run: run.summary("heat", "integration_error"),
        ("Largest estimated error of temperatures in a sub-step of the heat flow so far, over "
            "their spread; where a step is short against the time constants C/ΣH and Euler's rule "
            "does, half of their ratio, by which the temperature of a grain decays too fast (a "
            "difference of two equal ones: twice that). Sub-steps are as short as tolerance in "
            "[heat] asks for."),
        "Lower tolerance in [heat].", unit="of the spread", warning=2e-3, bad=0.05,
    ),
)  # fmt: skip


# ---- Whether grains may be taken for rigid, and each for a body of one temperature

_SOFT = 1e-3
_TOO_SOFT = 1e-2
_BIOT = 0.1

_RIGID = (
    "Elastic deflection of a contact over the diameter (Hertz, spheres). Rigid grains leave it "
    "out: sizes of contacts, densities of packings and times of contacts are those of rigid "
    "grains only if it is far below 1."
)


def impact_deflection(speed: float, density: float, young: float, poisson: float) -> float:
    """Largest deflection of two equal elastic spheres that meet at a speed, over their diameter.

    δ = (15 m* v²/(16 E* √a*))^⅖ with m* = m/2, a* = a/2 and E* = E/(2(1−ν²)) (K. L. Johnson,
    Contact Mechanics (1985), eq. 11.23); with m = 4π a³ρ/3 the radius cancels. Relative speed v
    [m/s], density ρ [kg/m³], Young's modulus E [Pa], Poisson's ratio ν.
    """
    ratio = density * speed * speed / contact_modulus(young, poisson, young, poisson)
    return float(0.5 * (5.0 * math.pi * math.sqrt(2.0) / 8.0 * ratio) ** 0.4)


def _under_load(run: Prepared) -> Iterator[Measured]:
    if run.cost.deflection is not None:
        yield Measured(run.cost.deflection)


def _in_impacts(run: Prepared) -> Iterator[Measured]:
    stages = zip(run.plan.stages, run.drives, strict=True)
    speed = max(
        largest_speed(run.scenario, run.model, drives, largest_gravity(stage, run.model))
        for stage, drives in stages
    )
    for name, table in run.scenario.materials.items():
        if table.young is not None and table.poisson is not None and speed > 0.0:
            deflection = impact_deflection(speed, table.density, table.young, table.poisson)
            yield Measured(deflection, f"{name} at {speed:.3g} m/s")


def _predicted_biot(run: Prepared) -> Iterator[Measured]:
    """Bi = 2 λ a_c/(λ a) between equal grains; radius of contact a_c = a √(δ/2a) (Hertz)."""
    heat, deflection = run.scenario.heat, run.cost.deflection
    if heat is None or heat.conduction != "hertz" or deflection is None:
        return
    if not isinstance(heat.force, PrescribedForce):
        yield Measured(2.0 * math.sqrt(deflection))


_STIFFER = (
    "Lower loads or speeds, or read results as those of rigid grains; a soft-particle program "
    "computes soft ones."
)
_ONE_TEMPERATURE = (
    "Biot number of the contacts, H/(λ a): the resistance inside a grain over that of a contact. "
    "A grain has one temperature here, which is questionable above 0.1 and wrong above 1."
)
_LOWER_BIOT = (
    "Read temperatures as means over grains; benchmarks/lattice14 measures the error. Sides that "
    'lie on each other conduct far more than points: real ones are rough (conduction = "rough").'
)

RIGIDITY_BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule(
        "deflection", _under_load,
        _RIGID + " Predicted from the weight of the grains and the loads.", _STIFFER,
        unit="of a diameter", warning=_SOFT, bad=_TOO_SOFT,
    ),
    Rule(
        "deflection in impacts", _in_impacts,
        ("As deflection, in an elastic impact at the largest of the speed of a free fall through "
            "the domain, those of grains at the start or at their release, and those of walls. It "
            "lasts for the time of an impact only."), _STIFFER,
        unit="of a diameter", warning=_TOO_SOFT, bad=5.0 * _TOO_SOFT,
    ),
    Rule(
        "Biot number", _predicted_biot,
        _ONE_TEMPERATURE + " Predicted from the weight of the grains and the loads.", _LOWER_BIOT,
        warning=_BIOT, bad=1.0,
    ),
)  # fmt: skip

RIGIDITY_OF_RUN: tuple[Rule[Recorded], ...] = (
    Rule(
        "Hertz deflection", lambda run: run.summary("hertz_deflection"),
        _RIGID + " Of the largest contact force so far, which is an impulse over the time step.",
        _STIFFER + (" If a single impact made it, which is far from the mean forces, it is no "
            "more than that."),
        unit="of a diameter", warning=_SOFT, bad=_TOO_SOFT,
    ),
    Rule(
        "largest Biot number", lambda run: run.summary("heat", "max_biot"), _ONE_TEMPERATURE,
        _LOWER_BIOT, warning=_BIOT, bad=1.0,
    ),
)  # fmt: skip


# ---- Values allowed but seldom meant: units other than SI, a sign, temperatures of no solid

_HOTTEST_SOLID = 4300.0
"""Temperature that no known solid bears [K]: mixed carbides and nitrides of hafnium melt near it
(Q.-J. Hong & A. van de Walle, Phys. Rev. B 92, 2015, 020104)."""

_SI = "All numbers of a scenario are in SI units."


def _of_materials(run: Prepared, key: str) -> Iterator[Measured]:
    for name, table in run.scenario.materials.items():
        if getattr(table, key) is not None:
            yield Measured(getattr(table, key), name)


def _gas(run: Prepared) -> Iterator[Measured]:
    heat = run.scenario.heat
    if heat is not None and heat.gas is not None:
        yield Measured(heat.gas.conductivity)


def _diameters(run: Prepared) -> Iterator[Measured]:
    grains = run.model.grains
    for index, name in enumerate(run.model.groups):
        radius = grains.radius[grains.group == index]
        for value in {float(radius.min()), float(radius.max())} if radius.size else ():
            yield Measured(2.0 * value, name)


def _friction(run: Prepared) -> Iterator[Measured]:
    for name, laws in run.laws:
        values = np.concatenate([laws.friction.ravel(), laws.table_friction])
        values = values[np.isfinite(values)]
        if values.size:
            yield Measured(float(values.max()), name)


def _temperatures(run: Prepared) -> Iterator[Measured]:
    heat, thermal = run.scenario.heat, run.model.thermal
    if heat is None or thermal is None:
        return
    yield Measured(float(run.state.temperature(thermal).min()), "coldest grain")
    for name, wall, _, stage in _wall_conditions(run):
        coldest = wall.signal.largest() - wall.signal.swing()
        yield Measured(coldest, f"wall {name} in stage {stage}")
    if heat.ambient is not None:
        yield Measured(heat.ambient.temperature, "fluid")
    if heat.radiation is not None and heat.radiation.surroundings is not None:
        yield Measured(heat.radiation.surroundings, "surroundings")


def _wall_conditions(run: Prepared) -> Iterator[tuple[str, WallHeat, int, str]]:
    """Walls of prescribed temperature: name, condition and index, and the stage's name."""
    starts = [0.0] * len(run.plan.stages)
    for stage in run.plan.stages:
        conditions = [] if stage.heat is None else stage.heat.started(starts)
        for w, (name, wall) in enumerate(zip(run.model.walls.names, conditions, strict=False)):
            if wall.kind == "temperature":
                yield name, wall, w, stage.name


def _melting(scenario: Scenario, model: Model) -> Floats:
    """Temperature that each material bears [K], shape ``(k,)``."""
    tables = (scenario.materials[name] for name in model.materials)
    return np.array([table.melting or _HOTTEST_SOLID for table in tables])


def _of_grains(scenario: Scenario, model: Model, temperature: Floats) -> Iterator[Measured]:
    """The hottest grain of each material over what it bears; T of the grains [K], ``(n,)``."""
    for k, limit in enumerate(_melting(scenario, model)):
        of_it = temperature[model.grains.material == k]
        if of_it.size:
            about = f"{of_it.max():.5g} K, a grain of {model.materials[k]}"
            yield Measured(float(of_it.max() / limit), about)


def _hot(run: Prepared) -> Iterator[Measured]:
    heat, model, thermal = run.scenario.heat, run.model, run.model.thermal
    if heat is None or thermal is None:
        return
    yield from _of_grains(run.scenario, model, run.state.temperature(thermal))
    shapes, melting = model.shapes, _melting(run.scenario, model)
    bears = [
        float(melting[shapes.material[shapes.wall == w]].min(initial=_HOTTEST_SOLID))
        for w in range(model.wall_count)
    ]
    for name, wall, w, stage in _wall_conditions(run):
        hottest = wall.signal.largest()
        yield Measured(hottest / bears[w], f"{hottest:.5g} K, wall {name} in stage {stage}")


def _temperature_reached(run: Recorded) -> Iterator[Measured]:
    """The hottest grain so far, over what the hardiest material bears; then each material now."""
    model = run.run.model
    if not run.has_steps or model.thermal is None or run.planned is None:
        return
    scenario, last = run.planned[0], run.info["heat"]["temperature"]["max"]
    hottest = float(run.series("temperature_max").max(initial=last))
    bears = float(_melting(scenario, model)[model.grains.material].max(initial=0.0))
    if bears > 0.0:
        yield Measured(hottest / bears, f"{hottest:.5g} K, the hottest grain so far")
    for frame in run.run.frames[-1:]:
        # of the grains that are there
        yield from _of_grains(scenario, frame.model, np.asarray(frame.temperature, np.float64))


def _hottest_spot(run: Recorded) -> Iterator[Measured]:
    """The hottest spot so far, over what the material that bears least does, if one says so."""
    if run.run.model.thermal is None or run.planned is None or "hottest_spot" not in run.run.series:
        return
    used = run.run.model.materials
    tables = [run.planned[0].materials[name] for name in used]
    limits = [
        (limit, name)
        for name, table in zip(used, tables, strict=True)
        for limit in (table.ignition, table.melting)
        if limit is not None
    ]
    hottest = float(run.series("hottest_spot").max(initial=0.0))
    if limits and hottest > 0.0:
        limit, name = min(limits)
        yield Measured(hottest / limit, f"{hottest:.5g} K; {name} bears {limit:g} K")


def _upward_gravity(run: Prepared) -> Iterator[Measured]:
    yield Measured(max(0.0, run.scenario.domain.gravity[1]))
    for stage, gravity in zip(run.plan.stages, run.gravity, strict=True):
        yield Measured(max(0.0, float(gravity[1])), f"stage {stage.name}")


_MELTS = (
    "Temperatures over the melting of the materials, or over 4,300 K, which no known solid bears, "
    "where none is given. Grains are solids here: neither do they melt, nor do their properties "
    "depend on temperature."
)

PLAUSIBLE_BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule(
        "density", lambda run: _of_materials(run, "density"), unit="kg/m³",
        least=50.0, warning=25_000.0,
        meaning="Solids that flow as grains have densities from 50 (foams) to 23,000 (osmium) "
            f"kg/m³. {_SI}",
        remedy="Give density in kg/m³: 2.5 g/cm³ is 2500.",
    ),
    Rule(
        "Young's modulus", lambda run: _of_materials(run, "young"), unit="Pa", least=1e5,
        meaning=f"Softer than gels, whose grains are not rigid under any load. {_SI}",
        remedy="Give young in Pa: 70 GPa is 70e9.",
    ),
    Rule(
        "gas conductivity", _gas, unit="W/(m K)", least=1e-3, warning=1.0,
        meaning="Gases conduct from 0.005 (xenon) to 0.5 W/(m K) (hot hydrogen), water 0.6. "
            f"{_SI}",
        remedy="Give conductivity of [heat] gas in W/(m K): 26 mW/(m K) is 0.026.",
    ),
    Rule(
        "grain diameter", _diameters, unit="m", least=1e-6, warning=1.0,
        meaning="Larger bodies are hardly grains; smaller ones are ruled by adhesion and the "
            f"fluid, which this program leaves out. {_SI}",
        remedy="Give radii in meters: 0.5 mm is 0.5e-3.",
    ),
    Rule(
        "friction coefficient", _friction, warning=2.0,
        meaning="Dry solids have coefficients of friction below 1, rubber up to 2.",
        remedy="Check friction: is it an angle in degrees? Its tangent is the coefficient.",
    ),
    Rule(
        "lowest temperature", _temperatures, unit="K", least=100.0,
        meaning="Temperatures are absolute. What is below 100 K was probably meant in °C.",
        remedy="Add 273.15 to temperatures in °C.",
    ),
    Rule(
        "highest temperature", _hot, _MELTS,
        "Check temperatures and their units; give melting for other materials.",
        unit="of what it bears", warning=1.0, bad=1.0,
    ),
    Rule(
        "upward gravity", _upward_gravity, unit="m/s²", warning=0.0,
        meaning="gravity is an acceleration: with a positive second component grains fall upwards.",
        remedy="Give gravity = [0.0, -9.81].",
    ),
)  # fmt: skip

PLAUSIBLE_OF_RUN: tuple[Rule[Recorded], ...] = (
    Rule(
        "highest temperature reached", _temperature_reached, _MELTS,
        ("Check what heats the grains: flows of walls [W, not W/m²] and their duration, rates of "
            "shear under high loads."),
        unit="of what it bears", warning=1.0, bad=1.0,
    ),
    Rule(
        "hottest spot", _hottest_spot,
        ("Temperature of the hottest contact spot so far, with the flash of its friction, over the "
            "lowest ignition or melting of the materials. Spots that melt are slippery, which a "
            "constant coefficient of friction does not know; what ignites does so at a spot."),
        ("Post hot-spots shows how many contacts are as hot; give such pairs friction that "
            "weakens by flash heating."),
        unit="of what it bears", warning=1.0,
    ),
)  # fmt: skip


# ---- Whether numbers of the flow stand out of the rounding of larger ones, to which they are added

_DOUBLE, _SINGLE = float(np.finfo(np.float64).eps), float(np.finfo(np.float32).eps)


def _of_places(run: Prepared, epsilon: float) -> Iterator[Measured]:
    """Of the farthest grain or wall."""
    places = (run.state.position[:, :2], run.state.wall_position[:, :2])
    largest = (float(np.abs(place).max(initial=0.0)) for place in places)
    far = max([run.model.period, *largest])
    smallest = float(run.model.grains.radius.min())
    yield Measured(epsilon * far / smallest, f"places up to {far:.3g} m")


def _round_off(run: Prepared) -> Iterator[Measured]:
    """Of places; and ε F Δt²/M, of the way of a load's wall before grains hold it."""
    yield from _of_places(run, _DOUBLE)
    walls, smallest = run.model.walls, float(run.model.grains.radius.min())
    for stage, drives in zip(run.plan.stages, run.drives, strict=True):
        times = moments_of(stage)
        for w, drive in enumerate(drives):
            for dof, mass, lever in (
                (drive.x, walls.mass[w], 1.0),
                (drive.y, walls.mass[w], 1.0),
                (drive.spin, walls.inertia[w], walls.length[w]),
            ):
                load = _largest_load(dof, float(walls.length[w]), times)
                if load > 0.0:
                    inertia = float(mass) + 0.5 * stage.dt * dof.damping
                    way = load * stage.dt * stage.dt / inertia * float(lever)
                    about = f"load of wall {walls.names[w]} in stage {stage.name}"
                    yield Measured(_DOUBLE * way / smallest, about)


def _largest_load(dof: DofDrive, length: float, times: list[float]) -> float:
    """Largest force [N] or torque [N m] at some times; 0 where a motion is prescribed."""
    return math.fsum(
        factor * max(abs(load.value(t)) for t in times)
        for load, factor in ((dof.force, 1.0), (dof.stress, length))
        if load is not None
    )


def _stored(run: Prepared) -> Iterator[Measured]:
    if run.scenario.output.precision == "single":
        yield from _of_places(run, _SINGLE)


ROUNDING: tuple[Rule[Prepared], ...] = (
    Rule(
        "round-off", _round_off, unit="of the smallest radius", warning=1e-7, bad=5e-4,
        meaning="What rounding leaves open of the places of grains and walls: 2·10⁻¹⁶ of their "
            "coordinates, and of the way on which a load would send its wall in a step, if no "
            "grain held it.",
        remedy="Put the domain near the origin; give the wall a mass not far below that of the "
            "grains under it, or a shorter dt.",
    ),
    Rule(
        "stored places", _stored, unit="of the smallest radius", warning=1e-2, bad=0.1,
        meaning='What rounding to numbers of seven digits (precision = "single") leaves open of '
            'the places in the files.',
        remedy='Use precision = "double", or put the domain near the origin.',
    ),
)  # fmt: skip


# ---- Whether a run fits on the machine


def _share(needed: float | None, free: int | None) -> Iterator[Measured]:
    if needed is not None and free is not None:
        yield Measured(needed / max(free, 1), f"{format_bytes(needed)} of {format_bytes(free)}")


COST: tuple[Rule[Prepared], ...] = (
    Rule(
        "disk", lambda run: _share(run.cost.disk_peak, free_space(run.directory)[1]),
        unit="of the free space", warning=0.5, bad=1.0,
        meaning="Largest size of the run directory, while results.h5 is made, over the free "
            "space where it will lie.",
        remedy='Write fewer frames (output.frame_interval), leave contacts out, use precision = '
            '"single", or free some space.',
    ),
    Rule(
        "memory", lambda run: _share(run.cost.memory, available_memory()),
        unit="of the free memory", warning=0.7, bad=1.0,
        meaning="Memory that the run will use over what is free now.",
        remedy="Use fewer grains, or a machine with more memory.",
    ),
)  # fmt: skip
