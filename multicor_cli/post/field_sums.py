"""Where coarse-grained fields are wanted, and the densities of a frame that they are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import XX, XY, YY
from multicor_cli.model.model import Floats, Model
from multicor_cli.post.coarse import CoarseGrid
from multicor_cli.post.contacts import contacts_at, heat_flows
from multicor_cli.post.lattice import gradient_of, relative_velocity
from multicor_cli.post.source import Frame, PostError, places_of
from multicor_cli.post.table import Quantity

# ---- Where coarse-grained fields are wanted: a grid, a polar grid, a line, or rings about a center

POINT_LIMIT = 1_000_000
"""Largest number of points; more is taken for a mistake."""


@dataclass(frozen=True)
class FieldPoints:
    """Points, with the axes along which vectors have their components there; ``m`` of them.

    Attributes:
        at: Where they are [m], shape ``(m, 2)``.
        turn: Angle by which the local axes are turned from x and y [rad], shape ``(m,)``.
        axes: Names of the local axes: x, y, or r, t (outwards, counter-clockwise about the center).
        row: Row of a table to which each point counts: its own, or its ring's, shape ``(m,)``.
        names: Names of the coordinates of a row, and of their units.
        coordinates: The coordinates of the rows, shape ``(rows, c)``.
        shape: Numbers of rows and columns of a grid; (rows,) of a line or of rings.
        edges: Edges of the cells of a grid in both coordinates; empty of lines and rings.
        center: Center of polar coordinates [m].
        slant: How far the sides of a grid over a cell lean to the right per height.
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
    slant: float = 0.0

    @property
    def is_grid(self) -> bool:
        """Whether the points fill a part of the plane."""
        return len(self.shape) == 2

    @cached_property
    def axis(self) -> Floats | None:
        """The first of the local axes in x and y, shape ``(2, m)``; None if it is x everywhere."""
        return np.array([np.cos(self.turn), np.sin(self.turn)]) if self.turn.any() else None


def grid(
    low: Sequence[float], high: Sequence[float], spacing: float, slant: float = 0.0
) -> FieldPoints:
    """Centers of cells about ``spacing`` wide that fill a rectangle, row by row from below.

    With a ``slant`` rows are shifted to the right by so much per height.
    """
    x_edges, y_edges = (_edges(a, b, spacing) for a, b in zip(low, high, strict=True))
    _refuse_many((x_edges.size - 1) * (y_edges.size - 1), spacing)
    y, x = (
        values.ravel() for values in np.meshgrid(*map(_middle, (y_edges, x_edges)), indexing="ij")
    )
    at = np.column_stack([x + slant * y, y])
    turn, row, shape = np.zeros(len(at)), np.arange(len(at)), (y_edges.size - 1, x_edges.size - 1)
    names = ("x [m]", "y [m]")
    edges = (x_edges, y_edges)
    return FieldPoints(at, turn, "xy", row, names, at, shape, edges, slant=slant)


def polar_grid(
    center: tuple[float, float], inner: float, outer: float, spacing: float
) -> FieldPoints:
    """Centers of cells of a ring, about ``spacing`` wide in the middle; rings from inside."""
    radii = _edges(inner, outer, spacing)
    around = max(np.pi * (inner + outer) / spacing, 8.0)
    _refuse_many((radii.size - 1) * around, spacing)
    turns = np.linspace(0.0, 2.0 * np.pi, round(around) + 1)
    radius, angle = (v.ravel() for v in np.meshgrid(*map(_middle, (radii, turns)), indexing="ij"))
    at = _on_rings(center, radius, angle)
    shape = (radii.size - 1, turns.size - 1)
    coordinates = np.column_stack([radius, np.degrees(angle)])
    names, row = ("r [m]", "angle [deg]"), np.arange(len(at))
    return FieldPoints(at, angle, "rt", row, names, coordinates, shape, (radii, turns), center)


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
    """Rings about ``spacing`` apart, of points that far from each other, eight at least."""
    radii = _middle(_edges(inner, outer, spacing))
    _refuse_many(np.pi * (outer**2 - inner**2) / spacing**2, spacing)
    counts = np.maximum(np.round(2.0 * np.pi * radii / spacing).astype(np.int64), 8)
    row = np.repeat(np.arange(radii.size), counts)
    number = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    angle = 2.0 * np.pi * number / counts[row]
    at, r = _on_rings(center, radii[row], angle), radii[:, np.newaxis]
    return FieldPoints(at, angle, "rt", row, ("r [m]",), r, (radii.size,), center=center)


