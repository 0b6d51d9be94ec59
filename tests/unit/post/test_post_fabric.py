"""Fabric of contacts with known anisotropies and of lattices, and against plain loops; friction that
is mobilized as the engine has found it."""

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import contacts_of, frame_of, source_of
from scenarios import plane, scenario
from scene_parts import between_planes, make_laws, make_model

from multicor_cli import post
from multicor_cli.engine.contact.law import weakened_friction, weakening_speed
from multicor_cli.post.contacts import loaded_contacts
from multicor_cli.post.mobilization import laws_over_time, mobilized

ALL = post.Selection(start=0.0)


def source_with(normal, force, gap=0.0, sliding=None):
    """One frame with contacts between two discs of radius 0.5 with these normals and forces."""
    count = len(force)
    contacts = contacts_of(np.zeros(count), np.ones(count), normal, force)
    contacts.gap = np.broadcast_to(gap, count)
    if sliding is not None:
        contacts.sliding = sliding
    model = make_model([0.5, 0.5], friction=0.5)
    return source_of(model, [frame_of(np.zeros((2, 2)), walls=1, contacts=contacts)])


def directions(a, main, count=200_000):
    """Evenly spaced quantiles of the density (1 + a cos 2(θ − main))/2π."""
    u = (np.arange(count) + 0.5) / count * 2.0 * np.pi
    theta = u.copy()
    for _ in range(60):
        theta = u - 0.5 * a * (np.sin(2.0 * (theta - main)) + np.sin(2.0 * main))
    return theta


def contacts_with(a_c, a_n, a_t, a_l, main, main_n=None):
    """Contacts with these anisotropies, all along ``main`` but for those of normal forces."""
    theta = directions(a_c, main)
    away = 2.0 * (theta - main)
    f = 3.0 * (1.0 + a_n * np.cos(2.0 * (theta - (main if main_n is None else main_n))))
    g = -3.0 * a_t * np.sin(away)
    length = 1.2 * (1.0 + a_l * np.cos(away))
    return np.column_stack([np.cos(theta), np.sin(theta)]), np.column_stack([f, g]), length - 1.0


@pytest.mark.parametrize("degrees", [0.0, 37.0, 120.0])
def test_stress_of_known_anisotropies(degrees):
    """q/p in closed form: ⟨cos²⟩ = ½, ⟨cos⁴⟩ = ⅜, ⟨cos² sin²⟩ = ⅛ over directions."""
    c, n, t, l = 0.4, 0.3, 0.1, 0.05  # noqa: E741
    table = post.fabric(source_with(*contacts_with(c, n, t, l, np.radians(degrees))), ALL)
    mean = table.mean
    for name, value in {"a_c": c, "a_n": n, "a_t": t, "a_l": l}.items():
        assert mean[name] == pytest.approx(value, abs=2e-3)
    first = 0.5 * (c + n + t + l)
    trace = 1.0 + 0.5 * (c * n + c * l + n * l)
    exact = (first + 0.375 * c * n * l + 0.125 * c * t * l) / trace
    assert mean["stress_ratio"] == pytest.approx(exact, abs=1e-5)
    assert mean["stress_fabric"] == pytest.approx(first, abs=3e-3)
    assert mean["stress_fabric_full"] == pytest.approx(exact, abs=3e-3)
    assert mean["difference"] == mean["stress_ratio"] - mean["stress_fabric"]
    for name in ("theta_s", "theta_c"):
        assert (mean[name] - degrees + 90.0) % 180.0 == pytest.approx(90.0, abs=0.1)
    assert table.values["contacts"].tolist() == [200_000]


def test_what_lies_across_the_major_stress_is_negative():
    table = post.fabric(source_with(*contacts_with(0.4, 0.1, 0.0, 0.0, 0.3, 0.3 + np.pi / 2)), ALL)
    assert table.mean["a_n"] == pytest.approx(-0.1, abs=2e-3)
    assert table.mean["a_c"] == pytest.approx(0.4, abs=2e-3)
    assert table.mean["stress_ratio"] == pytest.approx(0.15 / (1.0 - 0.02), abs=1e-5)


