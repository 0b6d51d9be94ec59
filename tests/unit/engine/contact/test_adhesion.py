"""Adhesion against closed forms (theory §3.1): F_a adds to what Signorini and Coulomb allow while two bodies touch."""

import numpy as np
import pytest
from scene_parts import FLOOR, TIGHT, G, advance, book, make_engine, make_model, shear_engine, tally

from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.engine.motion.gravity import Gravity
from multicor_cli.model import ContactLaws, ShapeKind

CEILING = [(ShapeKind.PLANE, 0, (0.0, 1.0, 0.0, -1.0))]
SIDE = [(ShapeKind.PLANE, 0, (0.0, 0.0, 1.0, 0.0))]


def test_two_discs_come_apart_in_the_first_step_in_which_the_pull_exceeds_adhesion():
    """The upper disc sticks to the ceiling; the weight of the lower one rises by m δ per step and parts them at m g > F_a."""
    model = make_model([0.1, 0.15], CEILING, gravity=(0.0, 0.0))
    mass, rise, last = model.grains.mass[1], 0.1, 37
    object.__setattr__(model.grains, "material", np.array([0, 1], np.int32))
    object.__setattr__(model, "laws", _laws_of_two(strong=1e3 * mass, weak=(last + 0.5) * rise * mass))
    engine = make_engine(model, [[0.0, 0.9], [0.0, 0.65]], settings=TIGHT)
    for k in range(60):
        engine.set_gravity(Gravity.constant(np.array([0.0, -k * rise])))
        engine.step(1e-3, k * 1e-3)
        assert (abs(engine.state.velocity[1, 1]) < 1e-12) == (k <= last)
        assert abs(engine.state.velocity[0, 1]) < 1e-12


def _laws_of_two(strong: float, weak: float) -> ContactLaws:
    """The ceiling holds grains of its material strongly, grains of two materials hold each other weakly."""
    plain = make_model([1.0]).laws
    two = np.full((2, 2), 0.5)
    adhesion = np.array([[strong, weak], [weak, 0.0]])
    return plain._replace(friction=two, restitution=0.0 * two, table=np.full((2, 2), -1, np.int32), adhesion=adhesion)


@pytest.mark.parametrize("settings", [TIGHT, None])
@pytest.mark.parametrize(("factor", "hangs"), [(1.01, True), (0.99, False)])
def test_a_disc_hangs_from_a_ceiling_by_an_adhesion_above_its_weight(factor, hangs, settings):
    model = make_model([0.1], CEILING)
    weight, dt, steps = model.grains.mass[0] * G, 1e-3, 300
    held = make_model([0.1], CEILING, adhesion=factor * weight)
    engine = make_engine(held, [[0.0, 0.9]], settings=settings)
    state = advance(engine, dt, steps)
    if hangs:
        assert state.position[0, 1] == pytest.approx(0.9, abs=1e-12)
        assert engine.contacts().impulse[0] == pytest.approx([-weight * dt, 0.0], rel=1e-9)  # tension, by the sign of p_n
    else:  # F_a acts in the first step; then the contact is open
        assert state.velocity[0, 1] == pytest.approx(-G * dt * (steps - factor), rel=1e-9)
        assert book(state, "closure") < 1e-12


@pytest.mark.parametrize(("factor", "rolls"), [(1.01, True), (0.99, False)])
def test_adhesion_widens_the_cone_of_friction(factor, rolls):
    """A disc on an upright wall, p_n = 0: rolls down with g β/(1 + β) if μ F_a ≥ m g/(1 + β), slides with g − μ F_a/m below."""
    mass = make_model([0.1]).grains.mass[0]
    adhesion, friction = 7.0 * mass * G, factor / 21.0
    model = make_model([0.1], SIDE, friction=friction, adhesion=adhesion)
    state = advance(make_engine(model, [[0.1, 0.0]], settings=TIGHT), 1e-3, 100)
    expected = G * 2.0 / 3.0 if rolls else G - friction * adhesion / mass
    assert state.velocity[0, 1] == pytest.approx(-0.1 * expected, rel=1e-9)
    assert (abs(state.velocity[0, 1] - 0.1 * state.velocity[0, 2]) < 1e-10) == rolls
    assert book(state, "closure") < 1e-12


@pytest.mark.parametrize(("factor", "holds"), [(0.99, True), (1.01, False)])
def test_a_loaded_plate_is_held_up_to_its_adhesion(factor, holds):
    """A plate that a force pulls off a disc, which sticks to the floor: contacts of a body with a driven degree of freedom."""
    planes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.2, 0.0, -1.0))]
    model = make_model([0.1], planes, ("floor", "plate"), gravity=(0.0, 0.0), mass=0.5, adhesion=3.0)
    drives = [WallDrive(), WallDrive(y=DofDrive(force=Constant(factor * 3.0)))]
    engine = make_engine(model, [[0.0, 0.1]], settings=TIGHT, drives=drives)
    state = advance(engine, 1e-3, 50)
    assert (abs(state.wall_velocity[1, 1]) < 1e-12) == holds
    assert holds or book(state, "closure") < 1e-12  # at rest there is nothing but rounding to compare


def test_bodies_that_do_not_touch_do_not_attract_each_other():
    model = make_model([0.1, 0.1], gravity=(0.0, 0.0), walls=(), adhesion=5.0)
    state = advance(make_engine(model, [[0.0, 0.0], [0.2 + 1e-9, 0.0]]), 1e-3, 20)
    assert not state.velocity.any()


def test_touching_bodies_at_rest_stay_and_remember_their_contact():
    """Without weight or load: what is at rest together stays together, and is stretched by nothing."""
    model = make_model([0.1, 0.1], gravity=(0.0, 0.0), walls=(), adhesion=5.0)
    engine = make_engine(model, [[0.0, 0.0], [0.2, 0.0]])
    state = advance(engine, 1e-3, 50)
    assert np.abs(state.velocity).max() < 1e-12
    assert state.contact_impulse[0] == pytest.approx([5e-3, 0.0])  # F_a Δt on top of p = 0
    assert abs(engine.contacts().impulse[0, 0]) < 1e-12


def test_a_rebound_that_is_faster_than_adhesion_loses_speed_to_first_order_only():
    """The range is zero, so nothing is lost in the limit: e|u⁻| within F_a Δt/m for each Δt."""
    for dt in (1e-3, 1e-4):
        model = make_model([0.1], FLOOR, gravity=(0.0, 0.0), restitution=0.5, adhesion=2.0)
        state = advance(make_engine(model, [[0.0, 0.1005]], [[0.0, -2.0, 0.0]]), dt, 20)
        assert 0.0 <= 1.0 - state.velocity[0, 1] <= 2.0 * dt / model.grains.mass[0] + 1e-9


def test_work_of_adhesion_is_in_the_books_of_a_flow():
    """Plane shear with F_a ten times the load of a grain: tension exists, books close, and every step converges."""
    engine = shear_engine(adhesion=10.0)
    state = advance(engine, 0.02, 200)
    forces = engine.contacts().impulse[:, 0]
    assert forces.min() < 0.0 < forces.max()
    assert forces.min() >= -10.0 * 0.02 * (1.0 + 1e-12)
    assert book(state, "closure") < 1e-12
    assert tally(state, "unconverged_steps") == 0
