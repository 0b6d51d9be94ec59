"""Measures of outlines: closed forms, a fine grid, clumps whose pieces overlap, touch or repeat."""

import math

import numpy as np
import pytest

from multicor_cli.model.measures import measure

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
DISC = (np.array([[0.0, 0.0]]), 1.0)


def box(left, bottom, right, top, rounding=0.0):
    return np.array([[left, bottom], [right, bottom], [right, top], [left, top]], float), rounding


def regular(n, radius=1.0, at=(0.0, 0.0), turned=0.0):
    angle = turned + 2 * np.pi * np.arange(n) / n
    return np.column_stack([np.cos(angle), np.sin(angle)]) * radius + at


def contains(points, pieces):
    """Whether points lie in a clump, by distances to edges."""
    found = np.zeros(len(points), bool)
    for corners, rounding in pieces:
        away, inside = np.full(len(points), np.inf), np.ones(len(points), bool)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            e = b - a
            share = np.clip((points - a) @ e / max(e @ e, 1e-300), 0, 1)
            away = np.minimum(away, np.hypot(*(points - a - share[:, None] * e).T))
            inside &= e[0] * (points[:, 1] - a[1]) - e[1] * (points[:, 0] - a[0]) > 0
        found |= (away <= rounding) | (inside & (len(corners) > 2))
    return found


def on_grid(pieces, n=500):
    """Area, center and gyration by counting points."""
    every = np.concatenate([c for c, _ in pieces])
    reach = max(r for _, r in pieces)
    low, high = every.min(axis=0) - reach, every.max(axis=0) + reach
    axes = [low[k] + (np.arange(n) + 0.5) / n * (high[k] - low[k]) for k in (0, 1)]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inside = points[contains(points, pieces)]
    area = len(inside) / n**2 * np.prod(high - low)
    center = inside.mean(axis=0)
    return area, center, ((inside - center) ** 2).sum(axis=1).mean()


# pieces, area, perimeter, square of the radius of gyration
a, w, r = 2.0, 0.75, 0.3
CAP = math.pi * r**2 + 2 * r * a
CLOSED = {
    "disc": ([DISC], math.pi, 2 * math.pi, 0.5),
    "square": ([(SQUARE, 0.0)], 4.0, 8.0, 2 / 3),
    "box": ([box(0, 0, a, w)], a * w, 2 * (a + w), (a * a + w * w) / 12),
    "triangle": ([(regular(3), 0.0)], 3 * math.sqrt(3) / 4, 3 * math.sqrt(3), 0.25),
    "pentagon": ([(regular(5), 0.0)], 2.5 * math.sin(0.4 * math.pi), 10 * math.sin(0.2 * math.pi),
                 (2 + math.cos(0.4 * math.pi)) / 6),
    # ∫ y² + ∫ x² of a stadium: of the rectangle, and of half discs whose centers of mass are 4r/3π off
    "stadium": ([(np.array([[-a / 2, 0.0], [a / 2, 0.0]]), r)], CAP, 2 * math.pi * r + 2 * a,
                (2 * r * a * (a * a + 4 * r * r) / 12 + math.pi * r**2 * (r * r / 2 + a * a / 4)
                 + 4 / 3 * r**3 * a) / CAP),
    "rounded square": ([(SQUARE, 0.5)], 4 + 8 * 0.5 + math.pi / 4, 8 + math.pi, None),
}  # fmt: skip


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("at", [(0.0, 0.0), (3.0, -7.0)])
def test_closed_forms(name, at):
    pieces, area, perimeter, gyration = CLOSED[name]
    found = measure([[(corners + at, rounding) for corners, rounding in pieces]])
    assert found.area[0] == pytest.approx(area, rel=1e-14)
    assert found.perimeter[0] == pytest.approx(perimeter, rel=1e-14)
    middle = np.array([a / 2, w / 2]) if name == "box" else np.zeros(2)
    assert found.center[0] == pytest.approx(middle + at, abs=1e-14)
    if gyration is not None:
        assert found.gyration[0] == pytest.approx(gyration, rel=1e-13)


