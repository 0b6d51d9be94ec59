"""Long axes of grains and their nematic order: closed forms, sampled points, and plain loops."""

import warnings
from dataclasses import replace

import numpy as np
import post_oracle as oracle
import pytest
from made_up_frames import frame_of, source_of
from scene_parts import make_model
from shaped_frames import box, disc, points_of, regular, rod, shaped_frame, shaped_model

from multicor_cli import post
from multicor_cli.post.profile import profiles
from multicor_cli.post.rings import axes_of, degrees_of

ALL = post.Selection(start=0.0)
EL = [box(1.0, 0.3), box(0.3, 1.0, at=(0.35, 0.35))]  # an L, which share a corner


def axis_of(pieces, angle=0.0, **more):
    model = shaped_model([pieces], **more)
    return axes_of(model, shaped_frame(np.zeros((1, 2)), angle))[0]


@pytest.mark.parametrize("angle", [0.0, 0.5, -2.0, 9.0])
def test_axes_of_shapes_with_symmetry(angle):
    turn = np.exp(2j * angle)
    assert axis_of([rod(1.0, 0.2)], angle) == pytest.approx(turn)
    assert axis_of([box(1.0, 1.001, 0.2)], angle) == pytest.approx(-turn)  # upright
    assert axis_of([disc(0.5, (1.0, 1.0)), disc(0.5, (-1.0, -1.0))], angle, areas=[1.5]) == (
        pytest.approx(1j * turn)
    )
    moved = [disc(0.5, (7.0, 1.0)), disc(0.5, (5.0, -1.0))]  # however far off its center is
    assert axis_of(moved, angle, areas=[1.5]) == pytest.approx(1j * turn)


def test_what_is_alike_along_all_axes_has_none():
    for pieces in ([disc(0.5)], [regular(3)], [regular(4, 1.0, 0.1)], [regular(5, 1.0, 0.4, 0.2)]):
        assert np.isnan(axis_of(pieces))
    line = [(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.0)]  # encloses nothing
    with warnings.catch_warnings(action="error"):
        assert np.isnan(axis_of(line, areas=[1e-12]))
    cross = [box(1.0, 0.2), box(0.2, 1.0)]
    assert np.isnan(axis_of(cross, areas=[0.36]))


@pytest.mark.parametrize("pieces", [EL, [box(1.0, 0.4, 0.3), disc(0.6, (0.8, 0.5))]])
def test_the_long_axis_is_that_of_sampled_points(pieces):
    """The principal axis of the covariance of points on a fine grid."""
    line = np.linspace(-2.0, 2.0, 1600)
    points = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)

    def holds(corners, rounding):
        low, high = corners.min(axis=0), corners.max(axis=0)  # boxes with level sides
        return np.hypot(*(points - np.clip(points, low, high)).T) <= rounding

    inside = points[np.any([holds(*piece) for piece in pieces], axis=0)]
    _, vectors = np.linalg.eigh(np.cov(inside.T))
    expected = (vectors[0, 1] + 1j * vectors[1, 1]) ** 2
    area = len(inside) * (line[1] - line[0]) ** 2
    assert axis_of(pieces, areas=[area]) == pytest.approx(expected, abs=5e-3)


def rods(angle, y=None, **said):
    """Rods at angles [rad], one above the other unless told otherwise."""
    count = len(angle)
    place = np.column_stack([np.zeros(count), np.arange(count) if y is None else y])
    model = shaped_model([[rod(1.0, 0.2)]] * count, walls=())
    return source_of(model, [shaped_frame(place.astype(float), angle, walls=0, **said)])


def test_order_of_parallel_and_of_random_rods():
    """S is 1 of parallel rods; S² is 1/n on average by chance, and S √(π/4n)."""
    for direction in (0.0, 1.0, 3.0):
        angle = direction + np.pi * np.arange(50)  # one way or the other
        order = post.profile(rods(angle), "nematic-order", ALL, 1)
        assert order.value[0] == pytest.approx(1.0)
        director = post.profile(rods(angle), "nematic-director", ALL, 1).value[0]
        away = director - np.degrees(direction)
        assert (away + 90.0) % 180.0 == pytest.approx(90.0)
    random, found = np.random.default_rng(1), []
    for count in (25, 400):
        values = np.array([
            post.profile(rods(random.uniform(0.0, 9.0 * np.pi, count)), "nematic-order", ALL, 1)
            .value[0] for _ in range(150)
        ])  # fmt: skip
        assert (values**2).mean() * count == pytest.approx(1.0, abs=0.25)  # ± 3 errors
        found.append(values.mean() * np.sqrt(count))
    assert found == pytest.approx([np.sqrt(np.pi / 4.0)] * 2, abs=0.12)