def _on_rings(center: tuple[float, float], radius: Floats, angle: Floats) -> Floats:
    return np.column_stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)])


def _edges(low: float, high: float, spacing: float) -> Floats:
    return np.linspace(low, high, max(round(min((high - low) / spacing, 2.0 * POINT_LIMIT)), 1) + 1)


def _middle(edges: Floats) -> Floats:
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


def _refuse_many(count: float, spacing: float) -> None:
    if not count <= POINT_LIMIT:
        raise PostError(
            f"points {spacing:.3g} m apart would be {count:.3g}: choose a larger spacing, at most "
            f"{POINT_LIMIT} points"
        )


# ---- Densities, and fields made of them; see `multicor_cli.post.coarse`

_GRAINS = ("area", "mass", "p0", "p1", "spin", "k00", "k01", "k11", "c0", "c1")
_HEAT = ("capacity", "energy")
_SLOPES = ("m_0", "m_1", "p0_0", "p0_1", "p1_0", "p1_1")
_STRESS = ("s00", "s01", "s10", "s11")
_FLUX = ("q0", "q1")
_WHICH = {"x": "horizontal", "y": "vertical", "r": "radial", "t": "azimuthal"}
Pairs = tuple[tuple[int, int], ...]
_ALL: Pairs = ((0, 0), (0, 1), (1, 0), (1, 1))
_SYMMETRIC: Pairs = ((0, 0), (0, 1), (1, 1))


@dataclass(frozen=True)
class Field(Quantity):
    """A coarse-grained field; signed ones have values of both signs."""

    is_signed: bool = False


class Known(NamedTuple):
    """Whether frames have temperatures, forces of contacts, and heat flows of contacts."""

    heat: bool
    stress: bool
    flux: bool


def field_list(axes: str, known: Known) -> list[Field]:
    """The fields that there are, with their components along the local axes."""
    tex = [r"\theta" if axis == "t" else axis for axis in axes]

    def tensor(
        name: str, symbol: str, unit: str, pairs: Pairs = _SYMMETRIC, *, is_signed: bool = False
    ) -> list[Field]:
        made = []
        for i, j in pairs:
            names = axes[i] + axes[j]
            label = f"{'contact ' * (name == 'stress')}{name.replace('-', ' ')} {names}"
            both = f"{symbol}_{{{tex[i]} {tex[j]}}}"
            made.append(Field(f"{name}-{names}", label, both, unit, is_signed or i != j))
        return made

    found = [
        Field("solid-fraction", "solid fraction", r"\nu", "1"),
        *(
            Field(f"velocity-{k}", f"{_WHICH[k]} velocity", f"v_{t}", "m/s", True)
            for k, t in zip(axes, tex, strict=True)
        ),
        Field("speed", "speed of the mean flow", r"|\mathbf{v}|", "m/s"),
        Field("spin", "spin", r"\omega", "rad/s", True),
        Field("shear-rate", "shear rate", r"|\dot\gamma|", "1/s"),
        *tensor("strain-rate", r"\dot\varepsilon", "1/s", is_signed=True),
        Field("vorticity", "vorticity", r"\nabla\times\mathbf{v}", "1/s", True),
        Field("granular-temperature", "granular temperature", r"T_g", "m2/s2"),
        *tensor("kinetic-stress", r"\sigma^\mathrm{kin}", "N/m"),
    ]
    if known.heat:
        found.append(Field("temperature", "temperature", "T", "K"))
    if known.flux:
        found += [
            Field(f"heat-flux-{k}", f"{_WHICH[k]} heat flux of contacts", f"q_{t}", "W/m", True)
            for k, t in zip(axes, tex, strict=True)
        ]
        found.append(Field("heat-flux", "heat flux of contacts", r"|\mathbf{q}|", "W/m"))
    if known.stress:
        found.append(Field("pressure", "contact pressure", "p", "N/m"))
        found += tensor("stress", r"\sigma", "N/m", _ALL)
        found += [
            Field("friction", "friction", r"\mu", "1"),
            Field("inertial-number", "inertial number", r"I_\rho", "1"),
            Field("fluidity", "fluidity", "g", "1/s"),
        ]
    return found


def column_names(known: Known) -> tuple[str, ...]:
    """Names of the densities of a frame."""
    more = zip(known, (_HEAT, _STRESS, _FLUX), strict=True)
    return (*_GRAINS, *_SLOPES, *(name for is_there, names in more if is_there for name in names))


