"""Grains that are no discs expand and wear: closed forms, books, the bits of discs, stops."""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import at_temperature, coupled_engine, make_heat_laws, with_heat
from scene_parts import FLOOR, TIGHT, G, book, continued, floor_and_lid, make_model
from shapes import POINT, box, disc, on_slope, outlines_of, regular, rod, shaped_model

from multicor_cli.engine import Settings
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.radiation import Radiation
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model import ShapeKind

ALPHA, THICKNESS = 1e-3, 0.5


def growing(model, alpha=ALPHA, *, sheds=False, start=300.0):
    """The model as prisms whose outlines follow temperatures, and wear."""
    model = with_heat(model, start, thickness=THICKNESS)
    return replace(model, expansion=np.array([alpha]), sheds=sheds)


def warmed(engine, rate, steps, dt=1e-3):
    """Steps in which all grains warm at a rate [K/s]."""
    for _ in range(steps):
        engine.state.heat += engine.model.thermal.capacity * (rate * dt)
        engine.step(dt, engine.state.time)
    return engine.state


BAR = box(2.0, 0.4) + np.array([0.0, 0.3])
STACKS = {
    "boxes": ([(box(2.0, 1.0), 0.0)], 0.5),
    "rounded boxes": ([(box(1.0, 0.4), 0.3)], 0.5),
    "clumps": ([(BAR, 0.0), (box(0.4, 0.8), 0.0), (-BAR, 0.0)], 0.5),
}


@pytest.mark.parametrize("name", STACKS)
def test_a_stack_lifts_its_load_and_lets_it_down(name):
    """Three grains grow by 3·2h α ΔT between their lowest and highest sides, and do the work of
    their load and weight; as they cool they take it back."""
    grain, half = STACKS[name]
    model = shaped_model([grain] * 3, floor_and_lid(), ("floor", "lid"), mass=1.0, friction=0.3)
    # What is asked of the solver below 10⁻¹² of a step's velocities is rounding: 10⁵ sweeps for it
    # leave as much of their own in the books
    sharp = Settings(tolerance_rms=1e-10, tolerance_max=1e-8, tolerance_energy=1e-8)
    engine = coupled_engine(
        growing(model), [[0.0, half + k] for k in range(3)], conduction="none", friction="none",
        solver=sharp, drives=[WallDrive(), WallDrive(y=DofDrive(force=Constant(-20.0)))],
    )  # fmt: skip
    engine.state.wall_position[1, 1] = 3.0
    engine.begin(engine.orders)
    state = warmed(engine, 10.0, 200)
    warmed(engine, 0.0, 100)
    grown = 6.0 * half * ALPHA * 2.0
    assert state.wall_position[1, 1] - 3.0 == pytest.approx(grown, rel=1e-9)
    weight = float(model.grains.mass[0]) * G
    lifted = 20.0 * grown + weight * grown * (1.0 + 3.0 + 5.0) / 6.0
    lost = book(state, "impact_loss")
    assert state.growth_books[0] == pytest.approx(lifted + lost, rel=1e-8)
    assert 0.0 < lost < 0.05 * lifted
    warmed(engine, -10.0, 200)
    warmed(engine, 0.0, 100)
    assert state.wall_position[1, 1] - 3.0 == pytest.approx(0.0, abs=1e-8)
    assert book(state, "closure") < 1e-14


def test_spins_keep_their_angular_momentum():
    """ω a² stays; the kinetic energy is ½ I ω² with the inertia of the larger outline."""
    model = growing(shaped_model([[(rod(2.0), 0.2)]], (), (), gravity=(0.0, 0.0)), 1e-2)
    engine = coupled_engine(model, [[0.0, 0.0]], [[0.0, 0.0, 3.0]], conduction="none")
    state = warmed(engine, 5.0, 200)
    ratio = state.radius[0] / model.grains.radius[0]
    assert ratio == pytest.approx(1.01, rel=1e-12)
    assert state.velocity[0, 2] * ratio**2 == pytest.approx(3.0, rel=1e-13)
    energy = 0.5 * model.grains.inertia[0] * ratio**2 * state.velocity[0, 2] ** 2
    assert book(state, "kinetic") == pytest.approx(energy, rel=1e-12)
    assert book(state, "closure") < 1e-12


