"""Gas and radiation between grains that are no discs, and heat of their impacts: closed forms,
brute force over outlines, limits."""

from dataclasses import replace

import numpy as np
import pytest
from heat_parts import at_temperature, coupled_engine, frozen_engine, make_heat_laws, with_heat
from scene_parts import FLOOR
from shapes import box, disc, outlines_of, regular, rod, shaped_model, wall_line

from multicor_cli.engine.heat.films import SEPARATION
from multicor_cli.engine.heat.gas import (
    Gas,
    parallel_between,
    parallel_conductance,
    parallel_conductance_wall,
)
from multicor_cli.engine.heat.hertz import joint_coefficient
from multicor_cli.engine.heat.impacts import flat_exchange, flat_time, impact_exchange
from multicor_cli.engine.heat.radiation import Radiation, cylinder_view_factor, emission_factor
from multicor_cli.engine.heat.settings import ContactForce
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind, State

THICKNESS, LAMBDA, GAS = 0.5, 15.0, 0.026
EMISSION = emission_factor(0.8, 0.8)
LAWS = make_heat_laws(emissivity=0.8)
WHOLE = 10.0
"""A reach that leaves nothing out."""


def prisms(grains, shapes=(), walls=(), **keys):
    """A model of prisms with temperatures."""
    model = shaped_model(grains, shapes, walls, friction=0.4, **keys)
    return with_heat(model, thickness=THICKNESS)


def links_of(model, places, mechanism, **settings):
    """Links between bodies at rest, conductances of contacts and area factors with them."""
    state = State.at_rest(model, np.asarray(places, float)[:, :2])
    state.position[:] = places
    engine = frozen_engine(model, state, None, LAWS, mechanisms=(mechanism,), **settings)
    return engine._heat._rest(engine._heat._resting_scene())[0]


def film(grains, places, shapes=(), walls=(), **settings):
    """What the gas conducts between all bodies together [W/K]."""
    model = prisms(grains, shapes, walls)
    links = links_of(model, places, Gas(GAS, reach=WHOLE), **settings)
    return float((links.conductance - links.of_contacts).sum())


def view(grains, places, shapes=(), walls=()):
    """½ ∫ o dφ of all pairs together [m]."""
    links = links_of(prisms(grains, shapes, walls), places, Radiation(reach=WHOLE))
    return float(links.area.sum()) / (EMISSION * THICKNESS)


# ---- Brute force


def outline(grain, place, parts=400):
    """Points all around a grain of one piece, as it lies; with its center of mass at its place."""
    ((corners, r),) = grain
    _, centers, _ = outlines_of([grain])
    x, y, angle = place
    edges = np.roll(corners, -1, axis=0) - corners
    turn = np.arctan2(edges[:, 1], edges[:, 0]) - 0.5 * np.pi
    points = []
    for k, corner in enumerate(corners):
        far = (turn[k] - turn[k - 1]) % (2.0 * np.pi) if len(corners) > 1 else 2.0 * np.pi
        angles = turn[k - 1] + far * np.linspace(0.0, 1.0, parts)
        points.append(corner + r * np.column_stack([np.cos(angles), np.sin(angles)]))
        steps = np.linspace(0.0, 1.0, parts)[1:-1, None]
        out = r * np.array([np.cos(turn[k]), np.sin(turn[k])])
        points.append(corner + out + steps * edges[k])
    c, s = np.cos(angle), np.sin(angle)
    return (np.concatenate(points) - centers[0]) @ np.array([[c, s], [-s, c]]) + [x, y]


def heights(points, u):
    """Greatest height of a closed line over places u; −∞ where it is not."""
    x, y = points.T
    after_x, after_y = np.roll(x, -1), np.roll(y, -1)
    top = np.full(u.size, -np.inf)
    for a, b, p, q in zip(x, y, after_x, after_y, strict=True):
        first, last = np.searchsorted(u, [min(a, p), max(a, p)])
        if last > first:
            top[first:last] = np.maximum(
                top[first:last], b + (q - b) * (u[first:last] - a) / (p - a)
            )
    return top


