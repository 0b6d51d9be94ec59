"""Tables of a cell that is periodic in x and y: three grains by hand, and flows in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest
from cells import make_cell, strained
from made_up_frames import contacts_of, frame_of, source_of

from multicor_cli import post
from multicor_cli.model.cell import over_windows
from multicor_cli.model.shapes import Rectangle
from multicor_cli.post.bulk import CONTACT_SUMS
from multicor_cli.post.crossings import flow_through

WIDTH, HEIGHT, TILT = 4.0, 3.0, 1.2
SIDES = np.array([WIDTH, HEIGHT, TILT])
GRADIENT = np.array([0.1, -0.2, 0.7])
"""Of the mean flow: xx, yy, xy [1/s]."""
L = np.array([[0.1, 0.7], [0.0, -0.2]])
ALL = post.Selection(frames=slice(None))


def cell_frame(position, slip, **said):
    velocity = np.array(position) @ L.T + slip
    sides, gradient = said.pop("sides", SIDES), GRADIENT
    count = len(position)
    return frame_of(
        position, velocity=velocity, wall_position=sides[np.newaxis],
        wall_velocity=gradient[np.newaxis], angle=said.pop("angle", np.zeros(count)), **said,
    )  # fmt: skip


def flowing(count=60, slip=0.0, seed=2):
    """Grains anywhere in a cell, that may overlap; frames have equal grains."""
    random = np.random.default_rng(seed)
    position = random.uniform((0.0, 0.0), (WIDTH, HEIGHT), (count, 2))
    model, _ = make_cell(position, random.uniform(0.1, 0.3, count), (5.0, 3.5))
    slips = slip * random.normal(size=(3, count, 2))
    return source_of(model, [cell_frame(position, each) for each in slips])


def all_images(source, frame):
    """Numbers and places of the grains and all their images within two cells."""
    ways = [(a * WIDTH + b * TILT, b * HEIGHT) for a in range(-2, 3) for b in range(-2, 3)]
    position = source.frames[frame].position
    which = np.tile(np.arange(len(position)), len(ways))
    return which, np.concatenate([position + way for way in ways])


# ---- Three grains in a triangle across the upper right corner


@pytest.fixture(scope="module")
def three():
    """Grains of radius 0.5 that touch each other; two of the contacts cross sides of the cell."""
    corner, rise = np.array([WIDTH + TILT, HEIGHT]), np.sqrt(0.75)
    away = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, rise]])  # from the first grain
    first = corner - np.array([0.3, 0.2])
    position = first + away - np.array([[0, 0], [WIDTH, 0], [WIDTH + TILT, HEIGHT]])
    model, _ = make_cell(position, [0.5, 0.5, 0.5], (5.0, 3.5))
    i, j = np.array([0, 0, 1]), np.array([1, 2, 2])
    normal = away[i] - away[j]
    force = np.array([[2.0, 0.3], [3.0, -0.5], [1.0, 0.2]])
    contacts = contacts_of(i, j, normal, force)
    slip = np.array([[0.3, -0.1], [-0.2, 0.0], [-0.1, 0.1]])
    frames = [
        cell_frame(position, slip, contacts=contacts, angle=np.full(3, -0.05 * k)) for k in range(3)
    ]
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    vector = force[:, :1] * normal + force[:, 1:] * tangent
    contact = sum(np.outer(f, n) for f, n in zip(vector, normal, strict=True))
    kinetic = sum(m * np.outer(c, c) for m, c in zip(model.grains.mass, slip, strict=True))
    whole = contact + kinetic
    series = strained(SIDES, GRADIENT, np.arange(5) * 0.5)
    area = over_windows(series["wall_position"][:, 0, :2].prod(axis=1))
    larger = (area / (WIDTH * HEIGHT))[:, np.newaxis, np.newaxis]
    forces = np.array([whole[0, 0], whole[1, 1], whole[0, 1]])
    series |= {"virial_rate": larger * contact, "wall_force": larger * forces}
    source = source_of(model, frames, series=series)
    return SimpleNamespace(
        source=source, contact=contact, kinetic=kinetic, area=float(area[1:].mean())
    )


def test_rheology_of_three_grains(three):
    found = post.rheology(three.source, ALL)
    assert isinstance(found, post.CellRheology)
    area, mean = WIDTH * HEIGHT, found.mean
    stress = (three.contact + three.kinetic) / area
    pressure = 0.5 * np.trace(stress)
    for a, b in ((0, 0), (1, 1), (0, 1)):
        axes = "xy"[a] + "xy"[b]
        assert mean[f"stress_{axes}"] == pytest.approx(stress[a, b])
        assert mean[f"kinetic_stress_{axes}"] == pytest.approx(three.kinetic[a, b] / area)
    shear = np.array([[stress[0, 0], stress[0, 1]], [stress[0, 1], stress[1, 1]]])
    largest, least = np.linalg.eigvalsh(shear)[::-1]
    assert mean["deviator"] == pytest.approx(0.5 * (largest - least))
    assert mean["pressure"] == pytest.approx(pressure)
    assert mean["friction"] == pytest.approx(abs(stress[0, 1]) / pressure)
    assert mean["normal_difference"] == pytest.approx((stress[0, 0] - stress[1, 1]) / pressure)
    assert mean["shear_rate"] == pytest.approx(0.7)
    assert mean["dilation_rate"] == pytest.approx(-0.1)
    assert mean["inertial_number"] == pytest.approx(0.7 * np.sqrt(1.0 / pressure))
    assert mean["solid_fraction"] == pytest.approx(0.75 * np.pi / three.area)
    assert mean["coordination"] == pytest.approx(2.0)
    assert mean["fabric_anisotropy"] == pytest.approx(0.0, abs=1e-12)
    assert mean["spin_over_flow"] == pytest.approx(0.1 / 0.7)
    slip = np.array([[0.3, -0.1], [-0.2, 0.0], [-0.1, 0.1]])
    assert mean["granular_temperature"] == pytest.approx(0.5 * (slip**2).sum() / 3)
    assert found.error["pressure"] == 0.0
    with pytest.raises(post.PostError, match="no walls"):
        post.rheology(three.source, ALL, margin=1.0)


def test_rheology_is_of_grains_as_large_and_heavy_as_they_are(three):
    """Grown by a tenth and worn of a tenth of the mass: ν and both inertial numbers by hand."""
    model = three.source.model
    frames = [SimpleNamespace(**vars(frame)) for frame in three.source.frames]
    for frame in frames:
        frame.model = model.with_radius(1.1 * model.grains.radius, np.full(3, 0.1))
    mean = post.rheology(source_of(model, frames, series=three.source.series), ALL).mean
    cover, mass, root = 0.75 * np.pi * 1.21, 0.9 * model.grains.mass, np.sqrt(mean["pressure"])
    assert mean["pressure"] == post.rheology(three.source, ALL).mean["pressure"]
    assert mean["solid_fraction"] == pytest.approx(cover / three.area)
    assert mean["inertial_number"] == pytest.approx(0.7 * np.sqrt(mass.mean()) / root)
    assert mean["inertial_number_density"] == pytest.approx(
        0.7 * 1.1 * np.sqrt(mass.sum() / cover) / root
    )


def test_stress_over_the_height_adds_up_to_that_of_the_cell(three):
    for axes, stress in zip(("xx", "xy", "yx", "yy"), three.contact.ravel(), strict=True):
        table = post.profile(three.source, f"stress-{axes}", ALL, 7)
        assert table.value.sum() * table.bin_area == pytest.approx(stress)
    table = post.profile(three.source, "kinetic-stress-xx", ALL, 7)
    assert table.value.sum() * table.bin_area == pytest.approx(three.kinetic[0, 0])


def test_lines_of_contacts_lie_between_grains_and_images(three):
    from multicor_cli.plots.forces import segments

    lines, which = segments(post.force_network(three.source, 0))
    assert np.hypot(*(lines[:, 0] - lines[:, 1]).T) == pytest.approx(1.0)
    assert np.bincount(which).min() >= 2  # each crosses a side, or two
    _, places = all_images(three.source, 0)
    for end in lines.reshape(-1, 2):
        assert np.hypot(*(places - end).T).min() == pytest.approx(0.0, abs=1e-9)


def test_deviation_of_a_flow_that_slips_in_a_plane_is_1():
    y = (np.arange(300) + 0.5) * HEIGHT / 300
    position = np.column_stack([np.full(300, 1.0), y])
    model, _ = make_cell(position, np.full(300, 0.05), (5.0, 3.5))
    slip = np.column_stack([-0.7 * (y - 0.5 * HEIGHT), np.zeros(300)])
    frames = [cell_frame(position, slip) for _ in range(3)]
    series = strained(SIDES, GRADIENT, np.arange(3.0))
    series |= {"virial_rate": np.zeros((3, 2, 2)), "wall_force": np.zeros((3, 1, 3))}
    found = post.rheology(source_of(model, frames, series=series), ALL)
    assert found.mean["flow_deviation"] == pytest.approx(1.0, rel=0.06)
    assert np.isnan(found.mean["coordination"])
    assert len(CONTACT_SUMS) == 12


# ---- Grains that move with the mean flow, and images of them


def test_profiles_agree_with_images_one_by_one():
    source, count = flowing(slip=0.3), 6
    found = {
        of: post.profile(source, of, post.Selection(frames=slice(0, 1)), count)
        for of in ("solid-fraction", "velocity", "velocity-y")
    }
    frame, radius = source.frames[0], source.model.grains.radius
    which, places = all_images(source, 0)
    slip = frame.velocity - frame.position @ L.T
    fine = HEIGHT * (np.arange(60_000) + 0.5) / 60_000
    area, moved = np.zeros(count), np.zeros((count, 2))
    for k, (x, y) in zip(which.tolist(), places, strict=True):
        if not 0.0 <= x < WIDTH:  # each grain once at every height
            continue
        chord = 2.0 * np.sqrt(np.maximum(radius[k] ** 2 - (fine - y) ** 2, 0.0))
        own = chord.reshape(count, -1).sum(axis=1) * HEIGHT / fine.size
        area += own
        moved += own[:, np.newaxis] * (slip[k] + L @ (x, y))
    assert found["solid-fraction"].value == pytest.approx(area / (WIDTH * HEIGHT / count), rel=1e-6)
    assert found["velocity"].value == pytest.approx(moved[:, 0] / area, rel=1e-5)
    assert found["velocity-y"].value == pytest.approx(moved[:, 1] / area, rel=1e-5)
    assert found["velocity"].shear_rate == pytest.approx(0.7)


def test_fluctuations_are_those_about_the_mean_flow():
    still = flowing()
    table = post.profile(still, "granular-temperature", ALL, 3)
    assert table.value == pytest.approx(0.0, abs=1e-25)
    assert post.grain_map(still, "fluctuation").value == pytest.approx(0.0, abs=1e-12)


def test_a_mean_flow_that_changes_is_no_fluctuation():
    """Whatever the cell does from frame to frame, and wherever its flow is zero."""
    steady, model = flowing(slip=1.0), flowing().model
    frames = []
    for k, frame in enumerate(steady.frames):
        change = (k - 1) * np.array([[3.0, 5.0], [0.0, -4.0]])
        moved = frame_of(
            frame.position, velocity=frame.velocity + frame.position @ change.T,
            wall_position=frame.wall_position,
            wall_velocity=frame.wall_velocity + change[[0, 1, 0], [0, 1, 1]],
            angle=frame.angle,
        )  # fmt: skip
        frames.append(moved)
    names = ("kinetic-stress-xx", "kinetic-stress-xy", "granular-temperature")
    other, expected = (
        post.fields(source, names, ALL, spacing=1.0, reach=2.5)
        for source in (source_of(model, frames), steady)
    )
    for name, values in expected.values.items():
        assert other.values[name] == pytest.approx(values, rel=1e-9, abs=1e-12), name


def test_fields_of_a_linear_flow_are_linear_across_the_sides():
    line = ((-2.0, -1.0), (7.0, 5.0))
    table = post.fields(flowing(), ("velocity-x",), ALL, along=line, reach=2.5)
    at, values = table.points.at, table.values
    assert np.isfinite(values["velocity-x"]).all()
    assert values["velocity-x"] == pytest.approx(at @ L[0])
    assert values["velocity-y"] == pytest.approx(at @ L[1])
    expected = {"xx": 0.1, "xy": 0.35, "yy": -0.2}
    for axes, rate in expected.items():
        assert values[f"strain-rate-{axes}"] == pytest.approx(rate)
    assert values["vorticity"] == pytest.approx(-0.7)
    assert values["kinetic-stress-xy"] == pytest.approx(0.0, abs=1e-9)
    grid = post.fields(flowing(), (), ALL)
    solid = np.pi * (flowing().model.grains.radius ** 2).sum() / (WIDTH * HEIGHT)
    assert grid.values["solid-fraction"].mean() == pytest.approx(solid, rel=1e-3)
    with pytest.raises(post.PostError, match="beyond the period"):
        post.fields(flowing(), (), ALL, reach=20.0)


def test_images_on_a_map_move_as_the_mean_flow():
    for of, axis in (("velocity", 0), ("velocity-y", 1)):
        table = post.grain_map(flowing(), of)
        scene = table.scene
        which, shift = scene.lattice.images(scene.center, scene.radius)
        assert len(which) > len(scene.radius)
        expected = (scene.center[which] + shift) @ L[axis]
        assert table.values_of_images() == pytest.approx(expected)
    table = post.grain_map(flowing(), "group")
    assert table.values_of_images().tolist() == [0.0] * len(which)
    low, high = scene.box
    assert (low < 0.0).all()
    assert (high > (WIDTH + TILT, HEIGHT)).all()


def test_displacements_are_those_beside_the_mean_flow():
    source = flowing()
    strayed = np.random.default_rng(9).normal(size=(3, 60, 2))
    for frame, way in zip(source.frames, strayed, strict=True):
        frame.nonaffine = way
    found = post.grain_map(source, "displacement").value
    assert found == pytest.approx(np.hypot(*(strayed[-1] - strayed[0]).T))
    source.frames[-1].nonaffine = None
    with pytest.raises(post.PostError, match="run it again"):
        post.grain_map(source, "displacement")


@pytest.mark.parametrize(
    ("table", "why"),
    [
        (lambda run: flow_through(run, ((0, 1), (1, 1))), "post fields --line"),
        (lambda run: post.in_region(run, Rectangle((0, 0), (1, 1))), "post rheology"),
        (post.theta_eta, "no wall"),
        (lambda run: post.profile(run, between=("a", "b")), "leave out --between"),
    ],
)
def test_what_a_cell_does_not_have(table, why):
    with pytest.raises(post.PostError, match=f"periodic in x and y.*{why}"):
        table(flowing())