def random_piece(rng):
    n = rng.integers(1, 8)
    angle = np.sort(rng.random(n)) * 2 * np.pi
    corners = np.column_stack([1.5 * np.cos(angle), np.sin(angle)]) * rng.uniform(0.3, 1.0)
    return corners + rng.uniform(-0.8, 0.8, 2), rng.uniform(0.05, 0.6)


@pytest.mark.parametrize("seed", range(24))
def test_any_shape_against_counted_points(seed):
    rng = np.random.default_rng(seed)
    pieces = [random_piece(rng) for _ in range(1 + seed % 4)]
    area, center, gyration = on_grid(pieces)
    found = measure([[DISC], pieces, [DISC]])
    assert found.area[1] == pytest.approx(area, rel=2e-3)
    assert found.center[1] == pytest.approx(center, abs=2e-3)
    assert found.gyration[1] == pytest.approx(gyration, rel=4e-3)
    assert found.area[[0, 2]] == pytest.approx(math.pi)


def lens(distance):
    """What two unit discs share."""
    half = distance / 2
    return 2 * math.acos(half) - distance * math.sqrt(1 - half * half)


@pytest.mark.parametrize("distance", [0.1, 1.0, 1.9, 2.0, 2.5])
def test_two_discs_share_a_lens(distance):
    pieces = [(np.array([[x, 0.0]]), 1.0) for x in (-distance / 2, distance / 2)]
    found = measure([pieces])
    shared = lens(distance) if distance < 2 else 0.0
    assert found.area[0] == pytest.approx(2 * math.pi - shared, rel=1e-14)
    hidden = 4 * math.acos(distance / 2) if distance < 2 else 0.0
    assert found.perimeter[0] == pytest.approx(4 * math.pi - hidden, rel=1e-13)
    assert found.center[0] == pytest.approx([0.0, 0.0], abs=1e-14)


# pieces that are together one that is known
SAME = {
    "flush boxes": ([box(0, 0, 1, 1), box(1, 0, 3, 1)], [box(0, 0, 3, 1)]),
    "overlapping boxes": ([box(0, 0, 2, 1), box(1, 0, 3, 1)], [box(0, 0, 3, 1)]),
    "one twice": ([box(0, 0, 1, 1, 0.2), box(0, 0, 1, 1, 0.2)], [box(0, 0, 1, 1, 0.2)]),
    "one within another": ([box(0, 0, 4, 3, 0.1), (np.array([[2.0, 1.0]]), 0.5)], [box(0, 0, 4, 3, 0.1)]),
    "a capsule of three": (
        [box(-1, -1, 1, 1), (np.array([[-1.0, 0.0]]), 1.0), (np.array([[1.0, 0.0]]), 1.0)],
        [(np.array([[-1.0, 0.0], [1.0, 0.0]]), 1.0)],
    ),
    "a capsule of two": (
        [(np.array([[-1.0, 0.0], [0.5, 0.0]]), 1.0), (np.array([[-0.5, 0.0], [1.0, 0.0]]), 1.0)],
        [(np.array([[-1.0, 0.0], [1.0, 0.0]]), 1.0)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_what_pieces_share_counts_once(name):
    clump, one = measure([SAME[name][0]]), measure([SAME[name][1]])
    for field, value in clump._asdict().items():
        assert value == pytest.approx(getattr(one, field), rel=1e-12), field


def test_an_l_and_a_frame_with_a_hole():
    found = measure([
        [box(0, 0, 3, 1), box(0, 0, 1, 3)],
        [box(0, 0, 4, 1), box(3, 0, 4, 4), box(0, 3, 4, 4), box(0, 0, 1, 4)],
    ])  # fmt: skip
    assert found.area == pytest.approx([5.0, 12.0], rel=1e-14)
    assert found.perimeter == pytest.approx([12.0, 24.0], rel=1e-14)
    assert found.center == pytest.approx(np.array([[1.1, 1.1], [2.0, 2.0]]), rel=1e-14)
    # ∫ r² of the outer square without the inner one
    assert found.gyration[1] == pytest.approx((4**4 - 2**4) / 6 / 12, rel=1e-13)