def film_by_hand(lower, upper, normal, inner):
    """``λ_f b ∫ du/(g + inner)`` along a normal from the lower to the upper line, by the sum."""
    nx, ny = normal
    frame = np.array([[ny, nx], [-nx, ny]])
    lower, upper = lower @ frame, upper @ frame
    first = max(lower[:, 0].min(), upper[:, 0].min())
    last = min(lower[:, 0].max(), upper[:, 0].max())
    u = first + (last - first) * (np.arange(400_000) + 0.5) / 400_000
    gap = -heights(upper * [1.0, -1.0], u) - heights(lower, u)
    return GAS * THICKNESS * float(np.mean(1.0 / (gap + inner))) * (last - first)


def view_by_hand(one, other):
    """``½ ∬ cos cos/s`` over two convex lines that see each other."""
    total = 0.0
    middle, along = 0.5 * (other + np.roll(other, -1, axis=0)), np.roll(other, -1, axis=0) - other
    for (x, y), (u, v) in zip(one, np.roll(one, -1, axis=0), strict=True):
        away = middle - [0.5 * (x + u), 0.5 * (y + v)]
        leaves = away[:, 0] * (v - y) - away[:, 1] * (u - x)
        meets = away[:, 1] * along[:, 0] - away[:, 0] * along[:, 1]
        sees = (leaves > 0.0) & (meets > 0.0)
        total += float((leaves * meets / (away**2).sum(axis=1) ** 1.5)[sees].sum())
    return 0.5 * total


# ---- Films


@pytest.mark.parametrize("gap", [0.0, 1e-3, 0.1])
def test_gas_between_sides_that_face_each_other_is_a_layer(gap):
    """ℓ b/(h/λ_f + d_i/λ + d_j/λ) of the length that they share: exact in a bar."""
    found = film(
        [[(box(1.0, 1.0), 0.0)], [(box(2.0, 0.6), 0.0)]], [[0, 0, 0], [1.2, 0.8 + gap, 0]],
        conduction="none",
    )  # fmt: skip
    way = (0.5 + 0.3) / LAMBDA
    assert found == pytest.approx(0.3 * THICKNESS / (gap / GAS + way), rel=1e-10)


def test_sides_seen_from_their_edges_conduct_nothing_wherever_a_pair_turns():
    """Rounded boxes that face each other, turned together, and the one by next to nothing more."""
    grains, away = [[(box(1.0, 1.0), 0.2)], [(box(1.5, 1.5), 0.2)]], 1.75
    level = film(grains, [[0.0, 0.0, 0.0], [away, 0.0, 0.0]])
    for angle in np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, 200):
        for more in (0.0, 1e-12):
            other = [away * np.cos(angle), away * np.sin(angle), angle + more]
            turned = film(grains, [[0.0, 0.0, angle], other])
            assert turned == pytest.approx(level, rel=1e-9)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.1, 0.7])
def test_gas_under_a_corner_is_a_logarithm(angle):
    """Over a floor: g = h + x tan α on both sides of a sharp corner."""
    c, s, gap = np.cos(angle), np.sin(angle), 0.05
    found = film([[(box(1.0, 1.0), 0.0)]], [[0.0, 0.5 * (c + s) + gap, angle]], FLOOR, ("floor",))
    open_gap = gap + GAS * 0.5 * (c + s) / LAMBDA
    long, short = (
        np.log1p(length / open_gap) / slope for length, slope in ((s, s / c), (c, c / s))
    )
    assert found == pytest.approx(GAS * THICKNESS * (long + short), rel=1e-9)


def under_round_end(radius, open_gap):
    """``∫ du/(open_gap + r − √(r² − u²))`` over the whole end."""
    far = open_gap + radius
    root = np.sqrt(far * far - radius * radius)
    return 4.0 * far / root * np.arctan(np.sqrt((far + radius) / open_gap)) - np.pi


