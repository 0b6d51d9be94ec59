"""What carries heat between walls, and how far: links added up by hand, and the moment of heat."""

import numpy as np
import pytest
from heat_parts import at_temperature, make_heat_laws, temperatures, with_heat
from scene_parts import continued, make_model

from multicor_cli.engine import Engine, Orders
from multicor_cli.engine.heat.gas import CORE, Gas, parallel_conductance, parallel_conductance_wall
from multicor_cli.engine.heat.radiation import (
    STEFAN_BOLTZMANN,
    Radiation,
    cylinder_view_factor,
    emission_factor,
)
from multicor_cli.engine.heat.settings import ContactForce, HeatSettings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import Constant
from multicor_cli.model import ShapeKind, State
from multicor_cli.model.columns import GIVEN
from multicor_cli.post.conductivity import WAYS

GAP, RADIUS, GAS, EMISSIVITY = 0.1, 0.5, 0.03, 0.8
LAWS = make_heat_laws(emissivity=EMISSIVITY)
ONE = ContactForce("prescribed", (1.0 / 30.0) ** 3 * 4.0 * LAWS.modulus[0, 0] / (3.0 * 0.25))
"""Makes H = 1 W/K of two of the discs."""
FLOOR, LID, LEFT, RIGHT = range(4)
KINDS = {
    "temperature": at_temperature(350.0),
    "flow": WallHeat("flow", Constant(3.0)),
    "capacity": WallHeat("capacity", capacity=5.0, initial=350.0),
}


def box(width, height):
    """Planes of a box from (0, 0) on."""
    sides = ((0.0, 0.0, 0.0, 1.0), (0.0, height, 0.0, -1.0), (0.0, 0.0, 1.0, 0.0),
             (width, 0.0, -1.0, 0.0))  # fmt: skip
    return [(ShapeKind.PLANE, wall, side) for wall, side in enumerate(sides)]


def engine_of(
    position, start, size, conditions, velocity=None, *, restitution=0.0, **settings
):  # fmt: skip
    """Discs of 1 J/K at ``start`` [K] in a box; they stand still unless they have velocities."""
    n, names = len(position), ("floor", "lid", "left", "right")
    still = {"gravity": (0.0, 0.0), "restitution": restitution}
    model = make_model(np.full(n, RADIUS), box(*size), names, **still)
    model = with_heat(model, start, capacity=1.0, thickness=1.0)
    state = State.at_rest(model, np.asarray(position, float))
    if velocity is not None:
        state.velocity[:, :2] = velocity
    heat = HeatSettings(LAWS, friction="none", **settings)
    engine = Engine(model, state, threads=1, heat=heat)
    given = [conditions.get(wall, WallHeat()) for wall in range(4)]
    is_new = np.ones(4, bool)
    engine.begin(Orders(conditions=given, is_new=is_new, is_frozen=velocity is None))
    return engine


def moved(engine):
    """Heat times its way since the start [J m], by what carried it: along x and y."""
    return dict(zip(WAYS, engine.state.flux_books.reshape(2, 4).T, strict=True))


