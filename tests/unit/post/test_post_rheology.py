"""Rheology of made-up flows against what was put into them, and what it refuses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from heat_run import write_heated_run
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import between_planes, make_shapes

from multicor_cli.model import ShapeKind
from multicor_cli.post import PostError, Selection, rheology
from multicor_cli.post.rheology import QUANTITIES
from multicor_cli.post.source import bounds_of_intervals
from multicor_cli.store import open_run

N, RADIUS, PERIOD, RATE, LAPSE = 400, 0.01, 4.0, 3.0, 0.25
PRESS, SHEAR = 8.0, 2.4  # forces of the walls [N]


def make_source(frames=5, *, sign=1.0, jitter=0.0, seed=0):
    """Homogeneous shear between planes at 0 and 1; every contact along 135° for a positive rate,
    one per pair of numbers."""
    rng = np.random.default_rng(seed)
    model = between_planes([RADIUS] * N)
    x, y = rng.uniform(0.0, PERIOD, N), rng.uniform(RADIUS, 1.0 - RADIUS, N)
    found = []
    for k in range(frames):
        moved, slip = (
            x + sign * RATE * y * LAPSE * k,
            jitter * np.where(np.arange(N) % 2, 1.0, -1.0),
        )
        frame = frame_of(
            np.column_stack([moved % PERIOD, y]), dt=0.01, contacts=make_contacts(sign),
            image=np.floor(moved / PERIOD).astype(np.int64),
            velocity=np.column_stack([sign * RATE * y, slip]),
            angle=np.full(N, -0.4 * sign * RATE * LAPSE * k), spin=np.full(N, -0.4 * sign * RATE),
            wall_position=np.zeros((2, 3)),
            wall_velocity=np.array([[0.0, 0.0, 0.0], [sign * RATE, 0.0, 0.0]]),
        )  # fmt: skip
        found.append(frame)
    return source_of(model, found, LAPSE * np.arange(frames), series=make_series(frames, sign))


def make_contacts(sign):
    """Even grains press on the next odd ones with 5 N: one contact each; the first has two more."""
    i, j = [*range(0, N, 2), 0, 0], [*range(1, N, 2), 3, 5]
    return contacts_of(i, j, np.array([-sign, 1.0]) / np.sqrt(2.0), (5.0, 0.0))


def other(source, **model):
    """The same frames with another model."""
    changed = replace(source.model, **model)
    return SimpleNamespace(model=changed, frames=source.frames, series=source.series)


def make_series(frames, sign):
    """Ten rows for each frame; the wall is pulled 10 % more in every second row. Forces are those
    on the walls."""
    rows = 10 * (frames - 1)
    shear = sign * SHEAR * np.where(np.arange(rows) % 2, 1.1, 0.9)
    force = np.zeros((rows, 2, 3))
    force[:, 0, 0], force[:, 1, 0] = shear, -shear
    force[:, 0, 1], force[:, 1, 1] = -PRESS, PRESS
    return {
        "time": LAPSE / 10.0 * np.arange(1, rows + 1),
        "window_duration": np.full(rows, LAPSE / 10.0),
        "wall_force": force,
    }


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_put_in_comes_out(sign):
    """A sheared layer and its mirror image."""
    source = make_source(sign=sign, jitter=0.2)
    table = rheology(source, Selection(start=0.0), margin=5.0)
    mean = table.mean
    mass = float(source.model.grains.mass.mean())
    assert mean["shear_rate"] == pytest.approx(sign * RATE)
    assert mean["pressure"] == pytest.approx(PRESS / PERIOD)
    assert mean["inertial_number"] == pytest.approx(RATE * np.sqrt(mass / (PRESS / PERIOD)))
    assert mean["inertial_number"] == pytest.approx(
        np.sqrt(np.pi / 4.0) * mean["inertial_number_density"]
    )
    assert mean["friction_walls"] == pytest.approx(SHEAR / PRESS)
    assert mean["friction_bulk"] == pytest.approx(1.0)
    assert mean["spin_ratio"] == pytest.approx(-0.4)
    assert mean["fabric_anisotropy"] == pytest.approx(2.0)
    assert mean["fabric_direction"] == pytest.approx(135.0 if sign > 0 else 45.0)
    assert table.margin == pytest.approx(0.1)
    assert table.walls == ("bottom", "top")
    # every interval sees the same: no error, and the values over time are the means
    of_grains = {"solid_fraction", "coordination", "coordination_loaded", "bulk_stress_yy"}
    for name in {q.name for q in QUANTITIES} - of_grains - {"granular_temperature"}:
        assert table.error[name] == pytest.approx(0.0, abs=1e-9)
        assert table.values[name] == pytest.approx(np.full(4, mean[name]))


def test_inertial_numbers_are_of_grains_as_large_and_heavy_as_they_are():
    """Larger by a fifth, and worn of a tenth of the mass, which the run did not begin with."""
    source = make_source()
    grains = source.model.grains
    for frame in source.frames:
        frame.model = source.model.with_radius(1.2 * grains.radius, np.full(N, 0.1))
    mean = rheology(source, Selection(start=0.0), margin=5.0).mean
    mass = 0.9 * float(grains.mass.mean())
    assert mean["inertial_number"] == pytest.approx(RATE * np.sqrt(mass / (PRESS / PERIOD)))
    density = mass / (np.pi * (1.2 * RADIUS) ** 2)
    assert mean["inertial_number_density"] == pytest.approx(
        RATE * 2.4 * RADIUS * np.sqrt(density / (PRESS / PERIOD))
    )


def test_margin_is_eight_diameters_or_a_quarter_of_the_height():
    assert rheology(make_source(), Selection(start=0.0)).margin == pytest.approx(0.16)
    source = make_source()
    thin = other(source, grains=replace(source.model.grains, radius=np.full(N, 0.02)))
    assert rheology(thin, Selection(start=0.0)).margin == pytest.approx(0.25)
    ends = [(wall, x) for wall in (0, 1) for x in (0.0, 0.9 * PERIOD)]
    glued = make_shapes([(ShapeKind.DISC, wall, (x, wall, 0.03, 0.0)) for wall, x in ends])
    table = rheology(other(source, shapes=glued), Selection(start=0.0), margin=5.0)
    y = source.frames[0].position[:, 1]
    counts = np.ones(N)
    counts[[0, 3, 5]] = 3.0, 2.0, 2.0
    assert table.mean["coordination"] == pytest.approx(counts[(y > 0.13) & (y < 0.87)].mean())
    # Leaves 0.4 m between grains of 0.3 m
    large = replace(glued, geometry=glued.geometry * [1.0, 1.0, 10.0, 1.0])
    narrow = other(source, shapes=large)
    assert rheology(narrow, Selection(start=0.0)).margin == pytest.approx(0.4 / 3.0)


def test_a_short_interval_at_the_end_of_a_stage_is_one_with_that_before_it():
    """One of two rows of the series, in which the wall is pulled as hard as in any."""
    source = make_source(6)
    whole = rheology(source, Selection(start=0.0))
    frames, time = source.frames, source.frames.time.copy()
    time[-1] = time[-2] + 0.2 * LAPSE
    source.frames.time = time
    source.series = {name: rows[:42] for name, rows in source.series.items()}
    cut = rheology(source, Selection(start=0.0))
    assert cut.time == pytest.approx([*whole.time[:3], time[-1]])
    assert cut.frame_count == 5
    assert cut.values["friction_walls"] == pytest.approx([0.3] * 4, rel=1e-2)
    frames.stage[-2:] = 1  # the end of a stage and the only frame of the next
    assert rheology(source, Selection(start=0.0)).time == pytest.approx(time[1:])


@pytest.mark.parametrize(("times", "stages", "kept"), [
    ([0, 1, 2, 2.4], [0, 0, 0, 0], [0, 1, 3]),
    ([0, 1, 2, 2.6], [0, 0, 0, 0], [0, 1, 2, 3]),
    ([0, 1, 2, 2.1, 3, 4], [0, 0, 0, 0, 1, 1], [0, 1, 3, 4, 5]),
    ([0, 1, 2, 2.1, 2.2, 2.3, 2.31], [0, 0, 0, 1, 1, 1, 1], [0, 1, 2, 3, 4, 6]),  # closer frames
    ([0, 0.1], [0, 0], [0, 1]),
    ([0], [0], [0]),
])  # fmt: skip
def test_which_frames_bound_intervals(times, stages, kept):
    frames = SimpleNamespace(time=np.array(times, float), stage=np.array(stages))
    found = bounds_of_intervals(SimpleNamespace(frames=frames), np.arange(len(times)))
    assert found.tolist() == kept


def test_no_bulk_has_a_negative_area():
    """In a frame in which the walls are nearer to each other than the margins of all frames
    together."""
    source = make_source()
    source.frames[2].wall_position[1, 1] = -0.7
    assert rheology(source, Selection(start=0.0), margin=7.0).mean["solid_fraction"] > 0.0
    with pytest.raises(
        PostError, match=r"where they come nearest, 0\.3 m: lower --margin, or choose other frames"
    ):
        rheology(source, Selection(start=0.0), margin=8.0)


def test_without_contacts_the_rest_is_still_measured():
    source = make_source()
    for frame in source.frames:
        frame.contacts.recorded = False
    table = rheology(source, Selection(start=0.0))
    assert table.mean["friction_walls"] == pytest.approx(SHEAR / PRESS)
    assert all(
        np.isnan(table.mean[name])
        for name in ("friction_bulk", "coordination", "fabric_anisotropy", "bulk_stress_yy")
    )


def test_what_is_no_shear_is_refused(tmp_path):
    source = make_source()
    with pytest.raises(PostError, match="needs two frames"):
        rheology(source, Selection(frames=slice(-1, None)))
    for margin, message in (
        (50.0, "no bulk is left"), (24.99, "no two grains"), (-1.0, "must not be negative"),
    ):  # fmt: skip
        with pytest.raises(PostError, match=message):
            rheology(source, Selection(start=0.0), margin=margin)
    still = make_source()
    for frame in still.frames:
        frame.wall_velocity[:] = 0.0
    with pytest.raises(PostError, match="'bottom' and 'top' do not shear"):
        rheology(still, Selection(start=0.0))
    with pytest.raises(PostError, match="periodic in x"):
        rheology(other(source, period=0.0), Selection(start=0.0))
    beside = make_shapes(
        [(ShapeKind.PLANE, 0, (0.0, 0.0, 1.0, 0.0)), (ShapeKind.PLANE, 1, (4.0, 0.0, -1.0, 0.0))]
    )
    with pytest.raises(PostError, match="a wall below and a wall above"):
        rheology(other(source, shapes=beside), Selection(start=0.0))
    write_heated_run(tmp_path / "run", frames=1)
    with open_run(tmp_path / "run") as run, pytest.raises(PostError, match="needs two frames"):
        rheology(run)