@pytest.mark.parametrize("gap", [0.0, 1e-4, 1e-2, 0.3])
def test_gas_at_a_round_end_is_that_of_a_cylinder(gap):
    """Of a rod that stands over a floor, and over one like it, in closed form."""
    standing, inner = [(rod(2.0), 0.3)], GAS * 1.3 / LAMBDA
    up = 0.5 * np.pi
    found = film([standing], [[0.0, 1.3 + gap, up]], FLOOR, ("floor",), conduction="none")
    expected = GAS * THICKNESS * under_round_end(0.3, gap + inner)
    assert found == pytest.approx(expected, rel=1e-4)
    places = [[0.0, 0.0, up], [0.0, 2.6 + gap, up]]
    found = film([standing, standing], places, conduction="none")
    expected = 0.5 * GAS * THICKNESS * under_round_end(0.3, 0.5 * gap + inner)
    assert found == pytest.approx(expected, rel=1e-4)


CASES = {
    "corner over side": (
        [(box(2.0, 1.0), 0.1)], [(box(1.0, 1.0), 0.05)], [0.3, 0.6 + 0.05 + 0.02 + np.sqrt(0.5)],
        0.25 * np.pi, (0.0, 1.0), 0.05,
    ),
    "rod over pentagon": (
        [(regular(5, 0.5, 0.3 * np.pi), 0.02)], [(rod(1.0), 0.2)], [0.1, 0.92], 0.0, None, 0.1,
    ),
    "corner over corner": (
        [(regular(4, 0.5), 0.1)], [(regular(3, 0.5, -0.5 * np.pi), 0.2)], [0.4, 1.4], 0.0, None, 0.1,
    ),
}  # fmt: skip


def normal_between(lower, upper):
    """Unit vector between the nearest two points of two lines."""
    away = ((upper[None] - lower[:, None]) ** 2).sum(axis=2)
    a, b = np.unravel_index(int(away.argmin()), away.shape)
    return (upper[b] - lower[a]) / np.sqrt(away[a, b])


@pytest.mark.parametrize("name", CASES)
def test_films_and_views_of_round_corners_are_those_of_brute_force(name):
    below, above, place, angle, normal, _ = CASES[name]
    places = [[0.0, 0.0, 0.0], [*place, angle]]
    found = film([below, above], places)
    lower, upper = outline(below, places[0], 1500), outline(above, places[1], 1500)
    normal = normal or normal_between(lower[::2], upper[::2])
    inner = GAS * ((lower @ normal).max() + (np.array(place) @ normal - (upper @ normal).min()))
    assert found == pytest.approx(film_by_hand(lower, upper, normal, inner / LAMBDA), rel=2e-3)
    lower, upper = outline(below, places[0], 200), outline(above, places[1], 200)
    assert view([below, above], places) == pytest.approx(view_by_hand(lower, upper), rel=3e-3)


def core(radius):
    return radius * GAS / LAMBDA


def test_discs_are_spheres_beside_sides_and_as_pieces():
    """A disc over a block is one over a floor; a clump of two discs has two such films."""
    one = parallel_conductance_wall(GAS, 0.4, core(0.4), 0.05)
    found = film([[(box(4.0, 1.0), 0.0)], disc(0.4)], [[0, 0, 0], [0.3, 0.95, 0]])
    assert found == pytest.approx(one, rel=1e-12)
    pair = [(np.array([[-1.0, 0.0]]), 0.4), (np.array([[1.0, 0.0]]), 0.4)]
    found = film([pair], [[0.0, 0.45, 0.0]], FLOOR, ("floor",))
    assert found == pytest.approx(2.0 * one, rel=1e-12)
    ahead = [(np.array([[0.0, 0.0]]), 0.4), (np.array([[0.0, 9.0]]), 0.4)]
    places = [[0.0, 4.5, 0.0], [1.1, 0.0, 0.0]]
    links = links_of(prisms([ahead, disc(0.5)]), places, Gas(GAS, reach=0.9))
    expected = parallel_conductance(GAS, 0.4, 0.5, core(2 * 0.2 / 0.9), 0.2)
    assert links.conductance[0] == pytest.approx(expected, rel=1e-12)


def test_at_the_end_of_a_side_a_disc_has_half_a_film():
    whole = parallel_conductance_wall(GAS, 0.4, core(0.4), 0.05)
    found = film([[(box(4.0, 1.0), 0.0)], disc(0.4)], [[0, 0, 0], [2.0 - 1e-9, 0.95, 0]])
    assert found == pytest.approx(0.5 * whole, rel=1e-3)
    found = film([[(box(4.0, 1.0), 0.0)], disc(0.4)], [[0, 0, 0], [1.9, 0.95, 0]])
    rest = parallel_between(GAS, 0.4, 0.1, 0.4, 0.05)
    assert found == pytest.approx(whole - rest, rel=1e-12)