def test_outlines_keep_their_shapes():
    """Corners, roundings and what heat knows of them are those of the scaled model."""
    grains = [[(regular(5), 0.1)], [(box(1.0, 0.2), 0.05), (box(0.2, 1.0), 0.05)], disc(0.7)]
    model = growing(shaped_model(grains, (), (), gravity=(0.0, 0.0)), 1e-2)
    engine = coupled_engine(model, [[0.0, 0.0], [3.0, 0.0], [6.0, 0.0]], laws=make_heat_laws())
    state = warmed(engine, 20.0, 100)
    factor = state.radius / model.grains.radius
    assert factor == pytest.approx(np.full(3, (1.0 + 1e-4) ** 100), rel=1e-12)
    other = coupled_engine(
        model.with_radius(state.radius, np.zeros(3)), state.position[:, :2], laws=make_heat_laws()
    )
    (grown, corners, hulls), (pieces, known, around) = (
        each._heat._outlined for each in (engine, other)
    )
    for found, expected in (
        (grown.corner, pieces.corner), (grown.rounding, pieces.rounding),
        (grown.spin, pieces.spin), (hulls.corner, around.corner),
    ):  # fmt: skip
        assert found == pytest.approx(expected, rel=1e-13, abs=1e-15)
    engine._heat._lasting_of(engine._heat._resting_scene(), *np.zeros((2, 0), np.int32))
    corners = engine._heat._outlined.corners
    assert corners.radius == pytest.approx(known.radius, rel=1e-13)
    assert corners.least == pytest.approx(known.least, rel=1e-13)


def test_wear_takes_mass_and_size_and_keeps_the_shape():
    """A block that slides down: V = (K/H) μ⁻¹ of its work, sides and height by (1 − V/V₀)^½."""
    wears, tangent = 1e-3, 0.6
    gravity = on_slope(tangent)
    model = shaped_model([[(box(2.0, 1.0), 0.1)]], FLOOR, ("floor",), gravity=gravity, friction=0.4)
    model = growing(model, 0.0, sheds=True)
    engine = coupled_engine(
        model, [[0.0, 0.6]], laws=make_heat_laws(wear=wears), conduction="none", solver=TIGHT
    )
    state = warmed(engine, 0.0, 300)
    volume = THICKNESS * float(model.area[0])
    share = state.wear[0] / volume
    rubbed = -float(model.grains.mass[0]) * gravity[1] * state.position[0, 0]
    assert state.wear[0] == pytest.approx(wears * rubbed, rel=2.0 * share + 1e-3)
    assert 1e-4 < share < 1e-2
    factor = np.sqrt(1.0 - share)
    assert state.radius[0] == pytest.approx(factor * model.grains.radius[0], rel=1e-12)
    assert state.position[0, 1] == pytest.approx(0.6 * factor, abs=2e-5)
    now = engine.mechanics.layout.model
    assert now.grains.mass[0] == pytest.approx((1.0 - share) * model.grains.mass[0], rel=1e-13)
    assert now.spin_radius[0] == pytest.approx(factor * model.spin_radius[0], rel=1e-12)
    assert book(state, "closure") < 1e-12


def test_what_turns_sheds_its_energy():
    """Of a cross that rubs while it spins in place between two walls."""
    cross = [(rod(2.0), 0.2), (rod(2.0)[:, ::-1], 0.2)]
    model = growing(shaped_model([cross], FLOOR, ("floor",), friction=0.3), 0.0, sheds=True)
    engine = coupled_engine(
        model, [[0.0, 1.0 / np.sqrt(2.0) + 0.2, 0.25 * np.pi][:2]], [[0.0, 0.0, 2.0]],
        laws=make_heat_laws(wear=1e-4), solver=TIGHT,
    )  # fmt: skip
    engine.state.position[0, 2] = 0.25 * np.pi
    engine.begin(engine.orders)
    state = warmed(engine, 0.0, 200)
    assert state.wear[0] > 0.0
    assert state.growth_books[1] > 0.0
    grains, now = engine.mechanics.layout.model.grains, engine.mechanics.layout.model
    v, u, spin = state.velocity[0]
    inertia = grains.mass[0] * now.spin_radius[0] ** 2 / 2.0
    energy = 0.5 * grains.mass[0] * (u * u + v * v) + 0.5 * inertia * spin * spin
    assert book(state, "kinetic") == pytest.approx(energy, rel=1e-11)
    assert book(state, "closure") < 1e-12


