"""Bodies among grains: free fall, collisions, sliding round a corner, shear between cylinders."""

import math

import numpy as np
import pytest
from scenarios import engine as engine_of
from scenarios import scenario
from scene_parts import TIGHT, advance, book, make_engine, make_model, resume, tally

from multicor_cli.engine import Settings
from multicor_cli.model import ShapeKind

POINTS = [[0.025, 0.045], [0.036, 0.045], [0.03, 0.056]]
DISCS = [[0.03, 0.05, 2e-3], [0.034, 0.05, 2e-3], [0.032, 0.053, 1.5e-3]]
BODIES = {
    "disc": {"kind": "disc", "center": [0.03, 0.05], "radius": 0.006},
    "polygon": {"kind": "polygon", "points": POINTS, "grains": "outside"},
    "cluster": {"kind": "cluster", "discs": DISCS},
}


def body_and_grain(name, place, motion=(0.0, 0.0, 0.0), settings=TIGHT, gravity=0.0, **said):
    """A body that is free to move, and a grain of radius 1 mm."""
    free = {dof: {"force": 0.0} for dof in ("x", "y", "spin")}
    walls = {"body": {"geometry": BODIES[name], "gravity": gravity != 0.0}}
    grains, gravity = [[*place, 1e-3, *motion]], [0.0, gravity]
    said |= {"walls": walls, "drives": {"body": free}, "gravity": gravity}
    engine, model = engine_of(scenario(grains=grains, **said))
    resume(engine, settings=settings)
    return engine, model, engine.state