@pytest.mark.parametrize("sides", [24, 64])
def test_round_polygons_conduct_and_see_as_discs(sides):
    """On a disc, on each other and on a wall, whether they meet with a corner or a side."""
    for shift in (0.0, np.pi / sides):
        lower, upper = (
            [(regular(sides, a, turn + shift), 0.0)]
            for a, turn in ((1.0, 0.5 * np.pi), (0.5, -0.5 * np.pi))
        )
        flat = np.cos(shift)
        places = [[0.0, 0.0, 0.0], [0.0, 1.5 * flat + 0.02, 0.0]]
        between = parallel_conductance(GAS, 1.0, 0.5, core(2.0 / 3.0), 0.02)
        assert film([lower, upper], places) == pytest.approx(between, rel=2e-2)
        seen = 2.0 * np.pi * cylinder_view_factor(1.0, 0.5, 0.02)
        assert view([lower, upper], places) == pytest.approx(seen, rel=8.0 / sides**2)
        down = [[0.0, 0.5 * flat + 0.02, 0.0]]
        on_floor = parallel_conductance_wall(GAS, 0.5, core(0.5), 0.02)
        assert film([upper], down, FLOOR, ("floor",)) == pytest.approx(on_floor, rel=2e-2)
        seen = np.pi * cylinder_view_factor(0.5, 0.5, 0.02)
        assert view([upper], down, FLOOR, ("floor",)) == pytest.approx(seen, rel=8.0 / sides**2)


@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_a_floor_of_pieces_conducts_as_a_whole_one(angle):
    """Also in part beside its end, and where the lowest corner is over another piece."""
    grain, height = [(box(1.0, 1.0), 0.02)], 0.75
    whole = film([grain], [[0.0, height, angle]], FLOOR, ("floor",))
    tiles = wall_line([(-3.0, 0.0), (-0.4, 0.0), (0.1, 0.0), (0.3, 0.0), (3.0, 0.0)])
    pieces = film([grain], [[0.0, height, angle]], tiles, ("floor",))
    assert pieces == pytest.approx(whole, rel=1e-6)
    half = wall_line([(-3.0, 0.0), (0.0, 0.0)]), wall_line([(0.0, 0.0), (3.0, 0.0)])
    parts = [film([grain], [[0.0, height, angle]], part, ("floor",)) for part in half]
    assert sum(parts) == pytest.approx(whole, rel=1e-6)
    assert min(parts) > 0.2 * whole


def test_a_box_in_a_drum_encloses_gas_with_it():
    """g = √(R² − x²) − d over the side, between two corners that nearly touch."""
    radius, gap = 3.0, 0.01
    half = 0.5 + 1e-12
    depth = np.sqrt((radius - gap) ** 2 - half**2)
    drum = [(ShapeKind.CIRCLE, 0, (0.0, 0.0, radius, 0.0))]
    found = film([[(box(1.0, 1.0), 0.0)]], [[0.0, -depth + 0.5, 0.0]], drum, ("drum",))
    angle = np.arctan2(0.5, depth)  # straight along the radius through one of the corners
    corner, inner = np.array([0.5, -depth]), GAS * np.sqrt(0.5) * np.cos(0.25 * np.pi - angle)
    n = corner / np.hypot(*corner)
    t = np.array([-n[1], n[0]])
    low, high = sorted([(corner - [1.0, 0.0]) @ t, corner @ t])
    u = low + (high - low) * (np.arange(400_000) + 0.5) / 400_000
    height = corner @ n - np.abs(u - corner @ t) * np.tan(angle)
    gaps = np.sqrt(radius**2 - u**2) - height
    side = GAS * THICKNESS * np.mean(1.0 / (gaps + inner / LAMBDA)) * (high - low)
    assert found > side
    assert found == pytest.approx(side, rel=0.1)  # the rest is beside the box, where it is wide


