"""Grains that are no discs: packings without overlap, masses, angles, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from outline_brute import gap_of_cores, pieces_at, smallest_outline_gap
from scenarios import plane, scenario, toml
from shapes import shaped_engine, shaped_model, wall_line

from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.measures import measure
from multicor_cli.packing import build
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.store import RunDirectory, Snapshot

PENTAGON = {"kind": "polygon", "sides": 5}
SQUARE = {"kind": "polygon", "sides": 4}
CORNER = {
    "kind": "clump",
    "pieces": [
        {"vertices": [[0, 0], [3, 0], [3, 1], [0, 1]]},
        {"vertices": [[0, 0], [1, 0], [1, 3], [0, 3]], "radius": 0.1},
    ],
}
SHAPES = {
    "pentagons": PENTAGON,
    "rods": {"kind": "rod", "aspect": 3.0},
    "irregular": {
        "kind": "polygon",
        "sides": 6,
        "irregular": 0.8,
        "rounding": 0.1,
        "elongation": 1.5,
    },
    "triangles": {"kind": "polygon", "vertices": [[0, 0], [3, 0], [0, 4]]},
    "ellipses": {"kind": "ellipse", "aspect": 2.0},
    "corners": CORNER,
    "drawn": {
        "kind": "file",
        "grain": [1] * 8 + [2] * 7,
        "ring": [0] * 8 + [0] * 4 + [1] * 3,
        "x": [0, 3, 3, 2, 2, 3, 3, 0, 0, 4, 4, 0, 1, 1, 3],
        "y": [0, 0, 1, 1, 2, 2, 3, 3, 0, 0, 3, 3, 1, 2, 1],
    },
}
SIZES = {"kind": "uniform", "min": 0.8e-3, "max": 1.2e-3}
NO_WEIGHT = {"gravity": [0.0, 0.0]}


def made(shape=PENTAGON, packing=None, sizes=SIZES, size=0.03, **said):
    """Model and state of a scenario of one group."""
    size = size if isinstance(size, list) else [size, size]
    group = {
        "shape": shape,
        **({"sizes": sizes} if sizes else {}),
        "packing": packing or {"kind": "random"},
    }
    keys = {k: said.pop(k) for k in ("count", "fill", "orientation", "region") if k in said}
    if not {"count", "fill"} & keys.keys() and group["packing"]["kind"] == "random":
        keys["count"] = 20
    return build(scenario(grains=group | keys, size=size, walls=said.pop("walls", []), **said))


def refused(*args, **said):
    with pytest.raises(ScenarioError) as caught:
        made(*args, **said)
    return "; ".join(map(str, caught.value.problems))


# ---- Random packings


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(
    ("fill", "kind"), [(0.2, "box"), (0.6, "box"), (0.6, "period"), (0.6, "cell")]
)
def test_fill_is_reached_without_overlap(name, fill, kind):
    domain = {
        "box": {},
        "period": {"periodic": True},
        "cell": {"periodic": ["x", "y"], **NO_WEIGHT},
    }
    model, state = made(SHAPES[name], fill=fill, domain=domain[kind])
    assert model.area.sum() == pytest.approx(fill * 0.03**2, rel=0.01)
    assert smallest_outline_gap(model, state) >= -1e-12
    for grain in range(model.grain_count):
        for corners, r in pieces_at(model, state, grain):
            low, high = corners.min(axis=0) - r, corners.max(axis=0) + r
            axes = {"box": [0, 1], "period": [1], "cell": []}[kind]
            assert (low[axes] > -1e-9).all()
            assert (high[axes] < 0.03 + 1e-9).all()


@pytest.mark.parametrize(
    ("name", "fill"), [("pentagons", 0.74), ("rods", 0.8), ("ellipses", 0.8), ("corners", 0.6)]
)
def test_dense_packings_are_made(name, fill):
    model, state = made(SHAPES[name], fill=fill, domain={"periodic": True})
    assert smallest_outline_gap(model, state) >= -1e-12


def test_all_directions_are_alike_at_first():
    model, state = made(SHAPES["rods"], fill=0.15, size=0.08)
    assert model.grain_count > 400
    for order in (1, 2, 4):
        mean = np.exp(1j * order * state.position[:, 2]).mean()
        assert abs(mean) < 3.0 / math.sqrt(model.grain_count)


def test_the_same_seed_gives_the_same_bits_and_another_does_not():
    one, again, other = (
        made(fill=0.6, scenario={"name": "s", "seed": seed})[1] for seed in (1, 1, 2)
    )
    assert np.array_equal(one.position, again.position)
    assert not np.array_equal(one.position[:2], other.position[:2])


def test_a_gap_is_kept():
    model, state = made(PENTAGON, {"kind": "random", "separation": 0.2}, fill=0.4)
    assert smallest_outline_gap(model, state) >= 0.2 * 2 * model.grains.radius.mean() * (1 - 1e-9)


def test_angles_that_are_given_stay():
    model, state = made(SQUARE, fill=0.6, orientation={"kind": "fixed", "angle": 30.0})
    assert state.position[:, 2] == pytest.approx(math.pi / 6)
    assert smallest_outline_gap(model, state) >= -1e-12
    angles = [5.0 * k for k in range(20)]
    _, state = made(SQUARE, count=20, orientation={"kind": "list", "angles": angles})
    assert np.degrees(state.position[:, 2]) == pytest.approx(angles)
    text = refused(SQUARE, count=19, orientation={"kind": "list", "angles": angles})
    assert "particles.0.orientation.angles: 20 angles are given for 19 grains" in text


def test_what_does_not_fit_is_refused():
    text = refused(SQUARE, fill=0.89)
    assert "do not fit" in text
    assert "about" in text


def test_later_groups_and_walls_are_kept_clear_of():
    def group(name, shape):
        return {
            "name": name,
            "shape": shape,
            "sizes": SIZES,
            "fill": 0.06,
            "packing": {"kind": "random"},
        }

    model, state = build(scenario(
        particles=[group("a", PENTAGON), group("b", "disc"), group("c", SHAPES["rods"])],
        walls={"disc": {"kind": "disc", "center": [0.02, 0.02], "radius": 4e-3}}, size=[0.04, 0.04],
    ))  # fmt: skip
    assert smallest_outline_gap(model, state) >= -1e-12
    for grain in range(model.grain_count):
        for corners, r in pieces_at(model, state, grain):
            assert gap_of_cores(corners, np.array([[0.02, 0.02]])) - r >= 4e-3 - 1e-12
    outlines, discs = model.outlines, model.grains.group == 1
    assert np.array_equal(outlines.is_disc, discs)
    assert np.array_equal(outlines.radius, model.grains.radius)
    assert model.area[discs] == pytest.approx(np.pi * model.grains.radius[discs] ** 2)


def same_room(*shapes, **tables):
    """Model and state of groups that are placed at random in the same region, one after the other."""
    groups = [
        {"name": f"g{k}", "sizes": {"kind": "list", "radii": [1e-3]}, "packing": {"kind": "random"}}
        | shape
        for k, shape in enumerate(shapes)
    ]
    return build(scenario(particles=groups, size=[0.03, 0.03], **{"walls": [], **tables}))


NEEDLES = {
    "shape": {"kind": "rod", "aspect": 15.0}, "sizes": {"kind": "list", "radii": [3.5e-3]},
    "count": 50, "orientation": {"kind": "fixed", "angle": 80.0},
}  # fmt: skip


@pytest.mark.parametrize("kind", ["box", "period", "cell"])
@pytest.mark.parametrize("shape", ["disc", SQUARE])
def test_later_groups_fill_the_room_between_outlines(shape, kind):
    """The circles around the needles of the first group leave no room at all."""
    domain = {"periodic": ["x", "y"] if kind == "cell" else kind == "period"}
    if kind == "cell":
        domain["gravity"] = [0.0, 0.0]
    model, state = same_room(
        NEEDLES,
        {"shape": shape, "fill": 0.35, "sizes": {"kind": "list", "radii": [4e-4]}},
        domain=domain,
    )
    circles = np.pi * model.grains.radius[model.grains.group == 0] ** 2
    assert circles.sum() > 2.0 * 0.03**2
    assert model.area[model.grains.group == 1].sum() == pytest.approx(0.35 * 0.03**2, rel=0.01)
    assert smallest_outline_gap(model, state) >= -1e-12


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_later_groups_of_many_sizes_start_where_their_largest_fit(seed):
    """In cages between pentagons, where the smallest do, they would stay."""
    sizes = {"kind": "uniform", "min": 1.5e-4, "max": 5e-4}
    model, state = same_room(
        {"shape": PENTAGON, "sizes": {"kind": "list", "radii": [5e-4]}, "count": 430},
        {"shape": "disc", "sizes": sizes, "count": 110},
        domain={"periodic": False}, scenario={"seed": seed},
    )  # fmt: skip
    assert np.count_nonzero(model.grains.group == 1) == 110
    assert smallest_outline_gap(model, state) >= -1e-12


def test_walls_are_seen_by_the_outlines_of_grains():
    """Rods fill the corner between a line and the floor, where their circles do not fit."""
    line = {"kind": "polyline", "points": [[0.0, 2e-3], [0.03, 12e-3]]}
    rods = {"shape": {"kind": "rod", "aspect": 6.0}, "sizes": {"kind": "list", "radii": [3e-3]},
            "fill": 0.6}  # fmt: skip
    model, state = same_room(rods, walls={"line": line})
    gap, circle = [], []
    for grain in range(model.grain_count):
        ((corners, r),) = pieces_at(model, state, grain)
        gap.append(gap_of_cores(corners, np.array(line["points"])) - r)
        away = gap_of_cores(state.position[grain : grain + 1, :2], np.array(line["points"]))
        circle.append(away - model.grains.radius[grain])
    assert min(gap) > -1e-12
    assert np.count_nonzero(np.array(circle) < -1e-3) > 2
    assert smallest_outline_gap(model, state) >= -1e-12


# ---- Deposits


@pytest.mark.parametrize(("name", "kind"), [("pentagons", "box"), ("rods", "period")])
def test_deposits_lie_on_the_floor_without_overlap(name, kind):
    size, packing = [0.015, 0.03], {"kind": "deposited"}
    said = {"fill": 0.4, "domain": {"periodic": kind == "period"}, "size": size}
    model, state = made(SHAPES[name], packing, **said)
    assert smallest_outline_gap(model, state) >= -1e-12
    pieces = [pieces_at(model, state, k) for k in range(model.grain_count)]
    bottom = np.array([min(c[:, 1].min() - r for c, r in each) for each in pieces])
    top = np.array([max(c[:, 1].max() + r for c, r in each) for each in pieces])
    assert bottom.min() >= 0.0
    assert np.count_nonzero(bottom < 1e-2 * model.grains.radius.mean()) >= 5
    assert model.area.sum() / (size[0] * top.max()) > 0.7
    again = made(SHAPES[name], packing, **said)[1]
    assert np.array_equal(again.position, state.position)
    if kind == "period":
        return
    # Where it lies it stays, under gravity and friction
    walls = wall_line([[0.0, 1.0], [0.0, 0.0], [size[0], 0.0], [size[0], 1.0]])
    grains = [model.outlines.pieces(k) for k in range(model.grain_count)]
    engine = shaped_engine(shaped_model(grains, walls, ("box",), friction=0.5), state.position)
    for step in range(100):
        engine.step(1e-3, step * 1e-3)
    moved = np.hypot(*(engine.state.position - state.position)[:, :2].T)
    assert moved.max() < 0.2 * model.grains.radius.mean()


# ---- What grains are


def expected(outlines, grain):
    found = measure([outlines.pieces(grain)])
    return found.area[0], found.gyration[0], np.hypot(*found.center[0])


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("size", ["reach", "area"])
def test_masses_follow_from_areas_and_sizes_from_what_they_mean(name, size):
    model, _ = made({**SHAPES[name], "size": size}, count=12)
    lengths = model.grains.radius if size == "reach" else np.sqrt(model.area / np.pi)
    assert lengths.min() >= 0.8e-3 * (1 - 1e-12)
    assert lengths.max() <= 1.2e-3 * (1 + 1e-12)
    assert np.ptp(lengths) > 0.2e-3
    for grain in range(12):
        area, gyration, off = expected(model.outlines, grain)
        assert model.outlines.area[grain] == pytest.approx(area, rel=1e-12)
        assert off < 1e-12 * model.grains.radius[grain]
        mass = 2500.0 * 1e-3 * area
        assert model.grains.mass[grain] == pytest.approx(mass, rel=1e-12)
        assert model.grains.inertia[grain] == pytest.approx(mass * gyration, rel=1e-12)


DUMBBELL = {
    "kind": "clump",
    "pieces": [{"center": [0, 0], "radius": 1.0}, {"center": [4, 0], "radius": 1.0}],
}


@pytest.mark.parametrize("size", ["reach", "area"])
def test_masses_centers_and_inertias_are_those_given_by_hand(size):
    """A dumbbell whose bar has no part in outlines: 3 m beside m, 4 apart, center at 1."""
    by_hand = {"solid": 0.25, "center": [1.0, 0.0], "gyration": math.sqrt(3.0) / 4.0}
    model, _ = made({**DUMBBELL, "size": size, **by_hand}, count=12)
    plain, _ = made({**DUMBBELL, "size": size}, count=12)
    reach = model.grains.radius
    assert model.grains.mass == pytest.approx(0.25 * 2500.0 * 1e-3 * model.area, rel=1e-12)
    assert model.outlines.area == pytest.approx(2 * np.pi * (reach / 4.0) ** 2, rel=1e-12)
    # Two points 4 apart: (3/4)(1/4) 4² = 3, and it reaches 4 from the center of mass
    unit = reach / 4.0
    assert model.grains.inertia == pytest.approx(3.0 * unit**2 * model.grains.mass, rel=1e-12)
    assert model.spin_radius == pytest.approx(np.sqrt(2 * 3.0) * unit, rel=1e-12)
    for k in range(12):
        (left, a), (right, b) = model.outlines.pieces(k)
        assert [a, b] == pytest.approx([unit[k]] * 2)
        assert [left[0, 0], right[0, 0]] == pytest.approx([-unit[k], 3 * unit[k]])
    if size == "area":
        assert model.area == pytest.approx(plain.area)
    else:
        assert reach == pytest.approx(plain.grains.radius)


def test_mass_by_hand_is_that_of_heat_and_of_a_disc_too():
    heat = {"heat": {}, "materials": {"glass": {"density": 2500.0, "young": 7e10, "poisson": 0.2,
            "conductivity": 1.0, "heat_capacity": 800.0}}}  # fmt: skip
    for shape in (PENTAGON, {"kind": "rod", "aspect": 1.0}):
        half, full = (made({**shape, "solid": s}, count=5, **heat)[0] for s in (0.5, 1.0))
        assert half.grains.mass == pytest.approx(0.5 * full.grains.mass, rel=1e-14)
        assert half.grains.inertia == pytest.approx(0.5 * full.grains.inertia, rel=1e-14)
        assert half.thermal.capacity == pytest.approx(0.5 * full.thermal.capacity, rel=1e-14)
        assert np.array_equal(half.area, full.area)


def unit(shape):
    model, _ = made(shape, count=1, sizes={"kind": "list", "radii": [1e-3]}, size=0.1)
    ((corners, rounding),) = model.outlines.pieces(0)
    return corners * 1e3, rounding * 1e3


def test_shapes_are_what_their_keys_say():
    corners, rounding = unit({"kind": "polygon", "sides": 4, "elongation": 2.0})
    assert np.sort(corners, axis=0) == pytest.approx(
        np.sort([[2, -1], [2, 1], [-2, 1], [-2, -1]], axis=0) / math.sqrt(5)
    )
    assert rounding == 0.0
    corners, rounding = unit({"kind": "polygon", "sides": 6, "rounding": 0.2})
    assert np.hypot(*corners.T) == pytest.approx(0.8)
    assert rounding == pytest.approx(0.2)
    assert corners[:, 1].min() == pytest.approx(-0.8 * math.sqrt(0.75))  # it stands on a side
    assert np.count_nonzero(np.isclose(corners[:, 1], corners[:, 1].min())) == 2
    corners, rounding = unit({"kind": "rod", "aspect": 4.0})
    assert corners == pytest.approx(np.array([[-0.75, 0], [0.75, 0]]))
    assert rounding == pytest.approx(0.25)
    corners, _ = unit({"kind": "polygon", "vertices": [[0, 0], [0, 4], [3, 0], [1.5, 0]]})
    sides = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    assert sorted(sides / sides.max()) == pytest.approx(
        [0.6, 0.8, 1.0]
    )  # turned, without the fourth


@pytest.mark.parametrize("sides", [8, 32])
def test_sides_of_an_ellipse_touch_it(sides):
    a, b = 1.0, 0.4
    corners, rounding = unit({"kind": "ellipse", "aspect": 2.5, "sides": sides})
    assert rounding == pytest.approx(b * b / a)
    angle = np.linspace(0, 2 * np.pi, 720 * sides, endpoint=False)
    n = np.column_stack([np.cos(angle), np.sin(angle)])
    support, true = (corners @ n.T).max(axis=0) + rounding, np.hypot(a * n[:, 0], b * n[:, 1])
    gap = true - support
    assert gap.min() > -1e-12
    assert gap[::720] == pytest.approx(0.0, abs=1e-12)  # at its corners
    assert gap.max() < (a * a / b - b * b / a) * (1 - math.cos(math.pi / sides))


def test_irregular_grains_differ_and_are_convex():
    model, _ = made({"kind": "polygon", "sides": 5, "irregular": 0.9}, count=40)
    shares = model.area / (np.pi * model.grains.radius**2)
    assert np.ptp(shares) > 0.05
    for grain in range(40):
        ((corners, _),) = model.outlines.pieces(grain)
        side = np.roll(corners, -1, axis=0) - corners
        after = np.roll(side, -1, axis=0)
        assert (side[:, 0] * after[:, 1] - side[:, 1] * after[:, 0] > 0).all()


@pytest.mark.parametrize(
    "shape",
    [{"kind": "disc"}, {"kind": "rod", "aspect": 1.0}, {"kind": "ellipse", "aspect": 1.0},
     {"kind": "clump", "pieces": [{"center": [3.0, 1.0], "radius": 2.0}]}],
)  # fmt: skip
@pytest.mark.parametrize("packing", ["random", "deposited"])
def test_what_is_a_disc_has_the_bits_of_one(shape, packing):
    given = {"packing": {"kind": packing}, "count": 30}
    (model, state), (disc, at) = made(shape, **given), made("disc", **given)
    assert model.outlines is None
    for name, value in vars(disc.grains).items():
        assert np.array_equal(value, getattr(model.grains, name)), name
    assert state.digest() == at.digest()


# ---- Other packings


@pytest.mark.parametrize("name", ["pentagons", "irregular", "corners"])
@pytest.mark.parametrize("size", ["reach", "area"])
def test_a_lattice_is_filled(name, size):
    shape = {**SHAPES[name], "size": size}
    model, state = made(shape, {"kind": "lattice", "lattice": "triangular"})
    assert model.grain_count > 30
    assert smallest_outline_gap(model, state) >= -1e-12
    assert np.ptp(state.position[:, 2]) > 5.0


def test_tiles_repeat_outlines_and_angles():
    packing = {
        "kind": "tile",
        "source": {"kind": "random"},
        "tile": [0.015, 0.015],
        "repeat": [2, 2],
        "tile_fill": 0.5,
    }
    model, state = made(SHAPES["irregular"], packing, domain={"periodic": True})
    assert smallest_outline_gap(model, state) >= -1e-12
    angles, counts = np.unique(state.position[:, 2], return_counts=True)
    assert counts.max() >= 2
    same = np.flatnonzero(state.position[:, 2] == angles[counts.argmax()])
    shapes = {model.outlines.pieces(int(k))[0][0].tobytes() for k in same}
    assert len(shapes) == 1


def test_a_file_brings_places_sizes_and_angles(tmp_path):
    path = tmp_path / "grains.csv"
    path.write_text("x,y,radius,angle\n0.01,0.01,1e-3,0.5\n0.02,0.01,2e-3,-1\n")
    model, state = made(SQUARE, {"kind": "file", "path": str(path)}, sizes=None, walls=[])
    assert state.position == pytest.approx(np.array([[0.01, 0.01, 0.5], [0.02, 0.01, -1.0]]))
    assert model.grains.radius == pytest.approx([1e-3, 2e-3])
    assert model.area == pytest.approx([2e-6, 8e-6])


def test_compacted_grains_lie_on_each_other():
    packing = {"kind": "compacted", "pressure": 50.0, "friction": 0.0}
    model, state = made(PENTAGON, packing, fill=0.5, domain={"periodic": True}, size=0.02)
    assert smallest_outline_gap(model, state) > -1e-3 * model.grains.radius.min()
    top = max(
        c[:, 1].max() for k in range(model.grain_count) for c, _ in pieces_at(model, state, k)
    )
    assert 0.75 < model.area.sum() / (0.02 * top) < 0.9


DRAWN = """grain,x,y
1,10,0
1,14,0
1,14,2
1,10,2
7,10,2
7,14,2
7,12,6
"""


def test_outlines_are_placed_as_drawn(tmp_path):
    path = tmp_path / "outlines.csv"
    path.write_text(DRAWN)
    shape = {"kind": "file", "file": str(path)}
    packing = {"kind": "outlines", "scale": 1e-3, "shift": [0.001, 0.002]}
    model, state = made(shape, packing, sizes=None)
    assert state.position == pytest.approx(
        np.array([[0.013, 0.003, 0], [0.013, 0.002 + 2e-3 + 4e-3 / 3, 0]])
    )
    assert model.area == pytest.approx([8e-6, 8e-6])
    ((corners, _),) = pieces_at(model, state, 1)
    assert corners == pytest.approx(np.array([[11, 4], [15, 4], [13, 8]]) * 1e-3)
    # The same outlines in turn, at random
    model, _ = made(shape, count=5)
    assert [len(model.outlines.pieces(k)[0][0]) for k in range(5)] == [4, 3, 4, 3, 4]


def test_grains_wait_for_their_release_with_outlines_and_angles():
    table = {"shape": PENTAGON, "sizes": SIZES, "count": 10,
             "release": {"rate": 100.0, "region": {"min": [0.005, 0.02], "max": [0.025, 0.03]}}}  # fmt: skip
    model, state = build(scenario(particles=[table], size=[0.03, 0.03]))
    assert model.outlines.fit(10)
    assert np.ptp(state.position[:, 2]) > 1.0


# ---- Overlaps at the start


def rows(tmp_path, *grains):
    path = tmp_path / "grains.csv"
    path.write_text(
        "x,y,radius,angle\n" + "".join(",".join(map(repr, row)) + "\n" for row in grains)
    )
    return {"packing": {"kind": "file", "path": str(path)}, "sizes": None}


def test_circles_may_overlap_where_outlines_do_not(tmp_path):
    side = math.sqrt(2) * 1e-3
    stack = [
        (0.01 + k * side, 0.5 * side + row * side, 1e-3, 0.0) for k in range(3) for row in range(3)
    ]
    model, _ = made(SQUARE, walls={"floor": plane(), "side": {"kind": "plane", "point": [0.01 - side / 2, 0], "normal": [1, 0]}},
                    **rows(tmp_path, *stack))  # fmt: skip
    assert model.grain_count == 9


def test_outlines_that_overlap_are_refused(tmp_path):
    side = math.sqrt(2) * 1e-3
    pair = [(0.01, 0.01, 1e-3, 0.0), (0.01 + 0.99 * side, 0.01, 1e-3, 0.0)]
    text = refused(SQUARE, **rows(tmp_path, *pair))
    assert "grains 1 and 2 of 'grains' by 1.41e-05 m (1.41 % of the smaller radius)" in text
    assert "move them apart in their file" in text
    text = refused(
        SQUARE,
        walls={"floor": plane(0.01)},
        **rows(tmp_path, (0.01, 0.01 + 0.49 * side, 1e-3, 0.0)),
    )
    assert "the wall 'floor' cuts grains at the start: grain 1 of 'grains' by 1.41e-05 m" in text
    line = {"kind": "polyline", "points": [[0.01, 0.005], [0.01, 0.0098]]}
    text = refused(SQUARE, walls={"line": line}, **rows(tmp_path, (0.01, 0.01, 1e-3, 0.0)))
    assert "'line' cuts grains" in text
    made(SQUARE, walls={"line": line}, **rows(tmp_path, (0.01, 0.0098 + 0.5 * side, 1e-3, 0.0)))


def test_outlines_of_a_file_are_told_by_its_numbers_and_keys():
    """They can be moved in the file, by shift and by scale alone."""
    drawn = {
        "kind": "file",
        "grain": [3] * 4 + [7] * 4,
        "x": [0, 4, 4, 0, 3, 7, 7, 3],
        "y": [0, 0, 4, 4] * 2,
    }
    given = {"shape": drawn, "sizes": None}
    text = refused(**given, packing={"kind": "outlines", "scale": 1e-3, "shift": [0.01, 0.01]})
    assert "grains 3 and 7 of 'grains' by 0.001 m" in text
    assert text.endswith("move them apart in the file of their outlines")
    drawn["x"] = [0, 4, 4, 0, 5, 9, 9, 5]
    packing = {"kind": "outlines", "scale": 1e-3, "shift": [0.01, -0.001]}
    text = refused(**given, packing=packing, walls={"floor": plane()})
    assert "grain 3 of 'grains' by 0.001 m" in text
    assert "move the grains by shift, or draw them smaller by scale, in their packing" in text


def test_long_thin_grains_side_by_side_are_no_crowd(tmp_path):
    rods = [(0.01 + 1e-4 * k, 0.01, 2e-3, math.pi / 2) for k in range(60)]
    shape = {"kind": "rod", "aspect": 40.0}
    model, _ = made(shape, **rows(tmp_path, *rods))
    assert model.grain_count == 60
    rods[40] = (0.01 + 1e-4 * 40.2, 0.01, 2e-3, math.pi / 2)
    assert "grains 41 and 42" in refused(shape, **rows(tmp_path, *rods))


WALLS = {
    "segment": {"kind": "polyline", "points": [[0.012, 0.011], [0.018, 0.013]]},
    "polygon": {"kind": "polygon", "grains": "outside", "points": [[0.012, 0.011], [0.018, 0.013], [0.016, 0.019]]},
    "disc": {"kind": "disc", "center": [0.015, 0.014], "radius": 2e-3},
    "circle": {"kind": "circle", "center": [0.015, 0.015], "radius": 6e-3},
    "plane": {"kind": "plane", "point": [0.01, 0.01], "normal": [3.0, 4.0]},
}  # fmt: skip


def gap_to_wall(name, pieces):
    """Signed distance of a clump to a wall [m], by all directions."""
    cores = {
        "segment": WALLS["segment"]["points"],
        "polygon": WALLS["polygon"]["points"],
        "disc": [[0.015, 0.014]],
    }
    if name in cores:
        wide = 2e-3 if name == "disc" else 0.0
        return min(gap_of_cores(c, np.array(cores[name])) - r for c, r in pieces) - wide
    if name == "circle":
        return min(6e-3 - np.hypot(*(c - 0.015).T).max() - r for c, r in pieces)
    return min(((c - 0.01) @ [0.6, 0.8]).min() - r for c, r in pieces)


@pytest.mark.parametrize("wall", WALLS)
@pytest.mark.parametrize("name", ["pentagons", "rods", "triangles", "corners"])
def test_walls_cut_grains_that_overlap_them_and_no_others(name, wall, tmp_path):
    rng, seen = np.random.default_rng(5), []
    while len(seen) < 12:
        at = [*rng.uniform(0.01, 0.02, 2).tolist(), 1.5e-3, rng.uniform(0, 6)]
        given = rows(tmp_path, tuple(at))
        model, state = made(SHAPES[name], **given)
        gap = gap_to_wall(wall, pieces_at(model, state, 0)) / 1.5e-3
        if abs(gap) > 0.3 or abs(gap + 1e-3) < 1e-4:
            continue  # nothing near, or just at the limit
        seen.append(gap)
        if gap > -1e-3:
            made(SHAPES[name], walls={"wall": WALLS[wall]}, **given)
        else:
            assert "'wall'" in refused(SHAPES[name], walls={"wall": WALLS[wall]}, **given)
    assert min(seen) < -1e-3 < max(seen)


def test_images_overlap_across_the_sides_of_a_period_and_of_a_cell(tmp_path):
    side = math.sqrt(2) * 1e-3
    for domain, second in (
        ({"periodic": True}, (0.03 - 0.495 * side, 0.01)),
        ({"periodic": ["x", "y"], **NO_WEIGHT}, (0.03 - 0.495 * side, 0.03 - 0.1 * side)),
    ):
        pair = [(0.495 * side, 0.01 if domain["periodic"] is True else 0.3 * side, 1e-3, 0.0)]
        grains = rows(tmp_path, *pair, (*second, 1e-3, 0.0))
        assert "grains overlap at the start" in refused(SQUARE, domain=domain, **grains)
        grains = rows(tmp_path, *pair, (second[0] - 0.011 * side, second[1], 1e-3, 0.0))
        made(SQUARE, domain=domain, **grains)


# ---- Grains of other runs


def group(name, shape, **keys):
    return {
        "name": name,
        "shape": shape,
        "sizes": SIZES,
        "count": 8,
        "packing": {"kind": "random"},
    } | keys


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """A run of two groups that has ended where it began, and its model and state."""
    path = tmp_path_factory.mktemp("earlier") / "run"
    given = scenario(
        particles=[group("a", CORNER), group("b", "disc")], size=[0.03, 0.03], walls=[]
    )
    model, state = build(given)
    resolved = given.resolved_toml()
    with RunDirectory.create(path, resolved, resolved, {"seed": 1}, stages=("only",)) as directory:
        writer = directory.writer(model)
        contacts = replace(ContactTable.empty(), arm=np.zeros((0, 2)))
        writer.frame(Snapshot(state, model, contacts))
        writer.series_row(Snapshot(state, model))
        directory.checkpoint(state, writer)
        directory.finish("finished")
    return path, model, state


def same_grains(found, wanted):
    for name, value in vars(wanted.grains).items():
        assert np.array_equal(value, getattr(found.grains, name)) or name in (
            "group",
            "material",
        ), name
    for a, b in zip(found.outlines, wanted.outlines, strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("frame", [None, 0])
def test_a_run_goes_on_with_the_same_grains_to_the_bit(earlier, frame):
    path, model, state = earlier
    start = {"run": str(path)} | ({} if frame is None else {"frame": frame})
    tables = {"start": start, "particles": [], "size": [0.03, 0.03], "walls": []}
    document = toml(**tables).replace("particles = []\n", "")
    found, at = build(parse_scenario(document, "scene.toml"))
    same_grains(found, model)
    assert np.array_equal(at.position, state.position)


def test_another_shape_than_that_of_the_run_is_refused(earlier):
    path, _, _ = earlier
    kept = {"packing": {"kind": "start"}, "sizes": SIZES}
    for a, b, key, words in (
        ("disc", "disc", "particles.0.shape", "are no discs, but the shape says discs"),
        (CORNER, PENTAGON, "particles.1.shape", "are discs, but the shape says other outlines"),
    ):
        tables = [{"name": "a", "shape": a, **kept}, {"name": "b", "shape": b, **kept}]
        with pytest.raises(ScenarioError) as caught:
            build(scenario(particles=tables, start={"run": str(path)}, size=[0.03, 0.03], walls=[]))
        (problem,) = caught.value.problems
        assert problem.key == key
        assert words in str(problem)


def test_grains_of_a_frame_bring_their_outlines(earlier):
    path, model, state = earlier
    packing = {"kind": "run", "path": str(path)}
    found, at = made(CORNER, packing, sizes=None)
    same_grains(found, model)
    assert np.array_equal(at.position, state.position)
    assert "no discs" in refused("disc", packing, sizes=None)