def frame_sums(frame: Frame, points: FieldPoints, coarse: CoarseGrid, known: Known) -> Floats:
    """Densities of a frame by `column_names`, along local axes; means over rings; ``(rows, q)``."""
    model = frame.model
    position = coarse.lattice.wrapped(places_of(frame))
    columns = _of_grains(frame, model, position, points, coarse, known)
    if known.stress or known.flux:
        columns += _of_contacts(frame, model, position, points, coarse, known)
    if len(points.coordinates) == len(points.at):  # a row for each point
        return np.array(columns).T
    weight = np.bincount(points.row)
    return np.array([np.bincount(points.row, column) / weight for column in columns]).T


def _of_grains(
    frame: Frame,
    model: Model,
    position: Floats,
    points: FieldPoints,
    coarse: CoarseGrid,
    known: Known,
) -> list[Floats]:
    grains, velocity = model.grains, np.asarray(frame.velocity, np.float64)[:, :2]
    m = grains.mass
    if model.is_cell:  # only velocities relative to the mean flow are those of all images
        velocity = relative_velocity(frame)
    vx, vy = velocity.T
    spin = m * np.asarray(frame.spin, np.float64)
    carried = [
        model.area, m, m * vx, m * vy, spin, m * vx * vx, m * vx * vy, m * vy * vy,
    ]  # fmt: skip
    if known.heat:
        assert model.thermal is not None
        capacity = model.thermal.capacity
        carried += [capacity, capacity * np.asarray(frame.temperature)]
    found, slopes = coarse.of_grains(position, np.column_stack(carried), slice(1, 4))
    found, slopes = np.ascontiguousarray(found.T), np.ascontiguousarray(slopes.T)
    area, mass, px, py, turned, xx, xy, yy = found[:8]
    (mx, px_x, py_x), (my, px_y, py_y) = slopes
    beside = px, py  # momentum beside the mean flow of a cell, of this frame
    if model.is_cell:
        gradient = gradient_of(frame)
        u, v = mean_flow(points.at, gradient).T
        px_x, px_y = px_x + mx * u + mass * gradient[XX], px_y + my * u + mass * gradient[XY]
        py_x, py_y = py_x + mx * v, py_y + my * v + mass * gradient[YY]
        px, py = px + mass * u, py + mass * v
    k00, k01, _, k11 = _tensor(xx, xy, xy, yy, points.axis)
    momentum, slope = _vector(px, py, points.axis), _vector(mx, my, points.axis)
    flow = _tensor(px_x, px_y, py_x, py_y, points.axis)
    own = _vector(*beside, points.axis)
    return [area, mass, *momentum, turned, k00, k01, k11, *own, *slope, *flow, *found[8:]]


def _of_contacts(
    frame: Frame,
    model: Model,
    position: Floats,
    points: FieldPoints,
    coarse: CoarseGrid,
    known: Known,
) -> list[Floats]:
    """Stress and heat flux: contacts that carry both are looked at once."""
    flow, is_loaded = np.zeros(len(frame.contacts.i)), False
    if known.stress:
        is_loaded = frame.contacts.force[:, 0] != 0.0
    if known.flux:
        flows = heat_flows(frame, model)
        flow[flows.contacts.row] = flows.flow
    row = np.flatnonzero(is_loaded | (flow != 0.0))
    contacts = contacts_at(frame, model, row)
    carried = [contacts.virial(a, b) for a, b in _ALL] if known.stress else []
    if known.flux:
        carried += [flow[contacts.row] * contacts.branch[:, a] for a in (0, 1)]
    start, values = position[contacts.i], np.column_stack(carried)
    found = np.ascontiguousarray(coarse.densities_along(start, -contacts.branch, values).T)
    columns = []
    if known.stress:
        xx, xy, yx, yy = found[:4]
        columns += _tensor(xx, xy, yx, yy, points.axis)
    if known.flux:
        x, y = found[-2:]
        columns += _vector(x, y, points.axis)
    return columns