def test_empty_directions_have_no_part_in_forces():
    """Equal forces and lengths are isotropic, whatever the directions in which there are any."""
    theta = np.linspace(-0.5, 0.5, 1001)
    normal = np.column_stack([np.cos(theta), np.sin(theta)])
    mean = post.fabric(source_with(normal, np.tile([2.0, 0.0], (1001, 1))), ALL).mean
    for name in ("a_n", "a_t", "a_l"):
        assert mean[name] == pytest.approx(0.0, abs=1e-12)
    assert mean["stress_ratio"] == pytest.approx(0.5 * mean["a_c"])


def test_a_square_lattice_in_a_cell():
    """Strong are the contacts of the major stress: they carry more than all of q."""
    size, (fx, fy) = 6, (3.0, 1.0)
    place = np.stack(np.meshgrid(np.arange(size), np.arange(size)), -1).reshape(-1, 2) + 0.5
    number = np.arange(size**2).reshape(size, size)
    right, up = np.roll(number, -1, axis=1).ravel(), np.roll(number, -1, axis=0).ravel()
    i, j = np.tile(number.ravel(), 2), np.concatenate([right, up])
    normal = np.repeat([[-1.0, 0.0], [0.0, -1.0]], size**2, axis=0)
    force = np.repeat([[fx, 0.0], [fy, 0.0]], size**2, axis=0)
    model, state = make_cell(place, np.full(size**2, 0.5), (size, size))
    frame = frame_of(place, walls=1, contacts=contacts_of(i, j, normal, force))
    frame.wall_position = state.wall_position
    mean = post.fabric(source_of(model, [frame]), ALL).mean
    expected = {
        "contacts": 72.0, "stress_ratio": (fx - fy) / (fx + fy), "theta_s": 0.0, "a_c": 0.0,
        "a_l": 0.0, "a_t": 0.0, "strong_share": 0.5, "strong_pressure": fx / (fx + fy),
        "strong_deviator": fx / (fx - fy), "strong_a_c": 2.0, "weak_a_c": -2.0,
    }  # fmt: skip
    assert {name: mean[name] for name in expected} == pytest.approx(expected, abs=1e-12)


def test_against_plain_loops():
    """Shares of strong contacts, principal stresses, sliding and mobilization, one by one."""
    random = np.random.default_rng(3)
    count = 300
    theta = random.uniform(0.0, 2.0 * np.pi, count)
    normal = np.column_stack([np.cos(theta), np.sin(theta)])
    f = random.exponential(2.0, count) * (1.0 + 0.5 * np.cos(2.0 * theta - 1.0))
    g = 0.5 * f * random.uniform(-1.0, 1.0, count)
    f[::50] *= -1.0  # a few pull
    sliding = random.random(count) < 0.2
    gap = random.uniform(-0.1, 0.3, count)
    mean = post.fabric(source_with(normal, np.column_stack([f, g]), gap, sliding), ALL).mean
    stress, strong_stress = np.zeros((2, 2)), np.zeros((2, 2))
    level = np.mean([value for value in f if value > 0.0])
    numbers = {"strong": [], "weak": []}
    for k in range(count):
        tangent = np.array([-normal[k, 1], normal[k, 0]])
        dyad = np.outer(f[k] * normal[k] + g[k] * tangent, (1.0 + gap[k]) * normal[k])
        stress += dyad
        if f[k] > level:
            strong_stress += dyad
        if f[k] > 0.0:
            part = 1.0 if sliding[k] else abs(g[k]) / (0.5 * f[k])
            numbers["strong" if f[k] > level else "weak"].append((sliding[k], part))
    value, vector = np.linalg.eigh(0.5 * (stress + stress.T))
    assert mean["stress_ratio"] == pytest.approx((value[1] - value[0]) / (value[1] + value[0]))
    angle = np.degrees(np.arctan2(*vector[::-1, 1])) % 180.0
    assert mean["theta_s"] == pytest.approx(angle)
    turned = np.diag(vector.T @ strong_stress @ vector)
    assert mean["strong_deviator"] == pytest.approx((turned[1] - turned[0]) / (value[1] - value[0]))
    assert mean["strong_pressure"] == pytest.approx(turned.sum() / value.sum())
    assert mean["strong_share"] == len(numbers["strong"]) / count
    for name, rows in numbers.items():
        slides, part = np.array(rows, float).mean(axis=0)
        assert mean[f"{name}_sliding"] == pytest.approx(slides)
        assert mean[f"{name}_mobilization"] == pytest.approx(part)


