"""Where coarse-grained fields are wanted: a grid, a polar grid, a line, or rings about a center."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.source import PostError

POINT_LIMIT = 1_000_000
"""Largest number of points; more is taken for a mistake."""


@dataclass(frozen=True)
class FieldPoints:
    """Points, with the axes along which vectors have their components there; ``m`` of them.

    Attributes:
        at: Where they are [m], shape ``(m, 2)``.
        turn: Angle by which the local axes are turned from x and y [rad], shape ``(m,)``.
        axes: Names of the local axes: x and y, or r and t (outwards, and counter-clockwise about the center).
        row: Number of the row of a table to which each point counts: of itself, or of its ring, shape ``(m,)``.
        names: Names of the coordinates of a row, and of their units.
        coordinates: The coordinates of the rows, shape ``(rows, c)``.
        shape: Numbers of rows and columns of a grid; (rows,) of a line or of rings.
        edges: Edges of the cells of a grid in both coordinates, for figures; empty of lines and rings.
        center: Center of polar coordinates [m].
    """

    at: Floats
    turn: Floats
    axes: str
    row: NDArray[np.int64]
    names: tuple[str, ...]
    coordinates: Floats
    shape: tuple[int, ...]
    edges: tuple[Floats, ...] = ()
    center: tuple[float, float] = (0.0, 0.0)

    @property
    def is_grid(self) -> bool:
        """Whether the points fill a part of the plane."""
        return len(self.shape) == 2


def grid(low: Sequence[float], high: Sequence[float], spacing: float) -> FieldPoints:
    """Centers of cells about ``spacing`` wide that fill a rectangle, row by row from below."""
    x_edges, y_edges = (_edges(a, b, spacing) for a, b in zip(low, high, strict=True))
    _refuse_many((x_edges.size - 1) * (y_edges.size - 1), spacing)
    y, x = (values.ravel() for values in np.meshgrid(_middle(y_edges), _middle(x_edges), indexing="ij"))
    at = np.column_stack([x, y])
    return FieldPoints(
        at, np.zeros(len(at)), "xy", np.arange(len(at)), ("x [m]", "y [m]"), at, (y_edges.size - 1, x_edges.size - 1),
        (x_edges, y_edges),
    )  # fmt: skip


def polar_grid(center: tuple[float, float], inner: float, outer: float, spacing: float) -> FieldPoints:
    """Centers of cells of a ring between two radii, about ``spacing`` wide in the middle; ring by ring from inside."""
    radii = _edges(inner, outer, spacing)
    around = max(np.pi * (inner + outer) / spacing, 8.0)
    _refuse_many((radii.size - 1) * around, spacing)
    turns = np.linspace(0.0, 2.0 * np.pi, round(around) + 1)
    radius, angle = (values.ravel() for values in np.meshgrid(_middle(radii), _middle(turns), indexing="ij"))
    at = _on_rings(center, radius, angle)
    shape = (radii.size - 1, turns.size - 1)
    coordinates = np.column_stack([radius, np.degrees(angle)])
    return FieldPoints(at, angle, "rt", np.arange(len(at)), ("r [m]", "angle [deg]"), coordinates, shape, (radii, turns), center)


def line(start: tuple[float, float], end: tuple[float, float], spacing: float) -> FieldPoints:
    """Points on a line, about ``spacing`` apart, both ends included; x and y components."""
    length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    if not length > 0.0:
        raise PostError("the line has no length: its ends are the same point")
    _refuse_many(length / spacing, spacing)
    part = np.linspace(0.0, 1.0, max(round(length / spacing), 1) + 1)
    at = (1.0 - part)[:, np.newaxis] * np.array(start) + part[:, np.newaxis] * np.array(end)
    names = ("distance [m]", "x [m]", "y [m]")
    rows = np.column_stack([part * length, at])
    return FieldPoints(at, np.zeros(len(at)), "xy", np.arange(len(at)), names, rows, (len(at),))


def rings(center: tuple[float, float], inner: float, outer: float, spacing: float) -> FieldPoints:
    """Rings about ``spacing`` apart between two radii, each with points that are that far from each other, or eight of them."""
    radii = _middle(_edges(inner, outer, spacing))
    _refuse_many(np.pi * (outer**2 - inner**2) / spacing**2, spacing)
    counts = np.maximum(np.round(2.0 * np.pi * radii / spacing).astype(np.int64), 8)
    row = np.repeat(np.arange(radii.size), counts)
    angle = 2.0 * np.pi * (np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[row]
    at = _on_rings(center, radii[row], angle)
    return FieldPoints(at, angle, "rt", row, ("r [m]",), radii[:, np.newaxis], (radii.size,), center=center)


def _on_rings(center: tuple[float, float], radius: Floats, angle: Floats) -> Floats:
    return np.column_stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)])


def _edges(low: float, high: float, spacing: float) -> Floats:
    return np.linspace(low, high, max(round(min((high - low) / spacing, 2.0 * POINT_LIMIT)), 1) + 1)


def _middle(edges: Floats) -> Floats:
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


def _refuse_many(count: float, spacing: float) -> None:
    if not count <= POINT_LIMIT:
        raise PostError(f"points {spacing:.3g} m apart would be {count:.3g}: choose a larger spacing, at most {POINT_LIMIT} points")
