"""Coarse-grained fields against closed forms, plain loops and the balance of momentum."""

import numpy as np
import pytest
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, fields
from multicor_cli.post.coarse import CoarseGrid
from multicor_cli.post.fields import Blocks
from multicor_cli.post.lattice import Lattice

ALL = Selection(frames=slice(None))
FIRST = Selection(frames=slice(0, 1))


def lattice(spacing, size, middle=(0.0, 0.0)):
    line = np.arange(-size, size + 0.5 * spacing, spacing)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2) + middle


def moving(position, velocity, radius, spin=0.0, **model):
    """Grains of one size with the velocities of several frames that stay where they are."""
    n = len(position)
    frames = [frame_of(position, walls=1, velocity=v, spin=np.full(n, spin)) for v in velocity]
    return source_of(make_model(np.full(n, radius), **model), frames)


def test_the_kernel_has_the_integral_one_and_its_slope():
    points = lattice(0.02, 1.1)
    coarse = CoarseGrid(points, 0.9)
    found = coarse.of_grains(np.array([[0.03, -0.04]]), np.ones((1, 1)), slice(0, 1))
    density, slope = (field[:, 0] for field in found)
    assert density.sum() * 0.02**2 == pytest.approx(1.0, abs=1e-6)
    across = density.reshape(111, 111)
    slope = slope.reshape(111, 111, 2)
    rise = np.stack([np.gradient(across, 0.02, axis=axis) for axis in (1, 0)], axis=-1)
    assert slope[1:-1, 1:-1] == pytest.approx(rise[1:-1, 1:-1], abs=0.02)


@pytest.mark.parametrize("sides", [Lattice(), Lattice(2.0), Lattice(2.0, 2.6, 0.9)])
def test_densities_agree_with_plain_loops(sides):
    rng = np.random.default_rng(4)
    points = rng.uniform((0.0, -1.0), (2.0, 1.0), (300, 2))
    position = sides.wrapped(rng.uniform((0.0, -1.3), (2.0, 1.3), (200, 2)))
    values, reach, kernel = rng.normal(size=(200, 2)), 0.4, np.zeros((300, 200))
    images = [(a, b) for a in range(-2, 3) for b in range(-2, 3)]
    for a, b in images if sides.height else images[2::5] if sides.width else [(0, 0)]:
        move = (a * sides.width + b * sides.tilt, b * sides.height)
        q = np.hypot(*np.moveaxis(points[:, np.newaxis] - position - move, -1, 0)) / reach
        inner = 5.0 / (np.pi * reach**2) * (1.0 + 3.0 * q) * (1.0 - q) ** 3
        kernel += np.where(q < 1.0, inner, 0.0)
    found, _ = CoarseGrid(points, reach, sides).of_grains(position, values)
    assert found == pytest.approx(kernel @ values, abs=1e-10)


def test_few_points_and_sources_far_away():
    coarse = CoarseGrid(np.array([[0.0, 0.0]]), 1.0)
    far = np.array([[5.0, 0.0], [0.0, -7.0], [0.0, 0.99]])
    found, _ = coarse.of_grains(far, np.ones((3, 1)))
    assert found[0, 0] == pytest.approx(5.0 / np.pi * 3.97 * 0.01**3)
    assert coarse.of_grains(np.zeros((0, 2)), np.ones((0, 3)))[0].tolist() == [[0.0, 0.0, 0.0]]


def test_a_linear_flow_has_its_gradients():
    """Grains on a fine lattice with v = (3y + x, 2x − y) and, from frame to frame, opposite
    fluctuations of 0.1 in x."""
    position = lattice(0.05, 2.0)
    x, y = position.T
    aside = np.array([0.1, 0.0])
    mean = np.column_stack([3.0 * y + x, 2.0 * x - y])
    source = moving(position, np.array([mean + aside, mean - aside]), 0.02, spin=-7.0)
    table = fields(source, selection=ALL, along=((-1.0, -0.5), (1.0, 0.5)), spacing=2.0, reach=10.0)
    at = table.points.at
    assert table.values["velocity-x"] == pytest.approx(3.0 * at[:, 1] + at[:, 0], abs=2e-3)
    assert table.values["velocity-y"] == pytest.approx(2.0 * at[:, 0] - at[:, 1], abs=2e-3)
    rates = {"xx": 1.0, "xy": 2.5, "yy": -1.0}
    expected = {f"strain-rate-{axes}": rate for axes, rate in rates.items()}
    expected |= {"vorticity": -1.0, "spin": -7.0, "shear-rate": np.hypot(2.0, 5.0)}
    for name, value in expected.items():
        assert table.values[name] == pytest.approx(np.full(len(at), value), rel=5e-3), name
    # The gradient across the kernel counts as fluctuation, by the second moment of the kernel, here
    # by quadrature.
    r = (np.arange(2000) + 0.5) / 2000.0
    kernel = 5.0 / np.pi * (1.0 + 3.0 * r) * (1.0 - r) ** 3
    second = 0.5 * (kernel * r**2 * 2.0 * np.pi * r).mean() * table.reach**2
    stress = table.values["solid-fraction"] * (0.01 + 10.0 * second)
    assert table.values["kinetic-stress-xx"] == pytest.approx(stress, rel=0.02)
    temperature = np.full(len(at), 0.005 + 7.5 * second)
    assert table.values["granular-temperature"] == pytest.approx(temperature, rel=0.02)
    # Two rows: half their distance
    assert table.error["velocity-x"] == pytest.approx(np.full(len(at), 0.1), rel=1e-6)


