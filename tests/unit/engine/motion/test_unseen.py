"""Whatever lies on the first half step of a grain or a wall is met, not passed: closed forms with
steps of many diameters."""

import numpy as np
import pytest
from scene_parts import TIGHT, book, make_engine, make_model
from shaped_frames import box as plate
from shaped_frames import shaped_model

from multicor_cli.engine import PhysicsError
from multicor_cli.engine.motion.drives import DofDrive, Ramp, WallDrive
from multicor_cli.engine.motion.unseen import find_unseen
from multicor_cli.model import ShapeKind

R = 0.5
DT = 1e-3
WAYS = [0.5, 1.5, 5.0, 50.0]
"""Diameters that a grain flies in a step."""
FAR = [3.0, 10.0, 50.0]
"""So many that its normal would be another one at q_m."""


def line(angle, length=4.0, x=0.0, wall=0, first=0):
    """A thin wall through (x, 0), with both ends; ``angle`` is that of its normal, ``first`` the
    number of its first shape."""
    ex, ey = -np.sin(angle) * 0.5 * length, np.cos(angle) * 0.5 * length
    return [
        (ShapeKind.SEGMENT, wall, (x - ex, -ey, x + ex, ey)),
        (ShapeKind.VERTEX, wall, (x - ex, -ey, -1, first)),
        (ShapeKind.VERTEX, wall, (x + ex, ey, first, -1)),
    ]


def fly(engine, steps, dt=DT):
    for k in range(steps):
        engine.step(dt, k * dt)
    assert book(engine.state, "closure") < 1e-10
    return engine.state


def thrown(
    shapes,
    position,
    velocity,
    *,
    walls=("wall",),
    drives=None,
    gravity=(0.0, 0.0),
    period=0.0,
    radius=(R,),
    **laws,
):
    laws = {"friction": 0.0} | laws
    model = make_model(radius, shapes, walls, gravity=gravity, period=period, **laws)
    return make_engine(
        model, np.atleast_2d(position), np.atleast_2d(velocity), settings=TIGHT, drives=drives
    )


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("normal", [0.0, 1.0, 2.5, -2.0])
@pytest.mark.parametrize("slant", [0.0, 0.5, -1.2])
def test_a_thin_wall_is_hit(way, restitution, normal, slant):
    """u_n⁺ = −e u_n⁻, the tangential velocity stays, the loss is ½ m (1 − e²) u_n²; where is seen
    from the first touch on."""
    n, t = np.array([np.cos(normal), np.sin(normal)]), np.array([-np.sin(normal), np.cos(normal)])
    speed = way * 2.0 * R / DT
    velocity = speed * (-np.cos(slant) * n + np.sin(slant) * t)
    ahead = 0.5 * (0.5 * way) * 2.0 * R  # half of the first half step
    touch = R * n + 0.4 * t
    engine = thrown(
        line(normal, length=400.0), touch - ahead * velocity / speed, [*velocity, 0.0],
        restitution=restitution,
    )  # fmt: skip
    state = fly(engine, 1)
    after = state.velocity[0, :2]
    assert after @ n == pytest.approx(restitution * speed * np.cos(slant), abs=1e-9 * speed)
    assert after @ t == pytest.approx(speed * np.sin(slant), abs=1e-9 * speed)
    lost = 0.5 * engine.model.grains.mass[0] * (1.0 - restitution**2) * (speed * np.cos(slant)) ** 2
    assert book(state, "impact_loss") == pytest.approx(lost, rel=1e-9, abs=1e-9 * lost)
    assert state.position[0, :2] @ n >= R * (1.0 - 1e-3)


