"""Force networks and scenes of made-up frames: numbers, lines, images across the period, walls in their places."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from heat_run import GRAINS, RADIUS, write_heated_run
from made_up_frames import source_of
from scene_parts import make_model

from multicor_cli.model import ShapeKind
from multicor_cli.post import PostError, force_network, make_scene
from multicor_cli.post.scene import images
from multicor_cli.store import Run, open_run


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = tmp_path_factory.mktemp("run") / "run"
    write_heated_run(path)
    return open_run(path)


def test_numbers_of_a_network(run: Run) -> None:
    """Nine contacts between ten grains and one with the top plane, with 1 … 10 N; the lowest grain has only one contact."""
    network = force_network(run)
    assert network.summary == pytest.approx(
        {
            "contacts": 10,
            "wall_contacts": 1,
            "normal_force_mean": 5.5,
            "normal_force_max": 10.0,
            "tangential_force_mean": 0.55,
            "coordination": 1.9,
            "rattler_share": 0.1,
            "sliding_share": 0.4,
        }
    )
    assert dict(network.rows)["coordination number Z"] == pytest.approx(1.9)
    assert network.as_dict()["frame"] == 4


def test_lines_join_centers_and_end_at_walls(run: Run) -> None:
    network = force_network(run)
    heights = RADIUS + 2 * RADIUS * np.arange(GRAINS)
    assert network.start[:, 1] == pytest.approx(heights)
    assert network.end[:, 1] == pytest.approx([*heights[1:], 1.0])
    assert network.detail_rows[-1] == pytest.approx((9, 11, 2.0, 1.0, 0.0, -1.0, 10.0, -1.0, 1))
    assert len(network.detail_rows) == 10


def test_contacts_without_force_do_not_count(run: Run) -> None:
    frame = run.frames[2]
    frame.contacts.impulse[3:] = 0.0
    source = source_of(run.model, [frame])
    network = force_network(source)
    assert network.i.tolist() == [0, 1, 2]
    frame.contacts.impulse[:] = 0.0
    empty = force_network(source)
    assert empty.summary["contacts"] == 0
    assert np.isnan(empty.summary["normal_force_mean"])
    assert (empty.coordination, empty.rattler_share) == (0.0, 1.0)


def test_frames_without_forces_are_refused(tmp_path: Path, run: Run) -> None:
    with pytest.raises(PostError, match="no step of the mechanics was done before"):
        force_network(run, 0)
    with pytest.raises(PostError, match="no frame -6"):
        force_network(run, -6)
    write_heated_run(tmp_path / "run", contacts=False)
    with open_run(tmp_path / "run") as silent, pytest.raises(PostError, match=r"contacts = true in \[output\]"):
        force_network(silent)


def test_images_of_what_crosses_the_ends_of_the_period() -> None:
    which, shift = images(np.array([0.1, 2.0, 3.9]), np.full(3, 0.2), 4.0)
    assert sorted(zip(which.tolist(), shift.tolist(), strict=True)) == [(0, 0.0), (0, 4.0), (1, 0.0), (2, -4.0), (2, 0.0)]
    assert images(np.array([-1.0]), np.ones(1), 0.0)[0].tolist() == [0]


def scene_of(kinds: list[ShapeKind], geometry: list[list[float]], pose: list[float], *, period: float = 0.0):
    shapes = [(kind, 0, numbers) for kind, numbers in zip(kinds, geometry, strict=True)]
    model = make_model([0.5, 0.5], shapes, ("bottom", "top"), period=period)
    frame = SimpleNamespace(position=np.array([[0.5, 0.5], [4.5, 0.5]]), wall_position=np.array([pose, [0.0, 0.0, 0.0]]))
    return make_scene(SimpleNamespace(model=model), frame)


def test_walls_are_turned_and_moved_with_their_frame() -> None:
    """A quarter turn about (1, 2)."""
    kinds = [ShapeKind.DISC, ShapeKind.SEGMENT, ShapeKind.PLANE, ShapeKind.CIRCLE, ShapeKind.VERTEX]
    geometry = [[1, 0, 0.1, 0], [0, 0, 2, 0], [1, 0, 1, 0], [0, 0, 3, 0], [0, 0, -1, -1]]
    scene = scene_of(kinds, geometry, [1.0, 2.0, np.pi / 2])
    glued, plane, segment, _, circle = scene.walls  # in the order of their kinds
    assert glued.points == pytest.approx(np.array([[[1.0, 3.0]]]))
    assert (glued.radius, glued.is_grain) == ([0.1], True)
    assert segment.points == pytest.approx(np.array([[[1.0, 2.0], [1.0, 4.0]]]))
    assert plane.points == pytest.approx(np.array([[[1.0, 3.0]]]))
    assert plane.normal == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-12)
    assert circle.points == pytest.approx(np.array([[[1.0, 2.0]]]))
    assert (circle.radius, circle.is_grain) == ([3.0], False)


def test_box_holds_the_grains_and_the_walls_nearby() -> None:
    near = scene_of([ShapeKind.SEGMENT], [[5.5, 0, 5.5, 3]], [0.0, 0.0, 0.0])
    assert (near.box[0] < [0.0, 0.0]).all()
    assert (near.box[1] > [5.5, 3.0]).all()
    far = scene_of([ShapeKind.SEGMENT], [[0, 50, 5, 50]], [0.0, 0.0, 0.0])
    assert far.box[1, 1] < 1.5
    periodic = scene_of([ShapeKind.DISC], [[9.0, 0.0, 0.3, 0.0]], [0.0, 0.0, 0.0], period=5.0)
    assert periodic.box[:, 0].tolist() == [0.0, 5.0]
    assert periodic.walls[0].points[0, 0, 0] == pytest.approx(4.0)
