"""Scenes with heat built by hand, shared by the verification tests."""

from dataclasses import replace

import numpy as np
from scene_parts import FLOOR, TIGHT, make_model

from multicor_cli.engine import Engine, Orders
from multicor_cli.engine.heat.settings import ContactForce, HeatSettings, heat_laws
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant
from multicor_cli.model import HEAT_BOOK_NAMES, State, Thermal


def make_heat_laws(*, density=7500.0, capacity=500.0, wear=0.0, **properties):
    """Laws of steel but for what is given; ``wear`` is Archard's over the hardness [1/Pa]."""
    steel = {"conductivity": 15.0, "young": 193e9, "poisson": 0.29, "emissivity": 0.0}
    rough = {"roughness": 1e-6, "asperity_slope": 0.1, "microhardness": 3e9}
    material = {"density": density, "heat_capacity": capacity, "hardness": 1.0}
    material |= {**steel, **properties, **rough}
    return heat_laws([material], "half", np.array([[wear]]))


def with_softening(laws, *values):
    """The laws with c [1/K], T_r [K], smallest and largest μ for every pair."""
    names = ("softening_rate", "softening_start", "softening_lowest", "softening_highest")
    return laws._replace(**dict(zip(names, values, strict=True)))


def with_flash(model, weakened, speed, limit=np.inf, reference=300.0):
    """The model with friction that weakens by flash heating, for every pair."""
    values = {"weakened": weakened, "speed": speed, "limit": limit, "reference": reference}
    shape = model.laws.friction.shape
    arrays = {f"flash_{name}": np.full(shape, value) for name, value in values.items()}
    return replace(model, laws=model.laws._replace(**arrays))


def with_heat(model, start=300.0, *, capacity=None, specific=500.0, thickness=None):
    """The model with heat capacities (default m c_p) and initial temperatures.

    Grains are spheres, or all of one thickness.
    """
    radius, mass = model.grains.radius, model.grains.mass
    c = np.full(radius.size, capacity, float) if capacity is not None else specific * mass
    start = np.broadcast_to(np.asarray(start, float), radius.shape).copy()
    surface = 4.0 * np.pi * radius**2 if thickness is None else thickness * model.perimeter
    return replace(model, thermal=Thermal(c, start, surface))


def warm_model(radius=(1.0,), start=300.0, shapes=(), *, capacity=None, **choices):
    """Spheres at ``start`` [K] on a floor, or on nothing."""
    walls = {"walls": ("floor",) if shapes else ()}
    model = make_model(radius, shapes, **{"shape": "sphere", **walls, **choices})
    return with_heat(model, start, capacity=capacity)


def coupled_engine(
    model,
    positions,
    velocities=None,
    conditions=None,
    *,
    laws=None,
    solver=TIGHT,
    drives=None,
    **settings,
):
    """Mechanics and heat together, both switched on."""
    state = State.at_rest(model, np.asarray(positions, float))
    if velocities is not None:
        state.velocity[:] = velocities
    heat = HeatSettings(laws or make_heat_laws(), **settings)
    engine = Engine(model, state, threads=1, heat=heat)
    engine.begin(Orders(drives, solver, conditions=conditions))
    return engine


def heat_engine(model, positions, *, conditions=None, laws=None, **settings):
    """Heat alone, of bodies that stand still."""
    state = State.at_rest(model, np.asarray(positions, float))
    return frozen_engine(model, state, conditions, laws, **settings)


def frozen_engine(model, state, conditions=None, laws=None, **settings):
    """Heat alone, in a state."""
    heat = HeatSettings(laws or make_heat_laws(), **settings)
    engine = Engine(model, state, threads=1, heat=heat)
    engine.resume(Orders(conditions=conditions, is_frozen=True))
    return engine


def touching_engine(
    positions,
    start,
    *,
    conditions=None,
    capacity=1.0,
    shapes=(),
    walls=(),
    period=0.0,
    radius=1.0,
    **settings,
):
    """A heat engine over bodies at rest that touch, with 1 W/K between grains.

    The prescribed force is chosen for it: H = 2 λ (3 F a*/4E*)^⅓ with a* = a/2.
    """
    radii = np.full(len(positions), radius)
    model = make_model(radii, shapes, walls, period=period, shape="sphere")
    model = with_heat(model, start, capacity=capacity)
    laws = make_heat_laws(emissivity=settings.pop("emissivity", 0.0))
    spot = 1.0 / (2.0 * 15.0)
    force = spot**3 * 4.0 * laws.modulus[0, 0] / (3.0 * 0.5 * radius)
    given = {"laws": laws, "force": ContactForce("prescribed", force)}
    return heat_engine(model, positions, conditions=conditions, **given, **settings)


def on_floor(condition, start=300.0, positions=((0.0, 1.0),), **settings):
    """A heat engine over grains on a floor; between it and a grain H is 2^⅓ W/K, as a* = a."""
    return touching_engine(
        positions, start, conditions=[condition], shapes=FLOOR, walls=("floor",), **settings
    )


def temperatures(engine):
    return engine.state.temperature(engine.model.thermal)


def advanced(engine, total, count=1):
    """Temperatures after so many steps [K]."""
    for k in range(count):
        engine.step(total / count, k * total / count)
    return temperatures(engine)


def chain(count, radius=1.0):
    return np.column_stack([np.arange(count) * 2.0 * radius, np.full(count, radius)])


def rows(counts, radius=1.0):
    """Rows of a triangular lattice, one after the other from the bottom, centered."""
    points = []
    for k, number in enumerate(counts):
        x = (np.arange(number) - 0.5 * (number - 1)) * 2.0 * radius
        points += [(value, k * np.sqrt(3.0) * radius) for value in x]
    return np.array(points)


def at_temperature(level):
    return WallHeat("temperature", Constant(level))


def heat_book(state, name):
    return state.heat_books[HEAT_BOOK_NAMES.index(name)]


def exact_temperatures(links, capacity, start, t):
    """exp(−C⁻¹ K t) T_0 for conductances of 1 W/K between the pairs ``links``."""
    n = len(start)
    k = np.zeros((n, n))
    for i, j in links:
        k[[i, j, i, j], [i, j, j, i]] += 1.0, 1.0, -1.0, -1.0
    root = np.sqrt(capacity)
    w, v = np.linalg.eigh(k / np.outer(root, root))
    return (v @ (np.exp(-w * t) * (v.T @ (root * start)))) / root
