"""Pairs of grains and what is summed over them, against all images of all grains one by one."""

import numpy as np
import pytest
from made_up_frames import frame_of, source_of
from scene_parts import make_model

from multicor_cli.post import PostError, Selection, pair_correlation
from multicor_cli.post.lattice import Lattice, near_pairs, pair_sums


def scattered(lattice, count=90):
    place = np.random.default_rng(4).random((count, 2)) * [9.0, 7.0]
    return lattice.wrapped(place)


def square(lattice):
    """Rows and columns in line, where pairs are neither left nor right, above nor below."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(7.0))
    return lattice.wrapped(np.column_stack([x.ravel(), y.ravel()]))


def all_ways(points, lattice, reach):
    """From each grain to each image within reach, both ways round, without itself."""
    steps = range(-3, 4)
    found = []
    for across in steps if lattice.width > 0.0 else [0]:
        for up in steps if lattice.height > 0.0 else [0]:
            shift = [across * lattice.width + up * lattice.tilt, up * lattice.height]
            way = points[np.newaxis] + shift - points[:, np.newaxis]
            distance = np.hypot(*way.transpose(2, 0, 1))
            is_near = distance <= reach
            if not (across or up):
                np.fill_diagonal(is_near, val=False)
            i, j = np.nonzero(is_near)
            found.append((i, j, distance[i, j]))
    return [np.concatenate(column) for column in zip(*found, strict=True)]


@pytest.mark.parametrize("chunk", [50, 16384])
@pytest.mark.parametrize("make", [scattered, square])
@pytest.mark.parametrize(
    "lattice", [Lattice(), Lattice(9.0), Lattice(9.0, 7.0), Lattice(9.0, 7.0, -4.0)]
)
def test_pairs_and_their_sums(monkeypatch, lattice, make, chunk):
    """Each pair once, also with several images of a grain and with itself, whatever the chunks."""
    monkeypatch.setattr("multicor_cli.post.lattice._CHUNK", chunk)
    points, width, count = make(lattice), 0.37, 14
    i, j, distance = all_ways(points, lattice, (count + 0.5) * width)
    which, found = near_pairs(points, lattice, (count + 0.5) * width)
    told = []
    for near in found:
        kept = np.abs(near.way) <= (count + 0.5) * width
        first = np.broadcast_to(near.i, kept.shape)[kept]
        told += zip(first, which[near.image[kept]], np.abs(near.way[kept]), strict=True)
    first, second, away = np.array(told).T
    both = np.concatenate([[first, second, away], [second, first, away]], axis=1)
    expected = np.array([i, j, distance])
    for ways in (both, expected):
        ways[:] = ways[:, np.lexsort([*ways[:2], ways[2].round(9)])]
    assert both == pytest.approx(expected)
    values = np.random.default_rng(5).standard_normal((2, len(points)))
    sums = pair_sums(points, lattice, width, count, values)
    bin_ = np.floor(distance / width + 0.5).astype(int)
    for total, weight in zip(sums, [np.ones(i.size), *(values[:, i] * values[:, j])], strict=True):
        half = 0.5 * np.bincount(bin_, weight, minlength=count + 1)[1 : count + 1]
        assert total == pytest.approx(half, abs=1e-12)
    assert pair_sums(points, lattice, width, count) == pytest.approx(sums[:1])


def test_nobody_has_no_pairs():
    """Of a layer of two grains the margin leaves nothing."""
    assert not pair_sums(np.zeros((0, 2)), Lattice(9.0), 0.4, 3, np.zeros((1, 0))).any()
    model = make_model(np.full(2, 0.5), period=9.0)
    source = source_of(model, [frame_of([[1.0, 0.0], [2.0, 8.0]])])
    with pytest.raises(PostError, match="no two grains in the region: lower --margin"):
        pair_correlation(source, Selection(start=0.0))