def test_frames_count_alike_and_directions_repeat_every_180_degrees():
    """Two frames whose contacts are at 178° and 4°, one with many, one with few: on average 1°."""
    frames = []
    for degrees, count in ((178.0, 100), (4.0, 3)):
        along = np.radians(degrees)
        contacts = contacts_of(
            np.zeros(count), np.ones(count), (np.cos(along), np.sin(along)), (1.0, 0.0)
        )
        frames.append(frame_of(np.zeros((2, 2)), walls=1, contacts=contacts))
    table = post.fabric(source_of(make_model([0.5, 0.5]), frames), ALL)
    assert table.mean["theta_c"] % 180.0 == pytest.approx(1.0)
    assert table.values["theta_c"] % 180.0 == pytest.approx([178.0, 4.0])
    assert table.mean["contacts"] == 51.5


@pytest.mark.parametrize(("margin", "count"), [(0.0, 9), (2.9, 5), (3.1, 3)])
def test_the_bulk_of_a_layer(column, margin, count):
    """Of ten discs above each other between walls ten diameters apart: contacts k diameters above
    the lower one."""
    table = post.fabric(column, post.Selection(frames=slice(-1, None)), margin=margin)
    assert table.mean["contacts"] == count
    assert table.margin == pytest.approx(margin * column.model.mean_diameter)


def test_refusals(silent):
    source = source_with(np.tile([1.0, 0.0], (3, 1)), np.ones((3, 2)))
    with pytest.raises(post.PostError, match="periodic in x, which this is not"):
        post.fabric(source, ALL, margin=1.0)
    with pytest.raises(post.PostError, match=r"contacts = true in \[output\]"):
        post.fabric(silent)
    model, state = make_cell([[0.5, 0.5]], [0.5], (2.0, 2.0))
    wall = contacts_of([0], [1], (0.0, 1.0), (1.0, 0.0))
    cell = frame_of([[0.5, 0.5]], walls=1, contacts=wall, wall_position=state.wall_position)
    with pytest.raises(post.PostError, match="no walls: leave out --margin and --between"):
        post.fabric(source_of(model, [cell]), ALL, margin=1.0)
    alone = source_of(between_planes([0.5]), [frame_of([[0.0, 0.5]], contacts=wall)])
    with pytest.raises(post.PostError, match="no two grains press on each other in the bulk"):
        post.fabric(alone, ALL)


# ---- Mobilized friction

_LAWS = {
    "constant": {"friction": 0.4},
    "of temperature": {
        "friction": {"value": 0.5, "softening": 0.02, "reference": 300.0},
        "heat": {"temperature": 300.0},
    },
    "of stages": {
        "friction": 0.4,
        "loading": [
            {"duration": 0.05},
            {"duration": 0.05, "contacts": [{"pair": ["*", "*"], "friction": 0.1}]},
        ],
    },
    "of speed": {"friction": {"speed": [0.0, 0.02, 0.1], "values": [0.6, 0.3, 0.1]}},
    "of flash heating, by temperature": {
        "friction": {
            "value": 0.6,
            "weakened": 0.1,
            "weakening_speed": 0.05,
            "weakening_temperature": 350.0,
            "reference": 300.0,
        },
        "heat": {"temperature": 300.0},
    },
    "dry": {"friction": 0.4, "adhesion": 2e-4},
    "wet": {"friction": 0.4, "adhesion": {"force": 2e-4, "kind": "wet", "range": 1e-4}},
}


_NEARLY = {"of speed": 0.6, "of flash heating, by temperature": 0.6, "dry": 0.03, "wet": 0.03}
"""Share of sliding contacts that seem to mobilize a little less: slips and gaps are those after a
step, and of its middle."""


