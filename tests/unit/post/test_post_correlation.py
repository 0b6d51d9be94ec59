"""Correlations of velocities: of waves against closed forms, and pair by pair."""

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import frame_of, source_of
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, correlation
from multicor_cli.post.correlation import correlation_length
from multicor_cli.post.lattice import Lattice

ALL = Selection(start=0.0)
LATTICE = Lattice(20.0, 16.0, 5.0)
RATE = np.array([0.1, -0.2, 0.7])


def flow_at(place):
    return np.column_stack([RATE[0] * place[:, 0] + RATE[2] * place[:, 1], RATE[1] * place[:, 1]])


def cell_source(makers, count=300):
    """Frames of a cell that is strained; ``makers`` give what places add to flow and mean spin."""
    frames = []
    for seed, make in enumerate(makers):
        random = np.random.default_rng(seed)
        place = random.random((count, 2)) @ LATTICE.corners[[1, 3]]
        beside, spin = make(place, random)
        velocity = np.column_stack([flow_at(place) + beside, np.zeros(count)])
        frame = frame_of(place, walls=1, velocity=velocity, spin=spin)
        frame.wall_position, frame.wall_velocity = np.array([LATTICE]), RATE[np.newaxis]
        frames.append(frame)
    model, _ = make_cell(place, np.full(count, 0.5), LATTICE[:2], tilt=LATTICE.tilt)
    return source_of(model, frames)


def wave(place, random):
    """A transverse wave of a lattice vector, of random phase: C = J₀(k r) − averaged over it."""
    k = 2.0 * np.pi / LATTICE.height
    speed = np.sin(k * place[:, 1] + random.uniform(0.0, 2.0 * np.pi))
    return np.column_stack([speed, 0.0 * speed]), 3.0 + speed


def test_a_wave_has_the_correlation_of_its_bessel_function():
    special = pytest.importorskip("scipy.special")
    source = cell_source([wave] * 40)
    table = correlation(source, ALL, 6.0)
    expected = special.j0(2.0 * np.pi / LATTICE.height * table.distance)
    for kind in ("both", "along", "spin"):
        found = getattr(table, kind)
        away = (found - expected) / getattr(table, f"error_{kind}")
        assert np.sqrt(np.mean(away**2)) < 2.0, kind  # bins have waves in common
    assert np.isnan(table.across).all()
    crossing = 1.0 * LATTICE.height / (2.0 * np.pi) * 1.7523  # J₀(1.7523) = 1/e
    assert table.length == pytest.approx(crossing, abs=4.0 * table.error_length)
    assert table.length == pytest.approx(crossing, rel=0.03)
    assert table.fluctuation == pytest.approx(np.sqrt(0.5), rel=0.05)


def test_independent_velocities_have_none():
    def random_ones(place, random):
        return random.normal(size=place.shape), random.normal(size=len(place))

    table = correlation(cell_source([random_ones] * 30), ALL)
    for kind in ("both", "along", "across", "spin"):
        away = getattr(table, kind) / getattr(table, f"error_{kind}")
        assert 0.7 < np.sqrt(np.mean(away**2)) < 1.4, kind
    assert table.length < 0.2


def test_pairs_one_by_one():
    """In a layer between the mean flow of which the fluctuations are taken."""
    random = np.random.default_rng(3)
    model = make_model(np.full(60, 0.5), period=12.0)
    frames = []
    for _ in range(3):
        place = random.random((60, 2)) * [12.0, 9.0]
        velocity = np.column_stack([random.normal(size=(60, 2)), np.zeros(60)])
        velocity[:, 0] += 2.0 * place[:, 1]
        spin = random.normal(size=60)
        frames.append(frame_of(place, walls=1, velocity=velocity, spin=spin))
    source = source_of(model, frames)
    table = correlation(source, ALL, 3.0, 6, margin=0.5)

    from multicor_cli.post.bins import make_bins
    from multicor_cli.post.flow import mean_flow

    flow = mean_flow(source, np.arange(3), make_bins(source, np.arange(3)))
    products, squares, pairs, number = np.zeros((6, 2)), np.zeros(2), np.zeros(6), 0
    for frame in frames:
        y = frame.position[:, 1]
        inside = (y >= y.min() + 0.5) & (y <= y.max() - 0.5)
        at, v = frame.position[inside], flow.fluctuation(frame)[inside]
        squares += (v**2).sum(axis=0)
        number += len(v)
        for i in range(len(v)):
            for j in range(i):
                for image in (-12.0, 0.0, 12.0):
                    bin_ = int(np.hypot(*(at[i] - at[j] + [image, 0.0])) / 0.5 + 0.5) - 1
                    if 0 <= bin_ < 6:
                        products[bin_] += v[i] * v[j]
                        pairs[bin_] += 1
    assert table.pairs.tolist() == pairs[pairs > 0].tolist()
    known = pairs > 0
    over = (products / pairs[:, np.newaxis])[known]
    assert table.along == pytest.approx(over[:, 0] / (squares[0] / number))
    assert table.across == pytest.approx(over[:, 1] / (squares[1] / number))
    assert table.both == pytest.approx(over.sum(axis=1) / (squares.sum() / number))
    assert table.fluctuation == pytest.approx(np.sqrt(squares.sum() / number))
    assert table.grain_count == pytest.approx(number / 3)


def test_the_length_is_where_a_line_crosses():
    at = np.array([1.0, 2.0, 3.0])
    level = np.exp(-1.0)
    values = np.array(
        [[0.9, 0.5, 0.1], [level, level - 0.1, 0.9], [0.9, 0.8, 0.7], [0.0, 1.0, 1.0]]
    )
    expected = [2.0 + (0.5 - level) / 0.4, 1.0, np.nan, 1.0 - level]
    assert correlation_length(at, values) == pytest.approx(expected, nan_ok=True)


def test_what_is_refused():
    source = cell_source([lambda place, _: (0.0 * place, np.zeros(len(place)))])
    with pytest.raises(PostError, match="nothing moves beside the mean flow"):
        correlation(source, ALL)
    with pytest.raises(PostError, match="leave out --margin"):
        correlation(source, ALL, margin=1.0)
    with pytest.raises(PostError, match="--reach 30 is too far"):
        correlation(source, ALL, 30.0)