@pytest.mark.parametrize("rough", [False, True])
def test_gas_fills_what_sides_leave_of_each_other(rough):
    """A joint of asperities with gas between them, with the ways inside, and all of it."""
    model = prisms([[(box(1.0, 1.0), 0.0)]], FLOOR, ("floor",))
    engine = coupled_engine(
        model, [[0.0, 0.5, 0.0]], laws=LAWS, mechanisms=(Gas(GAS),),
        conduction="rough" if rough else "hertz", conditions=[at_temperature(310.0)],
    )  # fmt: skip
    engine.step(1e-6, 0.0)
    force = 9.81 * float(model.grains.mass[0])
    way, joint = 0.5 / LAMBDA, 0.0
    if rough:
        sigma, slope, hard = LAWS.roughness[0, 0], LAWS.slope[0, 0], LAWS.microhardness[0, 0]
        solid = joint_coefficient(force / THICKNESS, LAMBDA, sigma, slope, hard)
        joint = 1.0 / (solid + GAS / (SEPARATION * sigma))
        assert joint < 0.5 / solid
    expected = THICKNESS / (joint + way)
    heat = engine.state.heat[0]
    assert heat == pytest.approx(1e-6 * expected * 10.0, rel=1e-5)


def test_gas_ends_at_its_reach():
    grains = [[(box(1.0, 1.0), 0.0)], [(box(1.0, 1.0), 0.0)]]
    for gap, conducts in ((0.39, True), (0.41, False)):
        places = [[0, 0, 0], [0, 1.0 + gap * np.sqrt(0.5), 0]]
        links = links_of(prisms(grains), places, Gas(GAS, reach=0.4))
        assert (links.conductance.sum() > 0.0) == conducts


def test_across_the_ends_of_a_period_all_is_as_within():
    grains = [[(box(1.0, 1.0), 0.1)], [(regular(5, 0.6), 0.0)]]
    tiles = wall_line([(-2.0, -0.8), (0.1, -0.8), (2.0, -0.8)])
    found = []
    for shift in (0.0, -4.1):
        model = prisms(grains, tiles, ("floor",), period=12.0)
        places = np.array([[0.1, 0.0, 0.2], [1.35, 0.3, 1.0]])
        places[:, 0] = (places[:, 0] + shift) % 12.0
        geometry = model.shapes.geometry + np.array([shift, 0.0, 0.0, 0.0])
        lines = model.shapes.kind == ShapeKind.SEGMENT
        geometry[lines, 2] += shift
        model = replace(model, shapes=replace(model.shapes, geometry=geometry))
        for mechanism in (Gas(GAS, reach=0.5), Radiation(reach=0.5)):
            links = links_of(model, places, mechanism)
            found.append(float(links.conductance.sum()) + float(links.area.sum()))
    assert found[0] > 0.0 < found[1]
    assert found[2:] == pytest.approx(found[:2], rel=1e-11)


# ---- Views


@pytest.mark.parametrize("gap", [0.3, 1e-6, 0.0])
def test_plates_see_each_other_as_hottel_says(gap):
    """√(w² + h²) − h of two that face each other."""
    found = view([[(box(1.0, 0.4), 0.0)], [(box(1.0, 0.6), 0.0)]], [[0, 0, 0], [0, 0.5 + gap, 0]])
    assert found == pytest.approx(np.sqrt(1.0 + gap * gap) - gap, rel=1e-9)