SHAPES = {
    "line": line(0.0),
    "disc": [(ShapeKind.DISC, 0, (0.0, 0.0, 1.0, 0.0))],
    "point": [(ShapeKind.VERTEX, 0, (0.0, 0.0, -1, -1))],
    "plane": [(ShapeKind.PLANE, 0, (0.0, 0.0, 1.0, 0.0))],
    "side": [
        (ShapeKind.SIDE, 0, (0.0, 1.5, 0.0, -1.5)),
        (ShapeKind.VERTEX, 0, (0.0, 1.5, -1, 0)),
        (ShapeKind.VERTEX, 0, (0.0, -1.5, 0, -1)),
    ],
    "circle": [(ShapeKind.CIRCLE, 0, (200.0, 0.0, 200.0, 0.0))],
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_hit(way, restitution, shape):
    """Head-on at the middle of the shape, from every distance within the first half step."""
    front = R + (1.0 if shape == "disc" else 0.0)
    speed = way * 2.0 * R / DT
    for share in (0.01, 0.5, 0.99):
        start = front + share * 0.5 * way * 2.0 * R
        engine = thrown(SHAPES[shape], [start, 0.0], [-speed, 0.0, 0.0], restitution=restitution)
        state = fly(engine, 3)
        assert state.velocity[0, 0] == pytest.approx(restitution * speed, abs=1e-9 * speed)
        assert state.position[0, 0] >= front - 5e-4 * R
        if restitution == 0.0:
            assert state.position[0, 0] == pytest.approx(front, abs=5e-4 * R)


@pytest.mark.parametrize("way", FAR)
@pytest.mark.parametrize("along", [-2.4, -2.1, -1.9, -0.3, 1.2, 1.99, 2.3, 2.6])
def test_a_wall_is_hit_along_all_of_its_length_and_not_beyond(way, along):
    """At an end the normal is that from the end to the center; beyond half a diameter past it
    nothing is met."""
    speed = way * 2.0 * R / DT
    past = max(abs(along) - 2.0, 0.0)
    engine = thrown(line(0.0), [R + 0.25 * way, along], [-speed, 0.0, 0.0])
    state = fly(engine, 1)
    if past >= R:
        assert state.velocity[0].tolist() == [-speed, 0.0, 0.0]
        return
    nx, ny = np.sqrt(1.0 - (past / R) ** 2), np.sign(along) * past / R
    expected = np.array([-speed, 0.0]) + speed * nx * np.array([nx, ny])
    assert state.velocity[0, :2] == pytest.approx(expected, abs=1e-6 * speed)


@pytest.mark.parametrize("way", WAYS)
def test_friction_turns_a_grain_that_hits_a_wall(way):
    """Δu_t = −μ (1 + β) u_n while it slips: the spin of a disc that slides is that of its
    impulse."""
    speed = way * 2.0 * R / DT
    engine = thrown(
        line(0.0, length=400.0), [R + 0.1 * way, 0.0], [-speed, 3.0 * speed, 0.0], friction=0.3
    )
    state = fly(engine, 1)
    assert state.velocity[0] == pytest.approx(
        [0.0, 2.7 * speed, 0.3 * speed * 2.0 / R], abs=1e-9 * speed
    )


@pytest.mark.parametrize("way", FAR)
@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("offset", [0.0, 0.6, -0.9])
@pytest.mark.parametrize("share", [0.5, 0.05])
def test_two_grains_hit_each_other(way, restitution, offset, share):
    """v_i⁺ = v_i + (1 + e) (m_j/M) u_n n with the normal of the first touch; a grain moves and
    another one rests."""
    small = 2.0 * share * R  # radius of the grain that rests
    reach, speed = R + small, way * 2.0 * R / DT
    ny = offset
    nx = -np.sqrt(1.0 - ny * ny)  # from the grain that rests to the other
    start = np.array([reach * nx - 0.2 * way, reach * ny])
    engine = thrown(
        (), [start, [0.0, 0.0]], [[speed, 0.0, 0.0], [0.0] * 3], walls=(), radius=(R, small),
        restitution=restitution,
    )  # fmt: skip
    state = fly(engine, 1)
    mass = engine.model.grains.mass
    u_n, n = speed * nx, np.array([nx, ny])
    first = np.array([speed, 0.0]) - (1.0 + restitution) * mass[1] / mass.sum() * u_n * n
    second = (1.0 + restitution) * mass[0] / mass.sum() * u_n * n
    assert state.velocity[0, :2] == pytest.approx(first, abs=1e-6 * speed)
    assert state.velocity[1, :2] == pytest.approx(second, abs=1e-6 * speed)


@pytest.mark.parametrize("way", [2.0, 10.0, 50.0])
@pytest.mark.parametrize("frame", [0.0, 40.0, -300.0])
def test_two_grains_meet_in_any_frame(way, frame):
    """Both move, and the frame too: momentum is kept, relative velocity reverses, their center goes
    on as it did."""
    speed, drift = way * R / DT, frame * R / DT
    engine = thrown(
        (), [[-R - 0.1 * way, 0.0], [R + 0.1 * way, 0.0]],
        [[drift + speed, 0.0, 0.0], [drift - speed, 0.0, 0.0]],
        walls=(), radius=(R, R), restitution=1.0,
    )  # fmt: skip
    state = fly(engine, 1)
    assert state.velocity[:, 0] == pytest.approx(
        [drift - speed, drift + speed], abs=1e-9 * max(speed, abs(drift))
    )
    assert state.position[:, 0].mean() == pytest.approx(
        drift * DT, abs=1e-9 * max(1.0, abs(drift * DT))
    )


@pytest.mark.parametrize("way", FAR)
@pytest.mark.parametrize("restitution", [0.0, 0.9])
def test_nobody_passes_a_row_of_three(way, restitution):
    """Order, momentum and non-penetration hold in every step; energy only decreases."""
    speed, gap = way * 2.0 * R / DT, 0.01
    x = [-R - 0.2 * way] + [R + k * (2.0 * R + gap) for k in range(3)]
    engine = thrown(
        (), [[place, 0.0] for place in x], [[speed, 0.0, 0.0]] + [[0.0] * 3] * 3, walls=(),
        radius=(R,) * 4, restitution=restitution,
    )  # fmt: skip
    state, energy = engine.state, speed**2
    for k in range(12):
        engine.step(DT, k * DT)
        assert (np.diff(state.position[:, 0]) >= 2.0 * R * (1.0 - 5e-4)).all()
        assert state.velocity[:, 0].sum() == pytest.approx(speed, rel=1e-12)
        assert (state.velocity[:, 0] ** 2).sum() <= energy * (1.0 + 1e-12)
        energy = (state.velocity[:, 0] ** 2).sum()
    if restitution == 0.0:
        assert state.velocity[:, 0] == pytest.approx([speed / 4.0] * 4, rel=1e-6)


def pushed(way, seconds=1.0):
    """A displacement that begins with a velocity of ``way`` diameters per step."""
    return DofDrive(position=Ramp(0.0, way * 2.0 * R / DT * seconds, seconds))


@pytest.mark.parametrize("way", [1.0, 10.0, 50.0])
@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_wall_that_starts_at_once_takes_a_grain_along(way, restitution, shape):
    """u_n⁺ = −e u_n⁻: the grain flies at (1 + e) V, from where the wall is at mid-step."""
    front, speed = R + (1.0 if shape == "disc" else 0.0), way * 2.0 * R / DT
    drives = [WallDrive(x=pushed(way))]
    engine = thrown(
        SHAPES[shape], [front + 0.1 * way, 0.0], [0.0] * 3, restitution=restitution, drives=drives
    )
    state = fly(engine, 1)
    assert state.velocity[0, 0] == pytest.approx((1.0 + restitution) * speed, rel=1e-9)
    for k in range(1, 5):
        engine.step(DT, k * DT)
        assert state.position[0, 0] >= state.wall_position[0, 0] + front - 5e-4 * R


@pytest.mark.parametrize(
    ("turn", "restitution"), [(0.6, 0.0), (1.0, 0.0), (2.0, 0.0), (0.6, 0.9), (1.0, 0.9)]
)
def test_a_wall_that_starts_to_turn_takes_a_grain_along(turn, restitution):
    """A line through the origin turns by ``turn`` in the first step; the grain gets (1 + e) Ω r
    along the normal at mid-step, or at the touch if it flies on."""
    rate = turn / DT
    drives = [WallDrive(spin=DofDrive(position=Ramp(0.0, rate, 1.0)))]
    engine = thrown(
        line(0.0, length=40.0), [-R - 0.5, 5.0], [0.0] * 3, restitution=restitution, drives=drives
    )
    state = fly(engine, 1)
    lever = np.hypot(R + 0.5, 5.0)
    touch = np.arctan2(R + 0.5, 5.0) - np.arcsin(R / lever)
    angle = touch if restitution > 0.0 else 0.5 * turn
    normal = -np.array([np.cos(angle), np.sin(angle)])
    assert state.velocity[0, :2] @ normal == pytest.approx(
        (1.0 + restitution) * rate * np.sqrt(lever**2 - R**2), rel=1e-6
    )
    along = np.array([-normal[1], normal[0]])
    assert state.velocity[0, :2] @ along == pytest.approx(0.0, abs=1e-9 * rate)


@pytest.mark.parametrize("way", FAR)
def test_a_grain_and_a_wall_meet_half_way(way):
    """Both move: u_n⁻ = −(v + V)."""
    speed = way * 2.0 * R / DT
    engine = thrown(
        line(0.0), [R + 0.5 * way, 0.3], [-speed, 0.0, 0.0], restitution=0.5,
        drives=[WallDrive(x=pushed(0.5 * way))]
    )  # fmt: skip
    state = fly(engine, 1)
    assert state.velocity[0, 0] == pytest.approx(0.5 * speed + 0.5 * 1.5 * speed, rel=1e-9)
    assert state.position[0, 0] >= state.wall_position[0, 0] + R


def test_a_wall_pushes_a_grain_into_another():
    """The wall passes both on its way; both go with it, in their order."""
    engine = thrown(
        line(0.0), [[1.0, 0.0], [2.5, 0.0]], [[0.0] * 3] * 2, radius=(R, R),
        drives=[WallDrive(x=pushed(10.0))],
    )  # fmt: skip
    state = fly(engine, 1)
    assert state.velocity[:, 0] == pytest.approx([10.0 / DT] * 2, rel=1e-9)
    assert state.position[0, 0] == pytest.approx(state.wall_position[0, 0] + R, abs=5e-4 * R)
    assert state.position[1, 0] == pytest.approx(state.position[0, 0] + 2.0 * R, abs=5e-4 * R)


def test_a_grain_between_two_walls_is_named_with_the_longest_step():
    """Lines at 0 and 2.25 with a grain of diameter 1 at rest in between: the first one closes 1.25
    in half of 0.125 of the step."""
    shapes = line(0.0) + line(0.0, x=2.25, wall=1, first=3)
    drives = [WallDrive(x=pushed(20.0)), WallDrive()]
    engine = thrown(shapes, [1.0, 0.0], [0.0] * 3, walls=("left", "right"), drives=drives)
    with pytest.raises(
        PhysicsError,
        match=r"grain 0 is caught between the walls 'left' and 'right'.*at most 0\.000125 s",
    ):
        engine.step(DT, 0.0)
    assert engine.state.step == 0
    fly(thrown(shapes, [1.0, 0.0], [0.0] * 3, walls=("left", "right"), drives=drives), 1, dt=1.2e-4)


@pytest.mark.parametrize("frozen", [0, 3])
@pytest.mark.parametrize("longer", [2.0, 10.0, 100.0])
def test_a_longer_step_sees_what_the_one_before_did_not(longer, frozen):
    """A grain flies freely, then steps become longer; so it is after steps in which nothing
    moved."""
    speed = 0.2 * 2.0 * R / DT
    engine = thrown(line(0.0), [3.0, 0.0], [-speed, 0.0, 0.0], restitution=0.9)
    state = fly(engine, 5)
    assert state.velocity[0, 0] == -speed
    state.frozen_steps += frozen
    state.step += frozen
    for k in range(4):
        engine.step(longer * DT, k * longer * DT)
    assert state.velocity[0, 0] == pytest.approx(0.9 * speed, rel=1e-9)


@pytest.mark.parametrize(
    ("way", "restitution"), [(3.0, 0.0), (30.0, 0.0), (300.0, 0.0), (3.0, 0.5)]
)
@pytest.mark.parametrize("image", [0.0, 1.0, 2.0])
def test_images_are_hit(way, restitution, image):
    """A wall and a grain across the periodic edge, from either side of it."""
    period, speed = 8.0, way * 2.0 * R / DT
    x = 1.0 - R - 0.2 * way
    for shapes, radius, more in (
        (line(0.0, x=1.0 + image * period), (R,), []),
        ((), (R, R), [[1.0 + R, 0.0]]),
    ):
        position = [[x % period, 0.0], *more]
        engine = thrown(
            shapes, position, [[speed, 0.0, 0.0], [0.0] * 3][: len(position)],
            walls=("wall",) if shapes else (), radius=radius,
            period=period, restitution=restitution,
        )  # fmt: skip
        state = fly(engine, 1)
        expected = -restitution * speed if shapes else 0.5 * (1.0 - restitution) * speed
        assert state.velocity[0, 0] == pytest.approx(expected, rel=1e-6, abs=1e-9 * speed)


@pytest.mark.parametrize("way", [3.0, 20.0])
def test_gravity_and_stops_close_the_books(way):
    """Where a grain is stopped earlier, gravity works less: kinetic change = m g Δy − losses, all
    of them in the books."""
    speed = way * 2.0 * R / DT
    engine = thrown(
        line(0.5 * np.pi, length=400.0), [0.0, R + 0.3 * way], [0.2 * speed, -speed, 0.0],
        gravity=(0.0, -1000.0), friction=0.4,
        restitution=0.3,
    )  # fmt: skip
    high = engine.state.position[0, 1]
    state = fly(engine, 1)
    assert book(state, "gravity_work") == pytest.approx(
        engine.model.grains.mass[0] * -1000.0 * (state.position[0, 1] - high), rel=1e-9
    )
    assert book(state, "impact_loss") > 0.0
    fly(engine, 20)


def box(side):
    """Four thin walls and their corners."""
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    sides = [(ShapeKind.SEGMENT, 0, (*corners[k], *corners[(k + 1) % 4])) for k in range(4)]
    return sides + [(ShapeKind.VERTEX, 0, (*corners[k], (k - 1) % 4, k)) for k in range(4)]


def crowd(way, threads=1, seed=0):
    """100 grains of several sizes on a lattice in a box, flying about."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.2, 0.45, 100)
    place = np.array([[k % 10 + 0.5, k // 10 + 0.5] for k in range(100)], float)
    velocity = np.column_stack([rng.normal(size=(100, 2)) * way / DT, np.zeros(100)])
    model = make_model(
        radius, box(10.0), ("box",), gravity=(0.0, -10.0), friction=0.3, restitution=0.6
    )
    return make_engine(model, place, velocity, threads=threads)


@pytest.mark.parametrize("way", [0.5, 3.0, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_crowd_stays_in_its_box(way, seed):
    """Whatever they meet on their ways, no grain is in a wall, or in another one; at mid-step
    where they are too wild to be followed."""
    engine = crowd(way, seed=seed)
    engine.step(DT, 0.0)
    place = engine.mechanics.moved.scene.position if way > 10.0 else engine.state.position
    x, radius, deep = place[:, :2], engine.model.grains.radius[:, None], 1e-3
    assert (x >= radius * (1.0 - deep)).all()
    assert (x <= 10.0 - radius * (1.0 - deep)).all()
    apart = np.hypot(*(x[:, None] - x[None]).transpose(2, 0, 1)) + 10.0 * np.eye(100)
    assert (apart >= radius + radius.T - deep * np.minimum(radius, radius.T)).all()


@pytest.mark.parametrize("way", [0.5, 3.0])
def test_a_crowd_has_the_same_bits_on_any_number_of_threads(way, monkeypatch):
    monkeypatch.setattr("multicor_cli.engine.motion.layout.PARALLEL_GRAINS", 1)
    digests = set()
    for threads in (1, 2):
        engine = crowd(way, threads=threads)
        for k in range(3):
            engine.step(DT, k * DT)
        digests.add(engine.state.digest())
    assert len(digests) == 1


PLATE = [[plate(1.0, 0.2)]]
"""Reaches five times as far along as across."""


@pytest.mark.parametrize("x", [0.0, 0.3, -0.45])
def test_a_plate_slides_over_what_lies_within_its_circle(x):
    """Even past the highest point of a peg, and with one above it, too: v Δt, no impact."""
    pegs = [(ShapeKind.DISC, wall, (x, y, 0.1, 0.0)) for wall, y in ((0, -0.1), (1, 0.3))]
    model = shaped_model(PLATE, pegs, ("below", "above"), friction=0.0, gravity=(0.0, 0.0))
    speed = 0.04 / DT
    engine = make_engine(model, [[x - 0.01, 0.1, 0.0]], [[speed, 0.0, 0.0]], settings=TIGHT)
    state = fly(engine, 1)
    assert state.velocity[0] == pytest.approx([speed, 0.0, 0.0], abs=1e-9 * speed)
    assert state.position[0] == pytest.approx([x + 0.03, 0.1, 0.0], abs=1e-12)


@pytest.mark.parametrize("way", [0.02, 0.15, 0.25, 1.0, 10.0])
@pytest.mark.parametrize("angle", [0.0, np.pi / 2.0])
def test_a_plate_hits_a_thin_wall_that_lies_within_its_circle(way, angle):
    """Flat or upright, a hair above it: it stays on its side."""
    half = 0.1 if angle == 0.0 else 0.5
    model = shaped_model(PLATE, line(np.pi / 2.0), ("wall",), friction=0.0, gravity=(0.0, 0.0))
    speed = 2.0 * way / DT
    engine = make_engine(model, [[0.0, half + 0.005, angle]], [[0.0, -speed, 0.0]], settings=TIGHT)
    state = fly(engine, 3)
    assert state.velocity[0, 1] == pytest.approx(0.0, abs=1e-9 * speed)
    assert half - 1e-3 <= state.position[0, 1] <= half + 0.005


def test_nothing_is_looked_for_where_nothing_is_new():
    """Constant motion, and starts too slow to pass anything."""
    engine = thrown(line(0.0), [300.0, 0.0], [-1e-6 / DT, 0.0, 0.0])
    none = np.empty(0, np.int64)

    def unseen(newcomers, dt, seen):
        return find_unseen(engine.state, newcomers, engine.model, engine.mechanics.motion, dt, seen)

    assert unseen(none, DT, 0.0) is None
    engine.step(DT, 0.0)
    engine.state.velocity[0, 0] = -50.0 / DT
    assert unseen(none, DT, DT) is None
    assert unseen(np.array([0]), DT, DT) is not None
    assert unseen(none, 2.0 * DT, DT) is not None


@pytest.mark.parametrize("depth", [0.0, 2.5e-4, 4.9999e-4])
def test_contacts_at_the_bound_of_overlaps_are_no_strangers(depth):
    """As in a dense flow with which another run begins: two discs touch and slide past each other,
    and both go far. One such pair was stopped, and with it all others that it touched."""
    half, way = 0.005 * R, 0.2 * R  # from the closest approach; of both, in half a step
    distance = (2.0 - depth) * R
    model = make_model([R, R], friction=0.0, gravity=(0.0, 0.0))
    places = [[half, np.sqrt(distance**2 - half**2)], [0.0, 0.0]]
    velocity = np.array([[way - half, 0.0, 0.0], [way + half, 0.0, 0.0]]) / (0.5 * DT)
    engine = make_engine(model, places, velocity)
    engine.step(DT, 0.0)
    moved = engine.state.position[0] - engine.state.position[1]
    assert moved[0] == pytest.approx(half - 4.0 * half, rel=0.02)
