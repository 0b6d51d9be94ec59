"""Models, frames and contacts of grains that are no discs, by hand."""

from dataclasses import replace

import numpy as np
import shaped_run
import shapes
from made_up_frames import contacts_of, frame_of
from scene_parts import make_model

from multicor_cli.model.outlines import Outlines


def regular(sides, radius=1.0, rounding=0.0, turn=0.0):
    """A piece of equal sides, whose corners lie on a circle."""
    return shapes.regular(sides, radius, turn), rounding


def box(width, height, rounding=0.0, at=(0.0, 0.0)):
    """A rectangle; the rounding is added all around."""
    x, y = 0.5 * width, 0.5 * height
    return shaped_run.box(-x, -y, x, y) + at, rounding


def disc(radius, at=(0.0, 0.0)):
    return np.array([at], float), radius


def rod(length, radius):
    """Of this length from center to center of its ends."""
    return shapes.rod(length), radius


def shoelace(points):
    """Area of a polygon, counter-clockwise."""
    (x, y), (u, v) = points.T, np.roll(points, -1, axis=0).T
    return 0.5 * float((x * v - u * y).sum())


def outlines_of(grains, areas=None):
    """Outlines of grains of one piece, or of pieces with areas that are told."""
    area, perimeter = zip(*(shaped_run.measures(*pieces[0]) for pieces in grains), strict=True)
    return Outlines.of(grains, np.array(areas or area), np.array(perimeter))


def shaped_model(grains, on=(), walls=("floor",), *, areas=None, **keys):
    """As `make_model`, of grains that consist of pieces; the mass is the area."""
    outlines = outlines_of(grains, areas)
    model = make_model(outlines.radius, on, walls, **keys)
    mass = outlines.area
    own = replace(model.grains, mass=mass, inertia=mass * outlines.radius**2 / 3.0)
    return replace(model, grains=own, outlines=outlines)


def shaped_frame(position, angle=0.0, *, contacts=None, **said):
    """As `frame_of`, with angles."""
    angle = np.broadcast_to(np.asarray(angle, float), len(position)).copy()
    said |= {} if contacts is None else {"contacts": contacts}
    return frame_of(position, angle=angle, is_open=False, **said)


def points_of(i, j, normal, force, arm, gap=0.0, sliding=False):
    """Contacts with a row per point, sorted by (i, j)."""
    order = np.lexsort((j, i))
    count = len(order)
    columns = (np.broadcast_to(np.asarray(each, float), (count, 2)) for each in (normal, force))
    found = contacts_of(*(np.asarray(end)[order] for end in (i, j)), *(c[order] for c in columns))
    found.arm = np.broadcast_to(np.asarray(arm, float), (count, 2))[order]
    found.gap = np.broadcast_to(np.asarray(gap, float), count)[order]
    found.sliding = np.broadcast_to(np.asarray(sliding, bool), count)[order]
    found.slip, found.conductance = np.zeros(count), None
    return found


def below(points, height):
    """Area of a polygon below a level line, clipped corner by corner (Sutherland & Hodgman)."""
    kept = []
    for (x, y), (u, v) in zip(points, np.roll(points, -1, axis=0), strict=True):
        if y <= height:
            kept.append((x, y))
        if (y - height) * (v - height) < 0.0:
            kept.append((x + (height - y) / (v - y) * (u - x), height))
    return shoelace(np.array(kept)) if len(kept) > 2 else 0.0


def chords(pieces, angle, heights):
    """Lengths of the level lines at heights in a grain of pieces, whose overlaps count once."""
    c, s = np.cos(angle), np.sin(angle)
    spans = []
    for corners, r in pieces:
        at = corners @ np.array([[c, s], [-s, c]])
        left, right = np.full(heights.size, np.inf), np.full(heights.size, -np.inf)
        for (x, y), (u, v) in zip(at, np.roll(at, -1, axis=0), strict=True):
            half = np.sqrt(np.maximum(r * r - (heights - y) ** 2, 0.0))
            is_met = np.abs(heights - y) <= r
            left[is_met] = np.minimum(left, x - half)[is_met]
            right[is_met] = np.maximum(right, x + half)[is_met]
            if (length := np.hypot(u - x, v - y)) > 0.0:
                out = r * np.array([v - y, x - u]) / length
                a, b, p, q = x + out[0], y + out[1], u + out[0], v + out[1]
                is_met = (heights - b) * (heights - q) < 0.0
                there = a + (heights[is_met] - b) / (q - b) * (p - a)
                left[is_met] = np.minimum(left[is_met], there)
                right[is_met] = np.maximum(right[is_met], there)
        spans.append((left, right))
    found = np.zeros(heights.size)
    for k in range(heights.size):
        reached = -np.inf
        for begin, end in sorted((left[k], right[k]) for left, right in spans):
            found[k] += max(end - max(begin, reached), 0.0)
            reached = max(reached, end)
    return found