def test_a_rigid_rotation_in_polar_coordinates():
    position = lattice(0.04, 1.0, (3.0, -2.0))
    position = position[np.hypot(*(position - [3.0, -2.0]).T) < 1.0]
    away = position - [3.0, -2.0]
    turning = 4.0 * np.column_stack([-away[:, 1], away[:, 0]])
    source, wide = moving(position, turning[np.newaxis], 0.018), {"spacing": 2.0, "reach": 8.0}
    table = fields(source, selection=ALL, center=(3.0, -2.0), is_radial=True, **wide)
    r = table.points.coordinates[:, 0]
    assert table.headings[0] == "r [m]"
    assert np.abs(table.values["velocity-r"]).max() < 1e-3
    inner = r < 0.7
    assert table.values["velocity-t"][inner] == pytest.approx(4.0 * r[inner], abs=0.01)
    assert table.values["vorticity"][inner] == pytest.approx(np.full(inner.sum(), 8.0), rel=0.01)
    assert np.abs(table.values["shear-rate"][inner]).max() < 0.1
    plane = fields(source, selection=ALL, center=(3.0, -2.0), **wide)
    around = plane.values["velocity-t"].reshape(plane.points.shape)[inner]
    expected = np.repeat(4.0 * r[inner, np.newaxis], around.shape[1], axis=1)
    assert around == pytest.approx(expected, abs=0.01)
    assert all(np.isnan(error).all() for error in plane.error.values())
    assert table.note == ""
    aside = fields(source, selection=ALL, center=(3.4, -2.0), is_radial=True, **wide)
    beyond = float(aside.note.partition("r = ")[2].split()[0])
    # The box of the grains ends 0.6 to the right of that center; rings are 0.072 apart.
    assert 0.6 < beyond < 0.6 + 3.0 * 0.072


def test_a_vector_stands_for_its_components_along_a_line_and_is_refused_on_a_grid():
    source = moving(lattice(0.1, 1.0), np.zeros((1, len(lattice(0.1, 1.0)), 2)), 0.04)
    names = ["velocity", "speed", "kinetic-stress"]
    line = fields(source, names, ALL, along=((-0.5, 0.0), (0.5, 0.0)))
    assert [field.name for field in line.of] == [
        "velocity-x", "velocity-y", "speed", "kinetic-stress-xx", "kinetic-stress-xy",
        "kinetic-stress-yy",
    ]  # fmt: skip
    with pytest.raises(
        PostError, match="'velocity' has several components: choose one of velocity-x, velocity-y"
    ):
        fields(source, ["velocity"], ALL)
    with pytest.raises(PostError, match="no field 'velo'"):
        fields(source, ["velo"], ALL)


def test_a_grid_holds_all_area_and_momentum():
    rng = np.random.default_rng(7)
    position = rng.uniform((0.0, 0.5), (4.0, 1.5), (50, 2))
    source = moving(position, rng.normal(size=(1, 50, 2)), 0.1, period=4.0)
    more = np.concatenate([position, [[1.0, -3.0], [1.0, 5.0]]])
    wide = moving(more, np.zeros((1, 52, 2)), 0.1, period=4.0)
    table = fields(wide, selection=ALL, spacing=0.2, reach=3.0)
    cell = np.prod([edges[1] - edges[0] for edges in table.points.edges])
    held = table.values["solid-fraction"].sum() * cell
    assert held == pytest.approx(51.5 * np.pi * 0.01, rel=0.01)  # the two at the ends stick out
    assert table.points.edges[0][[0, -1]].tolist() == [0.0, 4.0]
    row = {name: value for name, *value in table.rows}
    assert row["solid fraction [1]"][2] == table.values["solid-fraction"].max()
    assert len(table.detail_rows) == table.values["speed"].size
    assert len(table.detail_rows[0]) == len(table.detail_headings)
    assert np.isfinite(fields(source, selection=ALL).values["velocity-x"]).any()