@pytest.mark.parametrize("axis", [0, 1])
def test_links_of_a_column_with_gaps_by_hand(axis):
    """Gas and radiation of three discs between two walls, gaps of a fifth of a radius: what each of
    the four links passes in a time in which nothing warms."""
    at = np.full((3, 2), 2.0)
    at[:, axis] = GAP + RADIUS + (2.0 * RADIUS + GAP) * np.arange(3)
    size = np.array([4.0, 4.0])
    size[axis] = 3 * 2.0 * RADIUS + 4 * GAP
    warm, dt = np.array([350.0, 341.0, 333.0, 312.0, 300.0]), 1e-6
    walls = (LEFT, RIGHT) if axis == 0 else (FLOOR, LID)
    conditions = dict(zip(walls, map(at_temperature, warm[[0, -1]].tolist()), strict=True))
    engine = engine_of(
        at, warm[1:-1], size, conditions, mechanisms=(Gas(GAS), Radiation(reach=0.4))
    )
    engine.step(dt, 0.0)
    core = RADIUS * min(CORE, GAS / 15.0)
    inside = parallel_conductance(GAS, RADIUS, RADIUS, core, GAP)
    wall = parallel_conductance_wall(GAS, RADIUS, core, GAP)
    view = 2.0 * np.pi * RADIUS * cylinder_view_factor(RADIUS, RADIUS, GAP)
    area = view * emission_factor(EMISSIVITY, EMISSIVITY)
    gas, radiation = 0.0, 0.0
    for k, h in enumerate((wall, inside, inside, wall)):
        # to a wall from the center of the disc
        branch = GAP + RADIUS * (1.0 if k in (0, 3) else 2.0)
        gas += h * (warm[k] - warm[k + 1]) * branch * dt
        radiation += STEFAN_BOLTZMANN * area * (warm[k] ** 4 - warm[k + 1] ** 4) * branch * dt
    found = moved(engine)
    assert found["gas"][axis] == pytest.approx(gas, rel=1e-6)
    assert found["radiation"][axis] == pytest.approx(radiation, rel=1e-6)
    assert not found["contacts"].any()
    assert not found["motion"].any()
    assert not any(found[way][1 - axis] for way in WAYS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axis", [0, 1])
def test_the_moment_of_heat_is_what_walls_give_and_what_passes(kind, axis):
    """Σ C T r of discs at rest, which contacts and gas warm from one wall and cool at another: its
    change is Σ φ ℓ and what the walls have given, where they are."""
    columns, rows = 4, 3
    k = np.arange(columns * rows)
    at = np.column_stack([k % columns, k // columns]) + RADIUS
    start = np.random.default_rng(4).uniform(300.0, 400.0, k.size)
    low, high = (LEFT, RIGHT) if axis == 0 else (FLOOR, LID)
    conditions = {low: KINDS[kind], high: at_temperature(310.0)}
    engine = engine_of(at, start, (columns, rows), conditions, force=ONE, mechanisms=(Gas(GAS),))
    engine.step(1e-6, 0.0)
    table, wall = engine.contacts(), engine.state.wall_temperature
    other = np.append(start, wall[engine.model.shapes.wall])[table.j]
    far = np.where(table.j < k.size, 2.0 * RADIUS, RADIUS)
    known = np.isfinite(other)  # what a wall of known flow gives goes through its contacts, too
    passed = (table.conductance * (other - start[table.i]) * far * table.normal[:, axis])[known]
    found, given = moved(engine)["contacts"][axis], engine.state.wall_heat[:, GIVEN]
    if kind == "flow":
        share = (table.conductance / (table.conductance + gas_at_walls()))[table.j == k.size + low]
        passed = np.append(passed, 3.0 * share.mean() * RADIUS)
    assert found == pytest.approx(1e-6 * passed.sum(), rel=1e-4)
    for step in range(4):
        engine.step(0.5, 1e-6 + 0.5 * step)
    change = (temperatures(engine) - start) @ at[:, axis]
    total = sum(moved(engine)[way][axis] for way in WAYS)
    assert change == pytest.approx(total + (columns, rows)[axis] * given[high], rel=1e-9)
    assert abs(given[low]) > 1.0
    other = continued(engine)
    for each in (engine, other):
        each.step(0.1, 3.0)
    assert engine.state.digest() == other.state.digest()


def gas_at_walls():
    """Conductance of the gas about a spot between a disc and a wall."""
    spot = np.cbrt(3.0 * ONE.value * RADIUS / (4.0 * LAWS.modulus[0, 0]))
    return parallel_conductance_wall(GAS, RADIUS, max(spot, RADIUS * min(CORE, GAS / 15.0)), 0.0)


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_grains_that_move_carry_their_heat(restitution):
    """Where nothing conducts: Σ C (T − ⟨T⟩) times the ways, also of discs that bounce off walls and
    each other."""
    random, n = np.random.default_rng(8), 12
    at = 2.0 * np.column_stack([np.arange(n) % 4, np.arange(n) // 4]) + 1.0
    start, velocity = random.uniform(300.0, 400.0, n), random.normal(0.0, 1.0, (n, 2))
    engine = engine_of(
        at, start, (8.0, 6.0), {}, velocity, conduction="none", restitution=restitution
    )
    for k in range(200):
        engine.step(0.02, 0.02 * k)
    ways = engine.state.position[:, :2] - at
    assert np.abs(ways).max() > 1.0
    np.testing.assert_allclose(moved(engine)["motion"], (start - start.mean()) @ ways, rtol=1e-9)
    assert not any(moved(engine)[way].any() for way in WAYS[:3])