@pytest.mark.parametrize("size", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("gap", [0.0, 1e-3, 0.9])
def test_discs_see_each_other_as_cylinders_do(size, gap):
    """Clumps of two discs, one in the other, are seen by what is around them."""
    nested = [[(np.zeros((1, 2)), a), (np.zeros((1, 2)), 0.5 * a)] for a in (1.0, size)]
    found = view(nested, [[0.0, 0.0, 0.0], [0.0, 1.0 + size + gap, 0.0]])
    expected = 2.0 * np.pi * cylinder_view_factor(1.0, size, gap)
    assert found == pytest.approx(expected, rel=1e-7 if gap == 0.0 else 1e-12)


def test_clumps_see_as_what_encloses_them():
    """An L as the pentagon around it; of two crossed bars the string is a square's."""
    angle = [(box(2.0, 0.4), 0.0), (box(0.4, 2.0) + np.array([-0.8, 0.8]), 0.0)]
    around = np.array([[-1.0, -0.2], [1.0, -0.2], [1.0, 0.2], [-0.6, 1.8], [-1.0, 1.8]])
    place = [5.0, 1.0, 0.3]
    _, centers, _ = outlines_of([angle, [(around, 0.0)]])
    found = [
        view([shape, disc(1.0)], [[*center, 0.0], place])
        for shape, center in zip((angle, [(around, 0.0)]), centers, strict=True)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    cross = [(rod(2.0), 0.1), (rod(2.0)[:, ::-1], 0.1)]
    square = [(regular(4, 1.0), 0.1)]
    found = [view([shape, disc(1.0)], [[0, 0, 0.2], [2.5, 1.0, 0]]) for shape in (cross, square)]
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    one_in_one = [(regular(4, 1.0), 0.1), (0.5 * regular(4, 1.0), 0.05)]
    assert view([one_in_one, disc(1.0)], [[0, 0, 0.2], [2.5, 1.0, 0]]) == pytest.approx(found[1])
    flush = [(np.array([[0.0, 0.0], [0.0, 3.0]]), 0.5), (np.array([[-0.5, 3.0]]), 1.0)]
    mirrored = [(corners * [-1.0, 1.0], r) for corners, r in flush]
    _, centers, _ = outlines_of([flush, mirrored])
    place = np.array([3.0, 1.0])
    found = [
        view([shape, disc(1.0)], [[*center, 0.0], [*(place * side), 0.0]])
        for shape, center, side in (
            (flush, centers[0], [1.0, 1.0]), (flush[::-1], centers[0], [1.0, 1.0]),
            (mirrored, centers[1], [-1.0, 1.0]),
        )
    ]  # fmt: skip
    assert found == pytest.approx([found[2]] * 3, rel=1e-12)


def test_a_wall_is_seen_as_a_copy_of_the_grain_behind_it():
    """By sides √(w² + h²) − h; by a disc that is glued to a wall as by a grain."""
    block, places = [(box(1.0, 1.0), 0.0)], [[0.3, 0.6, 0.0]]
    for shapes in (FLOOR, wall_line([(-2.0, 0.0), (0.1, 0.0), (2.0, 0.0)])):
        found = view([block], places, shapes, ("floor",))
        assert found == pytest.approx(np.sqrt(1.01) - 0.1, rel=1e-9)
    glued = [(ShapeKind.DISC, 0, (0.0, 0.0, 0.7, 0.0))]
    turned = [[0.3, 1.6, 0.4]]
    assert view([block], turned, glued, ("floor",)) == pytest.approx(
        view([block, disc(0.7)], [*turned, [0.0, 0.0, 0.0]]), rel=1e-12
    )


# ---- Impacts


def hit(corners, rounding, angle, speed, *, spin=0.0, above=1e-7, drives=None, **keys):
    """Conductance of a grain that meets a floor, times the step, and the engine."""
    model = prisms([[(corners, rounding)]], FLOOR, ("floor",), gravity=(0.0, 0.0), **keys)
    model = replace(model, laws=model.laws._replace(friction=np.zeros((1, 1))))
    c, s = np.cos(angle), np.sin(angle)
    own = model.outlines.corner
    height = rounding - float((s * own[:, 0] + c * own[:, 1]).min())
    engine = coupled_engine(
        model, [[0.0, height + above, angle]], [[0.0, -speed, spin]], laws=LAWS,
        conditions=[at_temperature(310.0)], collisional=True, friction="none", drives=drives,
    )  # fmt: skip
    engine.step(1e-4, 0.0)
    return 1e-4 * float(engine.contacts().conductance.sum()), engine


SOLID = LAWS.conductivity[0], LAWS.volumetric[0]


@pytest.mark.parametrize("spin", [0.0, -0.7])
def test_a_corner_conducts_in_an_impact_as_a_sphere_of_less_mass(spin):
    """1/m (1 + l²/k²) with the lever l, and the speed of the corner."""
    angle, r, speed = 0.3, 0.1, 0.5
    found, engine = hit(box(1.0, 1.0), r, angle, speed, spin=spin)
    grains = engine.model.grains
    corners = engine.model.outlines.corner @ np.array(
        [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    )
    lever = float(corners[corners[:, 1].argmin(), 0])
    mass = 1.0 / (1.0 / grains.mass[0] + lever**2 / grains.inertia[0])
    expected = impact_exchange(mass, r, LAWS.modulus[0, 0], speed - spin * lever, *SOLID, *SOLID)
    assert found == pytest.approx(expected, rel=1e-4)
    engine.step(1e-4, 1e-4)
    assert 1e-4 * float(engine.contacts().conductance.sum()) < 0.1 * expected


def test_a_corner_feels_the_mass_of_a_floor_that_gives_way():
    """1/m (1 + l²/k²) + 1/M + L²/I with the lever L of the corner about the middle of the floor."""
    angle, free = 0.3, DofDrive(force=Constant(0.0))
    drives, given = [WallDrive(y=free, spin=free)], {"mass": 2.0, "inertia": 0.05}
    found, engine = hit(box(1.0, 1.0), 0.1, angle, 0.5, drives=drives, **given)
    grains, own = engine.model.grains, engine.model.outlines.corner
    lever = float(
        (own @ [np.cos(angle), -np.sin(angle)])[(own @ [np.sin(angle), np.cos(angle)]).argmin()]
    )
    inverse = 1.0 / grains.mass[0] + lever**2 / grains.inertia[0] + 0.5 + lever**2 / 0.05
    expected = impact_exchange(1.0 / inverse, 0.1, LAWS.modulus[0, 0], 0.5, *SOLID, *SOLID)
    assert found == pytest.approx(expected, rel=1e-4)


def test_a_round_polygon_conducts_in_an_impact_as_a_disc():
    found, engine = hit(regular(64, 1.0, -0.5 * np.pi), 0.0, 0.0, 0.5)
    mass = float(engine.model.grains.mass[0])
    expected = impact_exchange(mass, 1.0, LAWS.modulus[0, 0], 0.5, *SOLID, *SOLID)
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("speed", [0.05, 0.5])
def test_a_side_that_hits_flat_conducts_as_two_half_spaces(speed):
    found, engine = hit(box(1.0, 0.6), 0.0, 0.0, speed)
    mass = float(engine.model.grains.mass[0])
    expected = flat_exchange(mass, THICKNESS, LAWS.modulus[0, 0], *SOLID, *SOLID)
    assert found == pytest.approx(expected, rel=1e-9)


def test_half_spaces_that_touch_for_a_time():
    """Against the heat that has gone into a fine grid by then."""
    mass, area, modulus = 1.0, 0.5, 1e11
    time = flat_time(mass, area, modulus)
    deep, count = 8.0 * np.sqrt(4e-6 * time), 800
    width = deep / count
    temperature = np.zeros(2 * count)
    temperature[:count] = 1.0
    steps = int(np.ceil(time * 4e-6 / (0.4 * width**2)))
    number = time / steps * 4e-6 / width**2
    for _ in range(steps):
        temperature[1:-1] += number * np.diff(temperature, 2)
    heat = 3.75e6 * area * width * float(temperature[count:].sum())
    found = flat_exchange(mass, area, modulus, 15.0, 3.75e6, 15.0, 3.75e6)
    assert heat == pytest.approx(found, rel=2e-3)


def test_an_end_that_lands_while_the_other_lies_is_an_impact():
    """A rod that turns about one end: the other is new, though the pair is not."""
    model = prisms([[(rod(2.0), 0.2)]], FLOOR, ("floor",), gravity=(0.0, -9.81))
    angle = 0.01
    engine = coupled_engine(
        model, [[0.0, 0.2 + np.sin(angle), angle]], laws=LAWS, collisional=True, friction="none",
        conditions=[at_temperature(310.0)], force=ContactForce("prescribed", 1e-9),
    )  # fmt: skip
    engine.state.velocity[0] = [0.0, -1.0 * np.cos(angle), -1.0]
    found = []
    for k in range(30):
        engine.step(1e-3, 1e-3 * k)
        found.append(float(engine.contacts().conductance.max(initial=0.0)))
    assert (np.array(found[2:]) > 1e3 * min(h for h in found if h > 0.0)).sum() >= 1