def pair(force):
    """Two grains of radius 1 that touch at the origin, and the force on the right one."""
    contacts = contacts_of([1], [0], (1.0, 0.0), force)
    frame = frame_of([[-1.0, 0.0], [1.0, 0.0]], walls=1, contacts=contacts)
    return source_of(make_model(np.ones(2)), [frame])


@pytest.mark.parametrize(("reach", "tolerance"), [(1.5, 2e-3), (4.0, 2e-4)])
def test_stress_obeys_the_balance_of_momentum(reach, tolerance):
    """Σ_b ∂_b σ_ab is minus the density of the forces on the grains, f φ(x − x_i), but for the
    differences that stand for ∂."""
    source, f, step = pair((2.0, 0.5)), np.array([2.0, 0.5]), 1e-3

    def moved(dx, dy):
        line = ((-2.0 + dx, -0.3 + dy), (2.0 + dx, 0.9 + dy))
        return fields(source, selection=ALL, along=line, spacing=0.1, reach=reach)

    shifts = ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step))
    right, left, above, below = (moved(*shift).values for shift in shifts)
    points = CoarseGrid(moved(0.0, 0.0).points.at, 2.0 * reach)
    force, _ = points.of_grains(np.array([[-1.0, 0.0], [1.0, 0.0]]), np.array([-f, f]))
    for a, axis in enumerate("xy"):
        across, upwards = f"stress-{axis}x", f"stress-{axis}y"
        divergence = (right[across] - left[across] + above[upwards] - below[upwards]) / (2.0 * step)
        assert divergence == pytest.approx(-force[:, a], abs=tolerance * np.abs(force).max())


def test_stress_adds_up_to_the_virial_and_turns_with_the_axes():
    source = pair((2.0, 0.5))
    line = fields(source, selection=ALL, along=((-8.0, 0.0), (8.0, 0.0)), reach=1.0)
    assert set(line.values) >= {"stress-xx", "stress-yx", "pressure"}
    ring = fields(source, ["stress-tt"], ALL, center=(0.0, 0.0), spacing=0.2, reach=1.0)
    assert ring.of[0].name == "stress-tt"
    trace = ring.values["stress-rr"] + ring.values["stress-tt"]
    assert 0.5 * trace == pytest.approx(ring.values["pressure"])
    radius, turns = ring.points.edges
    cells = ring.points.coordinates[:, 0] * (radius[1] - radius[0]) * (turns[1] - turns[0])
    angle = ring.points.turn
    c, s = np.cos(angle), np.sin(angle)
    rr, rt, tr, tt = (ring.values[f"stress-{name}"] for name in ("rr", "rt", "tr", "tt"))
    xx = c * c * rr - c * s * (rt + tr) + s * s * tt
    yx = c * s * rr - s * s * rt + c * c * tr - c * s * tt
    lost = 0.97  # the kernel of the outer grains reaches beyond the outermost ring
    assert lost * 4.0 < (xx * cells).sum() <= 4.0 * 1.001
    assert (yx * cells).sum() == pytest.approx(0.25 * (xx * cells).sum(), rel=1e-3)


def test_what_cannot_be_is_refused():
    source = moving(np.array([[0.5, 0.5], [1.0, 0.5]]), np.zeros((1, 2, 2)), 0.1, period=4.0)
    for words, message in (
        ({"of": ["wetness"]}, "no field 'wetness'"),
        ({"spacing": 0.0}, "above 0"),
        ({"reach": np.inf}, "above 0"),
        ({"reach": 1e300}, "to 10000"),
        ({"of": ["pressure"]}, "no field 'pressure' here"),
        ({"reach": 30.0}, "beyond the period"),
        ({"is_radial": True}, "rings need a center"),
        ({"along": ((1.0, 1.0), (1.0, 1.0))}, "no length"),
        ({"spacing": 1e-5}, "choose a larger spacing"),
    ):
        with pytest.raises(PostError, match=message):
            fields(source, selection=FIRST, **words)


