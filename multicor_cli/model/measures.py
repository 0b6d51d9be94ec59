"""Areas, perimeters, centers of mass and moments of outlines, in closed form.

All are integrals along the boundary, which consists of straight lines and of arcs. That of a clump
is what lies in none of its other pieces, so that what pieces share counts once: lines and arcs are
cut where they cross, and parts are kept by where their middles lie.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import atan2, cos, hypot, sin
from multicor_cli.model.outlines import Floats, Piece

Point = tuple[float, float]

_SLACK = 1e-9
"""Of the size of a piece: nearer boundaries count as one."""


class Measures(NamedTuple):
    """Of ``n`` grains.

    Attributes:
        area: Area [m²], shape ``(n,)``.
        perimeter: Length of the outline, that of holes with it [m], shape ``(n,)``.
        center: Center of mass [m], shape ``(n, 2)``.
        gyration: Square of the radius of gyration ∫ r² dA / A about the center [m²], ``(n,)``.
    """

    area: Floats
    perimeter: Floats
    center: Floats
    gyration: Floats


class _Line(NamedTuple):
    """From one point to another, the inside on the left."""

    start: Point
    end: Point

    def at(self, share: float) -> Point:
        (x, y), (u, v) = self.start, self.end
        return x + share * (u - x), y + share * (v - y)

    def normal(self, share: float) -> Point:
        (x, y), (u, v) = self.start, self.end
        length = hypot(u - x, v - y)
        return (v - y) / length, (x - u) / length

    def part(self, first: float, last: float) -> _Line:
        return _Line(self.at(first), self.at(last))


class _Arc(NamedTuple):
    """Counter-clockwise around a center, the inside towards it; angles from ``first`` [rad]."""

    center: Point
    radius: float
    first: float
    angle: float

    def at(self, share: float) -> Point:
        (x, y), (c, s) = self.center, self.normal(share)
        return x + self.radius * c, y + self.radius * s

    def normal(self, share: float) -> Point:
        angle = self.first + share * self.angle
        return cos(angle), sin(angle)

    def part(self, first: float, last: float) -> _Arc:
        start = self.first + first * self.angle
        return _Arc(self.center, self.radius, start, (last - first) * self.angle)


_Part = _Line | _Arc


def measure(grains: Sequence[Sequence[Piece]]) -> Measures:
    """Measures of grains that consist of these pieces, which may overlap."""
    # Around a point of each, so that nothing is lost far from the origin
    origins = np.array([grain[0][0][0] for grain in grains]).reshape(-1, 2)
    lines: list[tuple[float, ...]] = []
    arcs: list[tuple[float, ...]] = []
    for k, (grain, origin) in enumerate(zip(grains, origins, strict=True)):
        pieces = [(corners - origin, rounding) for corners, rounding in grain]
        boundaries = [_boundary(*piece) for piece in pieces]
        parts = boundaries[0] if len(pieces) == 1 else _of_union(pieces, boundaries)
        for part in parts:
            if isinstance(part, _Line):
                lines.append((k, *part.start, *part.end))
            else:
                arcs.append((k, *part.center, part.radius, *part.normal(0.0), *part.normal(1.0),
                             part.angle))  # fmt: skip
    return _integrated(lines, arcs, origins)


def measure_polygons(grains: Sequence[Sequence[Floats]]) -> Measures:
    """Measures of polygons by their rings, the outline counter-clockwise, any holes clockwise."""
    origins = np.array([rings[0][0] for rings in grains]).reshape(-1, 2)
    lines = [
        (k, *start, *end)
        for k, rings in enumerate(grains)
        for ring in rings
        for start, end in _around([(x, y) for x, y in (ring - origins[k]).tolist()])
    ]
    return _integrated(lines, [], origins)


def _integrated(
    lines: Sequence[tuple[float, ...]], arcs: Sequence[tuple[float, ...]], origins: Floats
) -> Measures:
    """Measures of what parts of boundaries surround, by the rows that `_of_lines` and `_of_arcs`
    take; ``origins`` are those of the grains [m], shape ``(n, 2)``.
    """
    along = _of_lines(np.array(lines).reshape(-1, 5))
    around = _of_arcs(np.array(arcs).reshape(-1, 9))
    owner = np.concatenate([[int(row[0]) for row in rows] for rows in (lines, arcs)]).astype(int)
    columns = np.concatenate([along, around], axis=1)
    sums = np.array([np.bincount(owner, each, len(origins)) for each in columns], float)
    area, perimeter, x, y, polar = sums
    x, y, polar = x / area, y / area, polar / area
    center = np.column_stack([x, y]) + origins
    return Measures(area, perimeter, center, polar - (x * x + y * y))


# ---- Integrals over what lies between the origin and a part of the boundary: area, length,
# ∫ x dA, ∫ y dA, ∫ r² dA. By Green's theorem ∫ f dA = ∮ f (x dy − y dx) / (k + 2) for an f that is
# homogeneous of degree k.


def _of_lines(rows: Floats) -> Floats:
    """Of lines with rows owner, x, y of the start, x, y of the end; shape ``(5, n)``."""
    _, x, y, u, v = rows.T
    cross, dx, dy = x * v - y * u, u - x, v - y
    square = x * x + y * y + x * u + y * v + u * u + v * v
    return np.array([
        cross / 2.0, np.sqrt(dx * dx + dy * dy), cross * (x + u) / 6.0, cross * (y + v) / 6.0,
        cross * square / 12.0,
    ])  # fmt: skip


def _of_arcs(rows: Floats) -> Floats:
    """Of arcs: owner, x, y of the center, radius, both normals, angle [rad]; shape ``(5, n)``.

    x dy − y dx = r (r + u) dθ with u = x cos θ + y sin θ of the center, and integrals of 1, cos,
    sin and their products are known.
    """
    _, x, y, r, c0, s0, c1, s1, angle = rows.T
    of_cos, of_sin = s1 - s0, c0 - c1
    of_both = 0.5 * (s1 * s1 - s0 * s0)
    half, rest = 0.5 * angle, 0.5 * (s1 * c1 - s0 * c0)
    of_cos2, of_sin2 = half + rest, half - rest
    of_u = x * of_cos + y * of_sin
    of_u2 = x * x * of_cos2 + 2.0 * x * y * of_both + y * y * of_sin2
    square = x * x + y * y + r * r
    first = x * (r * angle + of_u) + r * (r * of_cos + x * of_cos2 + y * of_both)
    second = y * (r * angle + of_u) + r * (r * of_sin + x * of_both + y * of_sin2)
    polar = square * (r * angle + of_u) + 2.0 * r * (r * of_u + of_u2)
    return np.array([
        r * (r * angle + of_u) / 2.0, r * angle, r * first / 3.0, r * second / 3.0, r * polar / 4.0,
    ])  # fmt: skip


# ---- Boundaries


def _boundary(corners: Floats, rounding: float) -> list[_Part]:
    """Lines and arcs around a piece."""
    if len(corners) == 1:
        x, y = corners[0].tolist()
        return [_Arc((x, y), rounding, 0.0, 2.0 * math.pi)]
    points: list[Point] = [(x, y) for x, y in corners.tolist()]
    normals = [_Line(a, b).normal(0.0) for a, b in _around(points)]
    parts: list[_Part] = []
    for (a, b), (n, m) in zip(_around(points), _around(normals), strict=True):
        out = rounding * n[0], rounding * n[1]
        parts.append(_Line((a[0] + out[0], a[1] + out[1]), (b[0] + out[0], b[1] + out[1])))
        if rounding > 0.0:
            turn = abs(atan2(n[0] * m[1] - n[1] * m[0], n[0] * m[0] + n[1] * m[1]))
            parts.append(_Arc(b, rounding, atan2(n[1], n[0]), turn))
    return parts


def _around(points: list[Point]) -> Iterator[tuple[Point, Point]]:
    """Each with the next, the last with the first."""
    return zip(points, points[1:] + points[:1], strict=True)


def _of_union(pieces: Sequence[Piece], boundaries: Sequence[list[_Part]]) -> list[_Part]:
    """The parts of all boundaries that are on that of the union."""
    seen: list[_Part] = []
    slack = _SLACK * max(float(np.abs(corners).max()) + r for corners, r in pieces)
    for p, boundary in enumerate(boundaries):
        others = [part for q, each in enumerate(boundaries) if q != p for part in each]
        for part in boundary:
            cuts = {0.0, 1.0}
            for other in others:
                cuts.update(share for share in _cuts(part, other) if 0.0 < share < 1.0)
            ends = sorted(cuts)
            for first, last in pairwise(ends):
                middle = 0.5 * (first + last)
                if all(
                    _is_seen(part.at(middle), part.normal(middle), piece, slack, is_first=p < q)
                    for q, piece in enumerate(pieces)
                    if q != p
                ):
                    seen.append(part.part(first, last))
    return seen


def _is_seen(point: Point, normal: Point, piece: Piece, slack: float, *, is_first: bool) -> bool:
    """Whether a point of a boundary, with its normal, is not within another piece.

    Where both boundaries run together on the same side the first one counts, and none of two that
    are back to back.
    """
    distance, (nx, ny) = _distance(point, piece, slack)
    if abs(distance) > slack:
        return distance > 0.0
    return is_first and nx * normal[0] + ny * normal[1] > 0.0


def _distance(point: Point, piece: Piece, slack: float) -> tuple[float, Point]:
    """How far a point is outside of a piece [m], and the normal there.

    Of points that are less than the ``slack`` off a side [m] it is that of the side: the way to
    them is rounding.
    """
    x, y = point
    corners, rounding = piece[0].tolist(), piece[1]
    best, normal = math.inf, (1.0, 0.0)
    inside, out = -math.inf, normal
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        ex, ey = bx - ax, by - ay
        length = hypot(ex, ey)
        if len(corners) > 2:
            behind = ((x - ax) * ey - (y - ay) * ex) / length
            if behind > inside:
                inside, out = behind, (ey / length, -ex / length)
        share = 0.0
        if length > 0.0:
            share = min(max(((x - ax) * ex + (y - ay) * ey) / (length * length), 0.0), 1.0)
        dx, dy = x - ax - share * ex, y - ay - share * ey
        if (away := hypot(dx, dy)) < best:
            best, normal = away, (dx / away, dy / away) if away > 0.0 else normal
    if len(corners) > 2 and inside <= slack:
        return inside - rounding, out
    return best - rounding, normal


def _cuts(part: _Part, other: _Part) -> Iterator[float]:
    """Where along a part, from 0 to 1, another one crosses or begins or ends on it."""
    ends = [other.at(0.0), other.at(1.0)]
    if isinstance(part, _Line):
        (x, y), (u, v) = part
        dx, dy = u - x, v - y
        square = dx * dx + dy * dy
        yield from (((px - x) * dx + (py - y) * dy) / square for px, py in ends)
        if isinstance(other, _Line):
            (a, b), (c, d) = other
            cross = dx * (d - b) - dy * (c - a)
            if cross != 0.0:
                yield ((a - x) * (d - b) - (b - y) * (c - a)) / cross
        else:
            yield from (share for share, _ in _crossings(part, other.center, other.radius))
        return
    points = ends
    if isinstance(other, _Line):
        points += [other.at(share) for share, _ in _crossings(other, part.center, part.radius)]
    else:
        points += _common(part, other)
    for px, py in points:
        angle = atan2(py - part.center[1], px - part.center[0]) - part.first
        yield (angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))) / part.angle


def _crossings(line: _Line, center: Point, radius: float) -> Iterator[tuple[float, Point]]:
    """Where the straight line crosses a circle."""
    (x, y), (u, v) = line
    dx, dy, ox, oy = u - x, v - y, x - center[0], y - center[1]
    a, b = dx * dx + dy * dy, ox * dx + oy * dy
    root = b * b - a * (ox * ox + oy * oy - radius * radius)
    if root >= 0.0:
        for sign in (-1.0, 1.0):
            share = (-b + sign * math.sqrt(root)) / a
            yield share, line.at(share)


def _common(one: _Arc, other: _Arc) -> list[Point]:
    """Points that two circles have in common, if they are not the same."""
    dx, dy = other.center[0] - one.center[0], other.center[1] - one.center[1]
    square = dx * dx + dy * dy
    if square == 0.0:
        return []
    along = 0.5 * (1.0 + (one.radius * one.radius - other.radius * other.radius) / square)
    root = one.radius * one.radius / square - along * along
    if root < 0.0:
        return []
    x, y, up = one.center[0] + along * dx, one.center[1] + along * dy, math.sqrt(root)
    return [(x - up * dy, y + up * dx), (x + up * dy, y - up * dx)]
