"""Mean square displacements and self-diffusion of grains whose ways are known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cells import make_cell, strained
from made_up_frames import frame_of, source_of
from scene_parts import between_planes

from multicor_cli import post
from multicor_cli.post import PostError, Selection

ALL = Selection(start=0.0)
RATE, LAPSE, FRAMES = 0.4, 0.5, 14


def ways(count, spread, seed=3):
    """Random walks, with a jump that is undone in each step; shape ``(f, n, 2)``."""
    random = np.random.default_rng(seed)
    steps = random.normal(size=(FRAMES, count, 2)) * np.sqrt(2.0 * np.array(spread) * LAPSE)
    jumps = 0.3 * np.sqrt(spread) * random.normal(size=(FRAMES, count, 2))
    return np.cumsum(steps, axis=0) + jumps


def cell_of(spread, *, rate=RATE, count=4000):
    model, _ = make_cell(np.zeros((count, 2)), np.full(count, 0.5), (8.0, 5.0))
    gradient = np.array([[0.0, 0.0, rate]])
    frames = [
        frame_of(np.zeros((count, 3)), walls=1, nonaffine=way, wall_velocity=gradient)
        for way in ways(count, spread)
    ]
    times = LAPSE * np.arange(FRAMES)
    return source_of(model, frames, times, series=strained((8.0, 5.0, 0.0), gradient[0], times))


def layer_of(spread, *, rate=RATE, count=4000, unsteady=0.0):
    """Between walls at 0 and 1 that shear grains, which stray far less than that; by turns a share
    ``unsteady`` faster and more slowly."""
    model, random = between_planes([1e-3] * count), np.random.default_rng(8)
    y, x = random.uniform(0.0, 1.0, count), random.uniform(0.0, 4.0, count)
    strayed, frames = ways(count, spread), []
    height = np.clip(y + strayed[:, :, 1] - strayed[:1, :, 1], 0.0, 1.0)
    along = np.zeros(count)
    for k in range(FRAMES):
        if k:
            turn = rate * (1.0 + unsteady * (-1.0) ** k)
            along = along + turn * LAPSE * 0.5 * (height[k] + height[k - 1])
            along = along + strayed[k, :, 0] - strayed[k - 1, :, 0]
        place = np.column_stack([x + along, height[k], np.zeros(count)])
        wrapped = place - [4.0, 0.0, 0.0] * np.floor(place[:, :1] / 4.0)
        frame = frame_of(
            wrapped, unwrapped=place[:, :2], angle=np.zeros(count),
            image=np.floor(place[:, 0] / 4.0).astype(int),
            wall_velocity=np.array([[0.0] * 3, [rate, 0.0, 0.0]]),
        )  # fmt: skip
        frames.append(frame)
    return source_of(model, frames, LAPSE * np.arange(FRAMES))


@pytest.mark.parametrize("made", [cell_of, layer_of])
def test_random_walks_diffuse_as_they_do(made):
    """Along the flow more than across it; what grains undo counts in no diffusivity."""
    spread = (4e-4, 1e-4)
    table = post.diffusion(made(spread), ALL)
    assert table.shear_rate == pytest.approx(RATE, rel=0.01)
    assert table.counted_from == 5  # of 0.2 each
    assert table.lag.tolist() == (LAPSE * np.arange(1, 7)).tolist()
    np.testing.assert_allclose(table.strain, RATE * table.lag, rtol=0.01)
    assert table.origins.tolist() == [13, 12, 11, 10, 9, 8]
    for axis, expected in zip("xy", spread, strict=True):
        straight = 2.0 * expected * table.lag + 2.0 * 0.09 * expected
        np.testing.assert_allclose(getattr(table, f"msd_{axis}"), straight, rtol=0.06)
    np.testing.assert_allclose(table.diffusion, spread, rtol=0.08)
    assert all(
        0.0 < error < 0.1 * d for error, d in zip(table.diffusion_error, spread, strict=True)
    )


def test_a_mean_flow_alone_does_not_diffuse():
    """However steep it is: what a layer does is straight between the knots of the mean flow."""
    table = post.diffusion(layer_of((0.0, 0.0), rate=3.0), ALL)
    assert table.msd_x.max() < 1e-20
    assert table.msd_y.max() < 1e-20


@pytest.mark.parametrize("unsteady", [0.05, 1.0])
def test_a_mean_flow_that_changes_does_not_diffuse_either(unsteady):
    """As in a cell: each interval has a flow of its own."""
    table = post.diffusion(layer_of((0.0, 0.0), unsteady=unsteady), ALL)
    assert table.msd_x.max() < 1e-20
    assert table.msd_y.max() < 1e-20
    table = post.diffusion(layer_of((4e-4, 1e-4), unsteady=unsteady), ALL)
    np.testing.assert_allclose(table.diffusion, (4e-4, 1e-4), rtol=0.08)


def test_in_a_cell_at_rest_all_lags_count():
    table = post.diffusion(cell_of((1e-4, 1e-4), rate=0.0), ALL)
    assert (table.shear_rate, table.counted_from) == (0.0, 1)
    assert table.strain.tolist() == [0.0] * 6


def test_the_layers_at_the_walls_do_not_count():
    """Grains that are near a wall when a lag begins, however far they go."""
    source = layer_of((0.0, 0.0))
    frames = source.frames
    for k, frame in enumerate(frames):
        near = frame.position[:, 1] < 0.05
        frame.unwrapped = frame.unwrapped + np.where(near, 0.1 * (-1.0) ** k, 0.0)[:, None] * [
            1.0,
            0.0,
        ]
    quiet = post.diffusion(source, ALL, margin=60.0)  # mean diameters of 2 mm
    assert quiet.msd_x.max() < 1e-20
    assert post.diffusion(source, ALL, margin=1.0).msd_x[0] > 1e-4


def test_every_value_is_in_json():
    table = post.diffusion(cell_of((1e-4, 2e-4)), ALL)
    told = table.as_dict()
    assert told["diffusion"] == table.diffusion
    assert told["msd_y"] == table.msd_y.tolist()
    assert told["frame_count"] == FRAMES
    pytest.importorskip("pandas")
    assert table.to_pandas().shape == (6, 7)


def test_what_it_refuses():
    cell = cell_of((1e-4, 1e-4), count=50)
    with pytest.raises(PostError, match="three frames, not 2"):
        post.diffusion(cell, Selection(frames=slice(-2, None)))
    with pytest.raises(PostError, match="leave out --margin and --between"):
        post.diffusion(cell, ALL, margin=2.0)
    layer = layer_of((1e-8, 1e-8), count=50)
    with pytest.raises(PostError, match="no bulk is left"):
        post.diffusion(layer, ALL, margin=400.0)
    box = SimpleNamespace(model=replace(layer.model, period=0.0), frames=layer.frames)
    with pytest.raises(PostError, match="depends on the height alone"):
        post.diffusion(box, ALL)
