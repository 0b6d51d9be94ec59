"""Pair correlation functions and structure factors of ideal gases and lattices, and against plain
sums over all pairs and waves."""

import numpy as np
import pytest
from cells import make_cell
from made_up_frames import frame_of, source_of
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, pair_correlation, structure_factor
from multicor_cli.post.lattice import Lattice
from multicor_cli.post.structure import amplitudes

ALL = Selection(start=0.0)
FRAMES = 30


def cell_source(lattice, frames):
    """Frames of discs of diameter 1 in a cell."""
    model, _ = make_cell(frames[0], np.full(len(frames[0]), 0.5), lattice[:2], tilt=lattice.tilt)
    made = [frame_of(position, walls=1) for position in frames]
    for frame in made:
        frame.wall_position = np.array([lattice], float)
    return source_of(model, made)


def walled_source(frames, period=0.0):
    """Frames of discs of diameter 1, with a period in x or without."""
    model = make_model(np.full(len(frames[0]), 0.5), period=period)
    return source_of(model, [frame_of(position) for position in frames])


def places_in(lattice, count, seed=1, frames=1):
    """Points anywhere in a cell, in images far away too."""
    random = np.random.default_rng(seed)
    part = random.random((frames, count, 2)) + random.integers(-3, 4, (frames, count, 2))
    return part @ lattice.corners[[1, 3]]


def rectangle(width, height, count, seed=1, frames=1):
    return np.random.default_rng(seed).random((frames, count, 2)) * [width, height]


# --- an ideal gas: 1 everywhere, within the errors


GASES = {
    "cell": lambda: cell_source(Lattice(30.0, 25.0, 0.0), places_in(
        Lattice(30.0, 25.0, 0.0), 600, frames=FRAMES)),
    "tilted cell": lambda: cell_source(Lattice(30.0, 25.0, 12.0), places_in(
        Lattice(30.0, 25.0, 12.0), 600, frames=FRAMES)),
    "period": lambda: walled_source(rectangle(30.0, 25.0, 600, frames=FRAMES), 30.0),
    "rectangle": lambda: walled_source(rectangle(30.0, 25.0, 600, frames=FRAMES)),
}  # fmt: skip


def is_one(value, error, weight):
    """Whether deviations from 1 are those of the errors, on average and in every bin."""
    away = (value - 1.0) / error
    assert 0.8 < np.sqrt(np.mean(away**2)) < 1.3
    assert np.abs(away).max() < 5.0
    assert np.average(value, weights=weight) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", GASES)
def test_an_ideal_gas(name):
    source = GASES[name]()
    table = pair_correlation(source, ALL)
    assert table.distance[-1] == pytest.approx(10.0)
    dense = table.pairs > 200
    is_one(table.g[dense], table.error[dense], table.pairs[dense])
    if "cell" in name:
        factor = structure_factor(source, ALL, 30)
        is_one(factor.S, factor.error, factor.vectors)
    else:  # pairs with the outermost grains count too
        whole = pair_correlation(source, ALL, margin=0.0)
        assert whole.grain_count == 600.0
        assert np.average(whole.g, weights=whole.pairs) == pytest.approx(1.0, abs=0.01)


# --- lattices: neighbors at their distances, waves at reciprocal lattice vectors


def square(size=24):
    at = np.arange(size) + 0.25
    return Lattice(float(size), float(size), 0.0), np.stack(np.meshgrid(at, at), -1).reshape(-1, 2)


def triangular(size=24):
    row = np.sqrt(0.75)
    x, k = np.meshgrid(np.arange(size) + 0.1, np.arange(size))
    return Lattice(float(size), size * row, 0.0), np.stack([x + 0.5 * k, k * row], -1).reshape(
        -1, 2
    )


LATTICES = {
    square: {1.0: 4, 2**0.5: 4, 2.0: 4, 5**0.5: 8, 8**0.5: 4, 3.0: 4},
    triangular: {1.0: 6, 3**0.5: 6, 2.0: 6, 7**0.5: 12, 3.0: 6},
}
"""Neighbors by distance: all up to 3."""


@pytest.mark.parametrize("make", LATTICES)
@pytest.mark.parametrize("turns", [0, 1, -2])
def test_neighbors_of_a_lattice(make, turns):
    """In the same bins in whatever way the cell is told."""
    lattice, position = make()
    told = lattice._replace(tilt=lattice.tilt + turns * lattice.width)
    table = pair_correlation(cell_source(told, [position]), ALL, 3.0)
    n = len(position)
    width = 0.05
    ring = 2.0 * np.pi * table.distance * width
    expected = np.zeros(60)
    for distance, number in LATTICES[make].items():
        expected[round(distance / width) - 1] += number
    np.testing.assert_allclose(table.g * ring * (n - 1) / lattice.area, expected, atol=1e-9)
    np.testing.assert_array_equal(table.pairs, n * expected / 2)
    assert (table.first_peak_distance, table.first_peak) == (1.0, table.g[19])


