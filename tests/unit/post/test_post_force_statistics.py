"""Distributions of forces and contact directions that were drawn from known ones, and the forces of a small run."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from heat_run import GRAINS, write_heated_run
from made_up_frames import source_of
from scene_parts import between_planes

from multicor_cli.post import PostError, Selection, angular_distribution, force_distribution
from multicor_cli.store import open_run

ALL = Selection(start=0.0)


def make_source(normal: np.ndarray, force: np.ndarray, *, frames: int = 1, scale: float = 1.0) -> Any:
    """Contacts between two grains with these normals and forces; those of the frame of number k are ``scale``ᵏ times as large."""
    count = len(force)
    found = [
        SimpleNamespace(
            dt=0.1,
            contacts=SimpleNamespace(
                recorded=True,
                i=np.zeros(count, np.int32),
                j=np.ones(count, np.int32),
                normal=normal,
                gap=np.zeros(count),
                force=force * scale**k,
                sliding=np.zeros(count, bool),
            ),
        )
        for k in range(frames)
    ]
    return source_of(between_planes(), found)


def exponential(count: int = 200_000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    normal = np.tile([0.0, 1.0], (count, 1))
    return normal, np.column_stack([rng.exponential(3.0, count), rng.uniform(-1.0, 1.0, count)])


def test_exponential_forces_have_an_exponential_density() -> None:
    table = force_distribution(make_source(*exponential()), ALL)
    low, high = table.edges[:-1], table.edges[1:]
    expected = (np.exp(-low) - np.exp(-high)) / (high - low)
    counts = table.count
    enough = counts > 100
    error = expected / np.sqrt(np.maximum(counts, 1))
    assert (np.abs(table.normal - expected)[enough] < 4.0 * error[enough]).all()
    assert table.mean == pytest.approx(3.0, rel=0.01)
    assert table.tangential_mean == pytest.approx(0.5, rel=0.01)
    # |f_t| is uniform between 0 and twice its mean
    assert table.tangential[(low > 0.02) & (high < 1.9)] == pytest.approx(0.5, rel=0.1)
    assert (table.tangential[low > 2.05] == 0.0).all()


def test_density_agrees_with_a_histogram() -> None:
    normal, force = exponential(5000)
    table = force_distribution(make_source(normal, force), ALL, 13)
    ratio = force[:, 0] / force[:, 0].mean()
    assert table.count.tolist() == np.histogram(ratio, table.edges)[0].tolist()
    assert (table.normal * np.diff(table.edges)).sum() == pytest.approx(table.count.sum() / 5000)
    assert table.contacts == 5000
    assert len(table.rows) == 13


def test_every_frame_counts_with_its_own_mean() -> None:
    normal, force = exponential(5000)
    one = force_distribution(make_source(normal, force), ALL)
    three = force_distribution(make_source(normal, force, frames=3, scale=10.0), ALL)
    assert three.normal == pytest.approx(one.normal)
    assert three.mean == pytest.approx(37.0 * one.mean)
    assert three.contacts == 15_000


def test_contacts_without_friction_have_no_tangential_distribution() -> None:
    normal, force = exponential(100)
    force[:, 1] = 0.0
    table = force_distribution(make_source(normal, force), ALL)
    assert np.isnan(table.tangential).all()


@pytest.mark.parametrize("turned", [False, True])
def test_angular_distribution_gives_the_anisotropies_back(turned: bool) -> None:
    """Evenly spaced directions weighted by number: contacts drawn with a_c = 0.4 at 120°, forces with a_n = 0.3, a_t = 0.1."""
    u = (np.arange(400_000) + 0.5) / 400_000 * 2.0 * np.pi
    theta = u.copy()
    for _ in range(50):  # invert the cumulative distribution θ + a/2 (sin 2(θ − c) + sin 2c) = u
        theta = u - 0.2 * (np.sin(2.0 * (theta - np.radians(120.0))) + np.sin(2.0 * np.radians(120.0)))
    if turned:
        theta = theta[::-1] + np.pi  # each contact seen from its other grain
    f = 2.0 * (1.0 + 0.3 * np.cos(2.0 * (theta - np.radians(130.0))))
    g = -2.0 * 0.1 * np.sin(2.0 * (theta - np.radians(140.0)))
    table = angular_distribution(make_source(np.column_stack([np.cos(theta), np.sin(theta)]), np.column_stack([f, g])), ALL)
    expected = {"a_c": 0.4, "a_n": 0.3, "a_t": 0.1, "theta_c": 120.0, "theta_n": 130.0, "theta_t": 140.0}
    assert table.moments == pytest.approx(expected, rel=2e-2)
    assert table.density == pytest.approx((1.0 + 0.4 * np.cos(2.0 * (table.angle - np.radians(120.0)))) / (2.0 * np.pi), rel=0.02)
    assert table.density.sum() * 2.0 * np.pi / table.angle.size == pytest.approx(1.0)
    half = table.angle.size // 2
    assert table.density[:half].tolist() == table.density[half:].tolist()


def test_directions_without_contacts_have_no_force() -> None:
    normal = np.tile([1.0, 0.0], (10, 1))
    table = angular_distribution(make_source(normal, np.ones((10, 2))), ALL, 8)
    assert np.isfinite(table.normal).tolist() == [True, False, False, False] * 2
    assert table.moments["a_c"] == pytest.approx(2.0)
    assert table.moments["theta_c"] == pytest.approx(0.0)
    for bins in (2, 7):
        with pytest.raises(PostError, match="even number"):
            angular_distribution(make_source(normal, np.ones((10, 2))), ALL, bins)


def test_walls_do_not_count_and_frames_without_forces_are_left_out(tmp_path: Path) -> None:
    write_heated_run(tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        table = force_distribution(run, ALL)
        assert table.frames.tolist() == [1, 2, 3, 4]
        assert table.contacts == 4 * (GRAINS - 1)
        assert table.mean == pytest.approx(5.0)  # of 1 … 9 N
        angles = angular_distribution(run, ALL)
        assert angles.moments["theta_c"] == pytest.approx(90.0)
    write_heated_run(tmp_path / "silent", contacts=False)
    with open_run(tmp_path / "silent") as silent:
        for function in (force_distribution, angular_distribution):
            with pytest.raises(PostError, match=r"contacts = true in \[output\]"):
                function(silent, ALL)
    alone = make_source(np.zeros((0, 2)), np.zeros((0, 2)))
    for function in (force_distribution, angular_distribution):
        with pytest.raises(PostError, match="no two grains press"):
            function(alone, ALL)