@pytest.mark.parametrize("name", BODIES)
def test_a_free_body_falls_as_everything_does(name):
    """x = x₀ − g t²/2, exactly in this scheme; its own mass is in the books."""
    engine, model, state = body_and_grain(name, (0.005, 0.005), gravity=-9.81)
    start = state.wall_position[0].copy()
    advance(engine, 1e-3, 50)
    assert state.wall_position[0] - start == pytest.approx(
        [0.0, -0.5 * 9.81 * 0.05**2, 0.0], rel=1e-12, abs=1e-15
    )
    mass = float(model.walls.mass[0]) + float(model.grains.mass[0])
    work = mass * 9.81 * 0.5 * 9.81 * 0.05**2
    assert book(state, "gravity_work") == pytest.approx(work, rel=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_a_collision_conserves_momentum_and_without_losses_energy(name):
    """μ = 0, e = 1: an impulse through the grain's center keeps p, L about any point and E."""
    engine, model, state = body_and_grain(
        name, (0.012, 0.0462), motion=(0.4, 0.05, 3.0), friction=0.0, restitution=1.0
    )
    state.wall_velocity[0] = -0.1, -0.02, 4.0
    before = _invariants(model, state)
    advance(engine, 1e-4, 600)
    assert abs(state.velocity[0, 0] - 0.4) > 0.05  # they have met
    assert abs(state.wall_velocity[0, 0] + 0.1) > 1e-3
    for now, then, scale in zip(_invariants(model, state), before, _scales(model), strict=True):
        assert now == pytest.approx(then, abs=1e-9 * scale)


@pytest.mark.parametrize("name", BODIES)
def test_friction_keeps_the_momentum_and_takes_energy(name):
    engine, model, state = body_and_grain(
        name, (0.012, 0.0462), motion=(0.4, 0.05, 300.0), settings=Settings()
    )
    before = _invariants(model, state)
    advance(engine, 1e-4, 600)
    after = _invariants(model, state)
    assert after[:2] == pytest.approx(before[:2], abs=1e-9 * _scales(model)[0])
    assert after[3] < before[3]
    assert book(state, "closure") < 1e-9


def _invariants(model, state):
    """Momentum [N s], angular momentum about the origin [N m s], energy [J] of grain and body."""
    m, M = float(model.grains.mass[0]), float(model.walls.mass[0])
    inertia, J = float(model.grains.inertia[0]), float(model.walls.inertia[0])
    (x, y, _), (vx, vy, w) = state.position[0].tolist(), state.velocity[0].tolist()
    (X, Y, _), (VX, VY, W) = state.wall_position[0].tolist(), state.wall_velocity[0].tolist()
    turning = m * (x * vy - y * vx) + inertia * w + M * (X * VY - Y * VX) + J * W
    energy = 0.5 * (m * (vx**2 + vy**2) + inertia * w**2 + M * (VX**2 + VY**2) + J * W**2)
    return m * vx + M * VX, m * vy + M * VY, turning, energy


def _scales(model):
    p = 0.4 * float(model.grains.mass[0])
    return p, p, 0.06 * p, 0.4 * p


BLOCK = np.array([[0.0, 0.0], [-4.0, 0.0], [-4.0, -3.0], [0.0, -3.0]])


def block():
    """A solid block below y = 0, with a corner at the origin."""
    sides = [(ShapeKind.SIDE, 0, (*BLOCK[k], *BLOCK[(k + 1) % 4])) for k in range(4)]
    return sides + [
        (ShapeKind.VERTEX, 0, (*BLOCK[k], float((k - 1) % 4), float(k))) for k in range(4)
    ]


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_grain_slides_around_a_corner_until_it_lifts_off(speed):
    """Without friction it circles the corner at radius a and leaves at cos θ = (2 + v²/(g a))/3."""
    a, g = 0.5, 9.81
    dt = 2e-3 * math.sqrt(a / g)
    engine = make_engine(
        make_model([a], block(), friction=0.0), [[-0.05, a]], [[speed, 0.0, 0.0]], settings=TIGHT
    )
    state, cosine = engine.state, 1.0
    energies, made = slide_over(engine, dt, a, g)
    for x, y, is_touching in energies[:, 1:]:
        cosine = y / math.hypot(x, y) if is_touching and x > 0.0 else cosine
    assert cosine == pytest.approx((2.0 + speed**2 / (g * a)) / 3.0, abs=0.01)
    assert (energies[:, 0] <= energies[0, 0] + made).all()
    # Hardly any is lost: the steps are short
    assert energies[-1, 0] >= energies[0, 0] - 0.02 * g * a
    assert book(state, "closure") < 1e-9


def test_a_grain_rolls_around_a_corner_and_makes_no_energy():
    """With friction it may be lost, and the books close."""
    a, g = 0.5, 9.81
    engine = make_engine(
        make_model([a], block(), friction=0.8), [[-0.05, a]], [[0.5, 0.0, -1.0]], settings=TIGHT
    )
    energies, made = slide_over(engine, 1e-3, a, g)
    assert (energies[:, 0] <= energies[0, 0] + made).all()
    assert energies[-1, 2] < -1.0  # it has gone over
    assert tally(engine.state, "max_overlap") < 1e-3
    assert book(engine.state, "closure") < 1e-9


def slide_over(engine, dt, a, g):
    """Energy per mass, place and touch after each step until it has fallen, and the energy allowed.

    Where the normal turns by v Δt/(2a) between the start and the middle of a step, an impulse m g
    Δt works on v² Δt/(2a): a gain of first order. Twice of that is allowed.
    """
    state, rows, made = engine.state, [], [0.0]
    while state.position[0, 1] > -1.2:
        engine.step(dt, 0.0)
        (x, y, _), (vx, vy, spin) = state.position[0].tolist(), state.velocity[0].tolist()
        energy = 0.5 * (vx**2 + vy**2) + 0.25 * (a * spin) ** 2 + g * y
        rows.append((energy, x, y, float(state.contact_impulse[:, 0].sum() > 0.0)))
        made.append(made[-1] + g * dt * (vx**2 + vy**2) * dt / (2.0 * a))
    return np.array(rows), np.array(made[1:])


def test_a_rough_cylinder_shears_the_grains_around_it(run):
    """Angular momentum of the inner cylinder goes to grains and the outer one; its work is all."""
    annulus = scenario(
        size=[0.04, 0.04], gravity=[0, 0], duration=0.12,
        drives={"inner": {"spin": {"velocity": 10.0}}}, dt=2e-4,
        series_interval=0.002, seed=3,
        particles=[{
            "sizes": {"kind": "uniform", "min": 0.8e-3, "max": 1.2e-3}, "fill": 0.58,
            "packing": {"kind": "random"},
            "region": {"kind": "annulus", "center": [0.02, 0.02], "inner": 0.0072, "outer": 0.0188},
        }],
        walls={
            "inner": {"kind": "disc", "center": [0.02, 0.02], "radius": 0.006, "rough": "grains"},
            "outer": {"kind": "circle", "center": [0.02, 0.02], "radius": 0.02, "rough": "grains"},
        },
    )  # fmt: skip
    done = run(annulus)
    series, last, grains = done.series, done.frames[-1], done.model.grains
    torque = np.asarray(series["wall_force"])[:, :, 2]
    span = np.diff(np.asarray(series["time"]), prepend=0.0)
    given = span @ torque
    away, v = np.asarray(last.position)[:, :2] - 0.02, np.asarray(last.velocity)
    orbital = grains.mass * (away[:, 0] * v[:, 1] - away[:, 1] * v[:, 0])
    # The grains brake the inner cylinder, and pull the outer one along
    assert given[0] < 0.0 < given[1]
    exchanged = (span @ np.abs(torque)).sum()
    turning = (orbital + grains.inertia * last.spin).sum()
    assert turning == pytest.approx(-given.sum(), abs=0.01 * exchanged)
    names = "wall_work", "kinetic", "friction_loss", "impact_loss", "correction_work"
    work, *others = (series[name][-1] for name in names)
    assert sum(others) == pytest.approx(work, rel=1e-9)
    assert work == pytest.approx(-10.0 * given[0], rel=1e-9)
    distance = np.hypot(*away.T)
    assert 0.006 < distance.min() < distance.max() < 0.02