@pytest.mark.parametrize("name", _LAWS)
def test_contacts_slide_where_friction_is_mobilized(name, run):
    """All that the engine has found to slide, and no other: exactly, but for slips and gaps that
    change within a step, and for contacts that have come to rest with all their friction."""
    floor = {"geometry": plane(), "thermal": {"temperature": 340.0}}
    said = {
        "size": [0.02, 0.02], "periodic": True, "frame_interval": 0.002, "dt": 1e-4,
        "gravity": [3.0, -9.0], "loading": [{"duration": 0.1}],
        "grains": {"count": 60, "sizes": {"kind": "uniform", "min": 0.5e-3, "max": 1e-3}},
        "walls": {
            "floor": floor if "temperature" in name else plane(),
            "lid": {"geometry": plane(0.012, -1), "mass": 1e-3},
        },
    }  # fmt: skip
    source = run(scenario(**said | _LAWS[name]))
    laws, model = laws_over_time(source), source.model
    part, slides, moves = [], [], []
    for frame in source.frames[1:]:
        contacts = loaded_contacts(frame, model)
        own = np.asarray(frame.contacts.sliding, bool)[contacts.row]
        part.append(mobilized(contacts, np.zeros_like(own), laws(frame), model, frame))
        slides.append(own)
        moves.append(np.abs(frame.contacts.slip)[contacts.row] > 1e-9)
        known = mobilized(contacts, own, laws(frame), model, frame)
        assert (known[own & np.isfinite(known)] == 1.0).all()
    part, slides, moves = map(np.concatenate, (part, slides, moves))
    known = np.isfinite(part)
    assert known.sum() > 400
    assert 0.0 <= part[known].min() <= part[known].max() <= 1.0
    below = part[known & slides] < 0.999
    tolerance = _NEARLY.get(name, 0.0)
    assert below.mean() <= tolerance
    assert (moves & (part > 0.9999))[known & ~slides].mean() < 0.01
    table = post.mobilization(source, ALL, 10)
    assert table.density.sum() / 10.0 == pytest.approx(1.0)
    assert table.count.sum() == table.contacts


def test_friction_of_speed_and_temperature():
    """μ between the rows of a table, and weakened by flash heating as the engine has it."""
    slip, force = np.array([-0.05, 0.02, 0.3, 0.0]), np.tile([1.0, 0.05], (4, 1))
    source = source_with(np.tile([1.0, 0.0], (4, 1)), force)
    frame = source.frames[0]
    frame.contacts.slip, frame.temperature = slip, np.array([330.0, 350.0])
    frame.wall_temperature = np.array([np.nan])
    table = make_laws(table=([0.0, 0.1, 0.2], [0.5, 0.3, 0.1]))
    expected = np.array([0.4, 0.46, 0.1, 0.5])
    one = np.ones((1, 1))
    flash = make_laws(0.5)._replace(
        flash_speed=0.04 * one, flash_weakened=0.1 * one, flash_limit=500.0 * one,
        flash_reference=300.0 * one,
    )  # fmt: skip
    speed = weakening_speed(0.04, 340.0, 500.0, 300.0)
    weakened = [weakened_friction(0.5, 0.1, speed, abs(value)) for value in slip]
    contacts, still = loaded_contacts(frame, source.model), np.zeros(4, bool)
    for laws, mu in ((table, expected), (flash, np.array(weakened))):
        part = mobilized(contacts, still, laws, source.model, frame)
        assert part == pytest.approx(0.05 / mu)


def test_mobilization_by_hand():
    force = np.array([[2.0, 0.0], [2.0, -0.5], [4.0, 1.0], [1.0, 0.45], [1.0, 0.5]])
    table = post.mobilization(source_with(np.tile([1.0, 0.0], (5, 1)), force), ALL, 4)
    assert table.count.tolist() == [1, 0, 2, 2]
    assert table.density.tolist() == pytest.approx([0.8, 0.0, 1.6, 1.6])
    assert table.mean == pytest.approx((0.0 + 0.5 + 0.5 + 0.9 + 1.0) / 5.0)
    source = source_with(np.tile([1.0, 0.0], (5, 1)), force)
    source.model = make_model([0.5, 0.5], friction=0.0)
    with pytest.raises(post.PostError, match="no contact between grains has friction"):
        post.mobilization(source, ALL)
    assert np.isnan(post.fabric(source, ALL).mean["mobilization"])