def derive(sums: Floats, names: tuple[str, ...], axes: str, diameter: float) -> dict[str, Floats]:
    """The fields, by name, from mean densities ``(…, q)``; nan where nothing is near.

    Velocity is momentum over mass (spin likewise), gradients those of the mean velocity, (∂_b p_a −
    v_a ∂_b m)/m. Granular temperature is half the trace of the kinetic stress over the mass. The
    shear rate is √((ε_aa − ε_bb)² + 4 ε_ab²): |γ̇| in simple shear. Of the stresses of contacts and
    of fluctuations together, P is half the trace and τ half the difference of the principal ones of
    the symmetric part. So friction is μ = τ/P, the inertial number I = |γ̇| d̄/√(P/ρ) with the mean
    ``diameter`` [m] and the mass ρ of the grains per area that they cover (GDR MiDi, Eur. Phys. J.
    E 14, 341, 2004), the fluidity g = |γ̇|/μ (Kamrin & Koval, Phys. Rev. Lett. 108, 178301, 2012);
    they are nan where P is not above 0.
    """
    s = dict(zip(names, np.moveaxis(sums, -1, 0), strict=True))
    a, b = axes[0], axes[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        m = s["mass"]
        v = (s["p0"] / m, s["p1"] / m)
        slope = {(i, j): (s[f"p{i}_{j}"] - v[i] * s[f"m_{j}"]) / m for i in (0, 1) for j in (0, 1)}
        shear = 0.5 * (slope[0, 1] + slope[1, 0])
        kinetic = {(i, j): s[f"k{i}{j}"] - s[f"c{i}"] * s[f"c{j}"] / m for i, j in _SYMMETRIC}
        for k in (0, 1):  # squares: below zero is rounding
            kinetic[k, k] = np.maximum(kinetic[k, k], 0.0)
        found = {
            "solid-fraction": s["area"],
            f"velocity-{a}": v[0],
            f"velocity-{b}": v[1],
            "speed": np.hypot(*v),
            "spin": s["spin"] / m,
            "shear-rate": np.hypot(slope[0, 0] - slope[1, 1], 2.0 * shear),
            f"strain-rate-{a}{a}": slope[0, 0],
            f"strain-rate-{a}{b}": shear,
            f"strain-rate-{b}{b}": slope[1, 1],
            "vorticity": slope[1, 0] - slope[0, 1],
            "granular-temperature": 0.5 * (kinetic[0, 0] + kinetic[1, 1]) / m,
            f"kinetic-stress-{a}{a}": kinetic[0, 0],
            f"kinetic-stress-{a}{b}": kinetic[0, 1],
            f"kinetic-stress-{b}{b}": kinetic[1, 1],
        }
        if "energy" in s:
            found["temperature"] = s["energy"] / s["capacity"]
    if "s00" in s:
        found["pressure"] = 0.5 * (s["s00"] + s["s11"])
        found |= {f"stress-{axes[i]}{axes[j]}": s[f"s{i}{j}"] for i in (0, 1) for j in (0, 1)}
        with np.errstate(invalid="ignore", divide="ignore"):
            found |= _rheology(s, kinetic, found["shear-rate"], diameter)
    if "q0" in s:
        found |= {f"heat-flux-{axes[i]}": s[f"q{i}"] for i in (0, 1)}
        found["heat-flux"] = np.hypot(s["q0"], s["q1"])
    is_empty = ~(m > 0.0)
    return {
        name: np.where(is_empty & (name != "solid-fraction"), np.nan, values)
        for name, values in found.items()
    }


def _rheology(
    s: dict[str, Floats], kinetic: dict[tuple[int, int], Floats], rate: Floats, diameter: float
) -> dict[str, Floats]:
    """Friction, inertial number and fluidity; see `derive`."""
    xx, yy = (s[f"s{i}{i}"] + kinetic[i, i] for i in (0, 1))
    xy = 0.5 * (s["s01"] + s["s10"]) + kinetic[0, 1]
    pressure = 0.5 * (xx + yy)
    pressure = np.where(pressure > 0.0, pressure, np.nan)
    friction = np.hypot(0.5 * (xx - yy), xy) / pressure
    return {
        "friction": friction,
        "inertial-number": rate * diameter * np.sqrt(s["mass"] / s["area"] / pressure),
        "fluidity": np.where(friction > 0.0, rate / friction, np.nan),
    }


def _vector(x: Floats, y: Floats, axis: Floats | None) -> list[Floats]:
    """Components of vectors along axes that are turned."""
    if axis is None:
        return [x, y]
    c, s = axis
    return [c * x + s * y, c * y - s * x]


def _tensor(xx: Floats, xy: Floats, yx: Floats, yy: Floats, axis: Floats | None) -> list[Floats]:
    """Components of tensors along axes that are turned: R T Rᵀ, row by row."""
    (ax, bx), (ay, by) = _vector(xx, yx, axis), _vector(xy, yy, axis)  # the first index
    return [*_vector(ax, ay, axis), *_vector(bx, by, axis)]