def test_local_rheology_of_a_square_lattice():
    """Contacts along the axes: σ_xx, σ_yy and σ_xy are their forces over the distance of the grains;
    slow shear adds nothing to them. The density of the grains is 3."""
    size, rate, (across, upwards, shear) = 12, 1e-3, (5.0, 9.0, -2.0)
    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    position = np.column_stack([x.ravel(), y.ravel()])
    k = np.arange(size**2)
    right = k - k % size + (k + 1) % size
    above = k[:-size]
    i, j = np.concatenate([k, above]), np.concatenate([right, above + size])
    normal = np.concatenate(
        [np.tile([-1.0, 0.0], (k.size, 1)), np.tile([0.0, -1.0], (above.size, 1))]
    )
    force = np.concatenate(
        [np.tile([across, shear], (k.size, 1)), np.tile([upwards, -shear], (above.size, 1))]
    )
    velocity = np.column_stack([rate * position[:, 1], 0.0 * k])
    frame = frame_of(
        position, walls=1, velocity=velocity, contacts=contacts_of(i, j, normal, force)
    )
    model = make_model(np.full(k.size, 0.5), period=float(size), density=3.0)
    table = fields(source_of(model, [frame]), along=((3.0, 6.0), (9.0, 6.0)), reach=4.0)
    values = {name: np.mean(value) for name, value in table.values.items()}
    assert values["stress-xy"] == pytest.approx(shear, rel=1e-3)
    pressure, tau = 7.0, np.hypot(2.0, 2.0)
    assert values["friction"] == pytest.approx(tau / pressure, rel=2e-3)
    assert values["inertial-number"] == pytest.approx(rate * np.sqrt(3.0 / pressure), rel=2e-3)
    assert values["fluidity"] == pytest.approx(rate * pressure / tau, rel=2e-3)
    # Grains that have shrunk by a tenth and kept their mass: d̄ √ρ stays, and so does I √P
    frame.model = model.with_radius(0.9 * model.grains.radius, np.zeros(k.size))
    table = fields(source_of(model, [frame]), along=((3.0, 6.0), (9.0, 6.0)), reach=4.0)
    smaller = {name: np.mean(value) for name, value in table.values.items()}
    assert smaller["inertial-number"] * np.sqrt(smaller["pressure"]) == pytest.approx(
        values["inertial-number"] * np.sqrt(values["pressure"]), rel=1e-3
    )


# --- standard errors of grids


def remembering(count, period=6.0):
    """Frames of a lattice whose velocities are autoregressive, of a rest ½ from frame to frame."""
    random = np.random.default_rng(7)
    x, y = np.meshgrid(np.arange(6.0) + 0.5, np.arange(4.0) + 0.5)
    position = np.column_stack([x.ravel(), y.ravel()])
    velocity = random.normal(size=(24, 2))
    frames = []
    for _ in range(count):
        velocity = 0.5 * velocity + np.sqrt(0.75) * random.normal(size=(24, 2))
        frames.append(frame_of(position, walls=1, velocity=velocity + np.array([2.0, 0.0])))
    return source_of(make_model(np.full(24, 0.5), period=period), frames)


def on_both(source):
    """Errors in the lowest row of a grid and on a line through its points."""
    grid = fields(source, selection=ALL, spacing=1.0)
    row = grid.points.at[: grid.points.shape[1]]
    line = fields(source, selection=ALL, spacing=1.0, along=(tuple(row[0]), tuple(row[-1])))
    return grid, {name: (grid.error[name][: len(row)], line.error[name]) for name in line.error}


def test_errors_of_a_grid_are_those_of_a_line():
    """Where there are no more frames than sums, to rounding."""
    table, both = on_both(remembering(50))
    for name, (of_grid, of_line) in both.items():
        assert of_grid == pytest.approx(of_line, rel=1e-6, nan_ok=True), name
    assert np.isfinite(table.error["velocity-x"]).all()
    assert np.shape(table.as_dict()["standard_error"]["velocity-x"]) == table.points.shape
    names = table.detail_headings
    assert len(names) == 2 + 2 * len(table.fields)
    assert "error of velocity-x [m/s]" in names
    relative = dict(
        zip((row[0] for row in table.rows), (row[-1] for row in table.rows), strict=True)
    )
    expected = np.median(table.error["velocity-x"] / table.values["velocity-x"])
    assert relative["horizontal velocity [m/s]"] == pytest.approx(expected)


def test_errors_of_many_frames_come_from_blocks(monkeypatch):
    """200 frames in 8 to 16 blocks: a sixth of them scatters about as much as twelve values do."""
    monkeypatch.setitem(fields.__globals__, "_FEWEST_AND_MOST", (16, 16))
    _, both = on_both(remembering(200))
    of_grid, of_line = both["velocity-x"]
    ratio = of_grid / of_line
    assert 0.7 < np.median(ratio) < 1.3
    assert ratio.min() > 0.3
    assert ratio.max() < 2.5
    rows = np.arange(75.0).reshape(25, 3)
    blocks = Blocks(4)
    for row in rows:
        blocks.add(row)
    assert (blocks.size, len(blocks.rows)) == (8, 3)
    assert np.array(blocks.rows) == pytest.approx(rows[:24].reshape(3, 8, 3).sum(axis=1))
    assert blocks.total == pytest.approx(rows.sum(axis=0))