@pytest.mark.parametrize("make", LATTICES)
def test_waves_of_a_lattice(make):
    """The number of grains at its reciprocal lattice vectors, nothing elsewhere."""
    lattice, position = make()
    n = len(position)
    value = np.abs(amplitudes(position, lattice, 60, 60)) ** 2 / n
    size = round(np.sqrt(n))
    m, k = np.mgrid[-60:61, 0:61]
    lean = m // 2 if make is triangular else 0  # that of its rows
    peaks = (m % size == 0) & ((k + lean) % size == 0)
    np.testing.assert_allclose(value[peaks], n, rtol=1e-6)
    assert value[~peaks].max() < 1e-8
    table = structure_factor(cell_source(lattice, [position]), ALL)
    vector = 2.0 * np.pi * (1.0 if make is square else 2.0 / np.sqrt(3.0))
    shell = int(np.abs(table.wave_number - vector).argmin())
    shell = max(range(shell - 1, shell + 2), key=lambda at: table.S[at])
    # half the vectors: ±k count once
    assert table.S[shell] * table.vectors[shell] == pytest.approx(
        n * (2 if make is square else 3), rel=1e-6
    )
    assert table.S[table.wave_number < vector - 0.2].max() < 1e-8


# --- a gas against sums over all pairs and all waves


TILTED = Lattice(9.0, 8.0, 3.1)


def test_pairs_and_waves_one_by_one():
    frames = places_in(TILTED, 70, seed=4, frames=3)
    source = cell_source(TILTED, frames)
    table = pair_correlation(source, ALL, 3.0, 24)
    expected = np.zeros(24)
    shifts = [(a, b) @ TILTED.corners[[1, 3]] for a in range(-9, 10) for b in range(-8, 9)]
    for position in frames:
        away = position[:, np.newaxis] - position
        for shift in shifts:
            bins = np.round(np.hypot(*(away + shift).transpose(2, 0, 1)) / 0.125).astype(int)
            bins = bins[np.triu_indices(70, 1)]
            expected += np.bincount(bins, minlength=30)[1:25] if bins.min() < 25 else 0
    np.testing.assert_array_equal(table.pairs, expected)
    ring = 2.0 * np.pi * table.distance * 0.125
    ideal = 3 * 70 * 69 / 2 / TILTED.area * ring
    np.testing.assert_allclose(table.g, expected / ideal, rtol=1e-12)

    factor = structure_factor(source, ALL, 10)
    total, number, waves = np.zeros((3, 10))
    for m in range(-60, 61):
        for n in range(60):
            k = 2.0 * np.pi * np.array([m / 9.0, (n - m * 3.1 / 9.0) / 8.0])
            size = float(np.hypot(*k))
            if size < 30.0 and (n > 0 or m > 0):
                values = [abs(np.exp(-1j * position @ k).sum()) ** 2 / 70 for position in frames]
                total[int(size / 3.0)] += sum(values)
                number[int(size / 3.0)] += 3
                waves[int(size / 3.0)] += 3 * size
    np.testing.assert_array_equal(factor.vectors, number)
    np.testing.assert_allclose(factor.S, total / number, rtol=1e-7)
    np.testing.assert_allclose(factor.wave_number, waves / number, rtol=1e-12)


@pytest.mark.parametrize("period", [0.0, 9.0])
def test_pairs_between_walls_one_by_one(period):
    """Those of the grains that are farther from the outermost ones than the margin, over the pairs
    of points anywhere in their region."""
    (position,) = rectangle(9.0, 8.0, 90, seed=5)
    table = pair_correlation(walled_source([position], period), ALL, 2.0, 10, margin=0.5)
    low, high = position.min(axis=0) + 0.5, position.max(axis=0) - 0.5
    if period:
        low[0], high[0] = 0.0, period
    inside = position[((position >= low) & (position <= high)).all(axis=1)]
    n = len(inside)
    assert table.grain_count == n
    np.testing.assert_allclose(table.region, high - low)

    def counted(points):
        away = points[:, np.newaxis] - points
        if period:
            away[..., 0] -= period * np.round(away[..., 0] / period)
        bins = np.round(np.hypot(*away.transpose(2, 0, 1)) / 0.2).astype(int)
        return np.bincount(bins[np.triu_indices(len(points), 1)], minlength=99)[1:11]

    np.testing.assert_array_equal(table.pairs, counted(inside))
    many = low + np.random.default_rng(6).random((3000, 2)) * (high - low)
    ideal = counted(many) / (3000 * 2999) * n * (n - 1)
    np.testing.assert_allclose(table.pairs / table.g, ideal, rtol=0.02)


