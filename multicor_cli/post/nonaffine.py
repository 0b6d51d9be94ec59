"""How far grains move beside the deformation of their neighborhood: D² of Falk and Langer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.post.lattice import Lattice, gradient_of, lattice_of, near_pairs
from multicor_cli.post.source import Frame, need_same_grains

NEIGHBORHOOD = 2.5
"""Mean diameters up to which grains are neighbors, in the earlier frame."""

_FEWEST = 3  # neighbors: a gradient of displacements can always be found that takes two along
_FLAT = 1e-9  # least ratio of the moments of a neighborhood that is no straight line


def d2min(model: Model, before: Frame, after: Frame) -> Floats:
    """D²_min of each grain between two frames, per neighbor [m²], shape ``(n,)``.

    The least mean square of what the displacements of the neighbors relative to the grain, Δ, have
    beside G r, with their places r relative to it before and any one gradient G (Falk & Langer,
    Phys. Rev. E 57, 7192, 1998, equation 2.11, whose sum over neighbors is a mean here). Free
    grains are neighbors, up to `NEIGHBORHOOD` mean diameters before. nan of grains with fewer than
    three of them, or with all in a line.

    Args:
        model: The model of the grains.
        before: The earlier frame.
        after: The later one.

    Raises:
        PostError: If grains have come or gone.
    """
    need_same_grains(before, after)
    lattice = lattice_of(model, before).reduced
    points = lattice.wrapped(np.asarray(before.position, np.float64)[:, :2])
    moved = (_moved_in_cell if model.is_cell else _moved)(model, before, after, points)
    n, places = len(points), (len(points), 3)
    r_r, r_moved, squares = np.zeros(places), np.zeros((n, 2, 2)), np.zeros(n)
    number = np.zeros(n)
    reach = NEIGHBORHOOD * model.mean_diameter
    which, pairs = near_pairs(points, lattice, reach)
    for near in pairs:
        kept = np.abs(near.way) <= reach
        i, j = np.broadcast_to(near.i, kept.shape)[kept], which[near.image[kept]]
        r = near.way[kept].view(np.float64).reshape(-1, 2)
        away = moved(i, j)
        for grain in (i, j):  # with both signs turned, all sums are the same

            def add(values: Floats, grain: Any = grain) -> Floats:
                return np.asarray(np.bincount(grain, values, minlength=n), np.float64)

            number += np.bincount(grain, minlength=n)
            squares += add((away**2).sum(axis=1))
            for k, (a, b) in enumerate(((X, X), (X, Y), (Y, Y))):
                r_r[:, k] += add(r[:, a] * r[:, b])
            for a in (X, Y):
                for b in (X, Y):
                    r_moved[:, a, b] += add(away[:, a] * r[:, b])
    xx, xy, yy = r_r.T
    det = xx * yy - xy**2
    is_known = (number >= _FEWEST) & (det > _FLAT * (xx + yy) ** 2)
    divisor = np.where(is_known, det, 1.0)
    x, y = r_moved[:, :, X], r_moved[:, :, Y]
    explained = (
        x**2 * yy[:, np.newaxis] - 2.0 * x * y * xy[:, np.newaxis] + y**2 * xx[:, np.newaxis]
    ).sum(axis=1)
    left = np.maximum(squares - explained / divisor, 0.0)  # below zero is rounding
    return np.where(is_known, left / np.maximum(number, 1.0), np.nan)


Moved = Callable[[Any, Any], Floats]
"""Displacements of j relative to i, but for what is affine [m], shape ``(k, 2)``."""


def _moved(_model: Model, before: Frame, after: Frame, _points: Floats) -> Moved:
    way = (np.asarray(f.unwrapped, np.float64)[:, :2] for f in (after, before))
    moved = next(way) - next(way)
    return lambda i, j: np.asarray(moved[j] - moved[i])


def _moved_in_cell(model: Model, before: Frame, after: Frame, points: Floats) -> Moved:
    """Beside the motion of the cell, which is affine and which its images follow.

    Nobody counts how often grains cross its sides: of all images the nearest is taken.
    """
    first, second = lattice_of(model, before), lattice_of(model, after)
    end = np.asarray(after.position, np.float64)[:, :2]
    beside = end - points @ deformation(first, second, before, after).T

    def moved(i: Any, j: Any) -> Floats:
        other = beside[j] - beside[i]
        up = np.round(other[:, Y] / second.height)
        other -= up[:, np.newaxis] * np.array([second.tilt, second.height])
        other[:, X] -= second.width * np.round(other[:, X] / second.width)
        return np.asarray(other)

    return moved


def deformation(first: Lattice, second: Lattice, before: Frame, after: Frame) -> Floats:
    """The tensor that takes a cell from one frame to the next, shape ``(2, 2)``.

    The tilt is known but for a multiple of the width: that is taken which the shear rates of both
    frames come nearest to.
    """
    xx, yy = second.width / first.width, second.height / first.height
    rate = 0.5 * float(gradient_of(before)[2] + gradient_of(after)[2])
    tilt = xx * first.tilt + rate * float(after.time - before.time) * second.height
    nearest = second.tilt + second.width * round((tilt - second.tilt) / second.width)
    return np.array([[xx, (nearest - xx * first.tilt) / first.height], [0.0, yy]])