def test_order_over_the_height_and_its_errors():
    """Below parallel, above crossed; frames differ, and so errors are those of their ratios."""
    random, frames = np.random.default_rng(3), []
    y = np.concatenate([np.full(40, 1.0), np.full(40, 3.0)])
    for _ in range(40):
        angle = 0.3 + random.normal(0.0, 0.4, 80)
        angle[40:] += np.pi / 2.0 * np.arange(40)
        frames += rods(angle, y).frames
    source = source_of(rods(angle, y).model, frames)
    order, director = profiles(source, "nematic", ALL, 2).tables
    normal = np.exp(-2.0 * 0.4**2)
    assert order.value == pytest.approx([normal, 0.0], abs=0.03)
    assert director.value[0] == pytest.approx(np.degrees(0.3), abs=1.0)
    wave = np.exp(2j * np.array([frame.angle[:40] for frame in frames]))
    mean = wave.mean()
    assert order.value[0] == pytest.approx(abs(mean))
    alone = np.array([np.delete(wave, k, axis=0).mean() for k in range(40)])
    added = 40 * abs(mean) - 39 * abs(alone)
    assert order.error[0] == pytest.approx(oracle.error_of_mean(added))
    turned = -39.0 * 0.5 * np.degrees(np.angle(alone / mean))
    assert director.error[0] == pytest.approx(oracle.error_of_mean(turned))


def test_grains_without_an_axis_do_not_count():
    model = shaped_model([[rod(1.0, 0.2)], [disc(0.5)], [regular(5)]], walls=())
    frame = shaped_frame(np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]), 0.2, walls=0)
    source = source_of(model, [frame])
    assert post.profile(source, "nematic-order", ALL, 1).value.tolist() == [1.0]
    table = post.grain_map(source, "orientation")
    told = dict(zip(*(column.values for column in table.columns), strict=True))
    assert told["grains"] == 1.0
    values = table.value
    assert values[0] == pytest.approx(np.degrees(0.2))
    assert np.isnan(values[1:]).all()


def test_order_of_a_group():
    angle = np.array([0.0, 0.5, 0.0, 0.5, 0.0])
    source = rods(angle)
    grains = replace(source.model.grains, group=np.array([0, 1, 0, 1, 0], np.int32))
    model = replace(source.model, grains=grains, groups=("flat", "tilted"))
    for name, direction in (("flat", 0.0), ("tilted", 0.5)):
        of = profiles(source_of(model, source.frames), "nematic", ALL, 1, groups=[name]).tables
        assert [table.value[0] for table in of] == pytest.approx([1.0, np.degrees(direction)])


def test_directions_are_from_0_to_180_degrees():
    angle = np.radians([-10.0, 0.0, 90.0, 170.0, 180.0, 350.0])
    found = degrees_of(np.exp(2j * angle))
    assert ((found >= 0.0) & (found < 180.0)).all()
    assert (found - [170, 0, 90, 170, 0, 170] + 90.0) % 180.0 == pytest.approx(np.full(6, 90.0))


def test_a_map_of_directions_tells_their_order():
    """Axes at 170° and 20° have a director between both, at 5°, not at 95°."""
    table = post.grain_map(rods(np.radians([170.0, 20.0])), "orientation")
    told = dict(zip(*(column.values for column in table.columns), strict=True))
    order = np.cos(np.radians(30.0))
    assert told == pytest.approx(
        {"grains": 2.0, "nematic order": order, "director of the long axes [deg]": 5.0}
    )


def test_order_in_fabric_is_that_of_all_grains():
    random = np.random.default_rng(6)
    angle = random.normal(1.0, 0.3, 30)
    contacts = points_of([0], [1], (0.0, -1.0), (1.0, 0.0), (0.0, 0.5))
    mean = post.fabric(rods(angle, contacts=contacts), ALL).mean
    wave = np.exp(2j * angle).mean()
    assert mean["nematic_order"] == pytest.approx(abs(wave))
    assert mean["nematic_director"] == pytest.approx(np.degrees(0.5 * np.angle(wave)))


@pytest.mark.parametrize("of", ["nematic-order", "nematic-director"])
@pytest.mark.parametrize(
    "model", [make_model([0.5, 0.5]), shaped_model([[regular(5)], [disc(0.5)]], walls=())]
)
def test_discs_and_regular_polygons_have_no_order(of, model):
    source = source_of(model, [frame_of(np.eye(2))])
    with pytest.raises(post.PostError, match="no grain has a long axis"):
        post.profile(source, of, ALL)
    with pytest.raises(post.PostError, match="no grain has a long axis"):
        post.grain_map(source, "orientation")
    with pytest.raises(post.PostError, match="choose one of nematic-order, nematic-director"):
        post.profile(source, "nematic", ALL)