def test_cells_that_change():
    """Frames of several sizes count with their pairs, each with its own lattice."""
    small, large = Lattice(9.0, 8.0, 1.0), Lattice(12.0, 11.0, -2.0)
    source = cell_source(small, [places_in(small, 70)[0], places_in(large, 70)[0]])
    source.frames[1].wall_position = np.array([large], float)
    first, second, both = (
        pair_correlation(source, Selection(frames=slice(*ends)), 3.0)
        for ends in ((0, 1), (1, 2), (0, 2))
    )
    np.testing.assert_array_equal(both.pairs, first.pairs + second.pairs)
    weights = 1.0 / np.array([small.area, large.area])
    mean = (weights[0] * first.g + weights[1] * second.g) / weights.sum()
    np.testing.assert_allclose(both.g, mean, rtol=1e-12)
    assert structure_factor(source, ALL).vectors.sum() == sum(
        structure_factor(source, Selection(frames=slice(k, k + 1))).vectors.sum() for k in (0, 1)
    )


def test_waves_end_earlier_in_a_large_cell(monkeypatch):
    source = cell_source(TILTED, places_in(TILTED, 70))
    whole = structure_factor(source, ALL)
    monkeypatch.setitem(structure_factor.__globals__, "_GRID", 1000)
    part = structure_factor(source, ALL)
    assert 3.0 < part.wave_number[-1] < 7.0 < 29.0 < whole.wave_number[-1]
    assert part.wave_number[0] == pytest.approx(whole.wave_number[0], rel=0.2)


# --- what is in tables, and what is refused


def test_what_is_in_a_table():
    lattice = Lattice(9.0, 8.0, 3.1)
    source = cell_source(lattice, places_in(lattice, 70, frames=4))
    table, factor = pair_correlation(source, ALL), structure_factor(source, ALL)
    # half of the least height, 8 cos of the slant
    across = 9.0 / np.hypot(1.0, 3.1 / 8.0)
    assert table.distance[-1] == pytest.approx(0.05 * int(0.5 * min(across, 8.0) / 0.05 - 0.5))
    assert table.headings == ("r/d [1]", "r [m]", "g [1]", "standard error [1]", "pairs")
    assert factor.headings == ("k d [1]", "k [1/m]", "S [1]", "standard error [1]", "vectors")
    data = table.as_dict()
    assert (data["mean_diameter"], data["frame_count"], data["margin"]) == (1.0, 4, 0.0)
    assert (data["grain_count"], data["region"]) == (70.0, [9.0, 8.0])
    assert data["first_peak"] == max(data["g"])
    assert "too few frames" in data["note"]
    assert len(data["standard_error"]) == len(table.rows)
    assert np.isnan(pair_correlation(source, Selection(frames=slice(0, 1))).error).all()
    assert table.to_pandas().attrs["units"] == {
        "r/d": "1", "r": "m", "g": "1", "standard error": "1"
    }  # fmt: skip


REFUSED = {
    "too far": ({"reach": 4.0}, "--reach 4 is too far: .* of the grains, 4 mean diameters"),
    "no distance": ({"reach": 0.0}, "the largest distance 0 must be positive"),
    "no bins": ({"bins": 0}, "0 bins: choose between 1"),
    "no sides": ({"margin": 1.0}, "has no sides: leave out --margin"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name):
    more, message = REFUSED[name]
    lattice = Lattice(9.0, 8.0, 0.0)
    source = cell_source(lattice, places_in(lattice, 70))
    with pytest.raises(PostError, match=message):
        pair_correlation(source, ALL, **more)


def test_wrong_runs_are_refused():
    source = walled_source(rectangle(9.0, 8.0, 70))
    with pytest.raises(PostError, match=r'needs a cell .* give \[domain\] periodic = \["x", "y"\]'):
        structure_factor(source, ALL)
    with pytest.raises(PostError, match=r"only 0 mean diameters.* lower --margin"):
        pair_correlation(source, ALL, margin=5.0)
    with pytest.raises(PostError, match="must not be negative"):
        pair_correlation(source, ALL, margin=-1.0)
    alone = walled_source([[[0.0, 0.0], [9.0, 8.0], [4.0, 4.0]]])
    with pytest.raises(PostError, match="no two grains in the region"):
        pair_correlation(alone, ALL)
    with pytest.raises(PostError, match="no frames yet"):
        pair_correlation(source_of(source.model, []))
    with pytest.raises(PostError, match="no grain is there in frame 0"):
        pair_correlation(source_of(source.model, [frame_of(np.zeros((0, 2)))]), ALL)