def test_discs_by_their_outlines_have_the_bits_of_discs():
    radius = np.array([0.5, 0.4, 0.5, 0.45])
    model = make_model(radius, FLOOR, friction=0.4)
    outlines, _, _ = outlines_of([[(POINT, a)] for a in radius])
    outlines = outlines._replace(area=model.area)
    places = [[0.0, 0.5], [1.0, 0.4], [0.4, 1.35], [-0.95, 0.45]]
    digests = []
    for seen in (model, replace(model, outlines=outlines)):
        engine = coupled_engine(
            growing(seen, sheds=True), places, [[0.3, 0.0, 0.0]] * 4, [at_temperature(290.0)],
            laws=make_heat_laws(wear=1e-5, emissivity=0.8), solver=TIGHT,
            mechanisms=(Gas(0.03), Radiation(reach=0.4)), collisional=True,
        )  # fmt: skip
        state = warmed(engine, 5.0, 100)
        digests.append([
            getattr(state, name).tobytes()
            for name in ("position", "velocity", "radius", "heat", "wear", "heat_books")
        ])  # fmt: skip
    assert digests[0] == digests[1]


def heap():
    """Grains of all kinds that expand, wear, and exchange heat in every way."""
    rng = np.random.default_rng(3)
    cross = [(box(1.0, 0.2), 0.05), (box(0.2, 1.0), 0.05)]
    kinds = [
        disc(0.4), [(rod(0.8), 0.2)], [(regular(5, 0.4), 0.1)], [(regular(4, 0.5), 0.0)],
        [(regular(30, 0.4), 0.0)], cross,
    ]  # fmt: skip
    grains = [kinds[k % len(kinds)] for k in range(24)]
    shapes = [
        *FLOOR, (ShapeKind.PLANE, 1, (-4.0, 0.0, 1.0, 0.0)),
        (ShapeKind.PLANE, 2, (4.0, 0.0, -1.0, 0.0)),
    ]  # fmt: skip
    model = growing(
        shaped_model(grains, shapes, ("floor", "left", "right"), friction=0.4), sheds=True
    )
    start = rng.uniform(290.0, 400.0, 24)
    thermal = replace(model.thermal, initial_temperature=start, capacity=model.grains.mass)
    k = np.arange(24)
    places = np.column_stack([-2.8 + 1.4 * (k % 5), 1.0 + 1.4 * (k // 5)])
    push = WallDrive(x=DofDrive(velocity=Constant(0.2)))
    engine = coupled_engine(
        replace(model, thermal=thermal), places, None,
        [at_temperature(320.0), at_temperature(310.0), at_temperature(300.0)],
        drives=[WallDrive(), push, WallDrive()], solver=Settings(),
        laws=make_heat_laws(wear=1e-5, emissivity=0.8, conductivity=5.0),
        mechanisms=(Gas(0.03), Radiation(250.0, reach=0.4)), collisional=True,
        conduction="rough",
    )  # fmt: skip
    engine.state.position[:, 2] = rng.uniform(0.0, 6.0, 24)
    engine.begin(engine.orders)
    return engine


def test_a_heap_closes_its_books_and_goes_on_to_the_same_bits():
    one, two = heap(), heap()
    warmed(one, 5.0, 300, 2e-3)
    warmed(two, 5.0, 170, 2e-3)
    again = continued(two)
    warmed(again, 5.0, 130, 2e-3)
    assert again.state.digest() == one.state.digest()
    assert book(one.state, "closure") < 1e-12
    assert (one.state.wear > 0.0).any()
    assert (one.state.contact_point >= 0).any()


def test_who_is_worn_away_is_named():
    model = shaped_model([[(box(2.0, 1.0), 0.0)]], FLOOR, ("floor",), gravity=on_slope(0.6))
    engine = coupled_engine(
        growing(model, sheds=True), [[0.0, 0.5]], [[1.0, 0.0, 0.0]], laws=make_heat_laws(wear=100.0)
    )
    with pytest.raises(PhysicsError, match=r"grain 0 has lost .* by wear"):
        warmed(engine, 0.0, 90)
