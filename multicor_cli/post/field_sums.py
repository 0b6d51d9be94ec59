"""The densities of which coarse-grained fields are made, frame by frame, and the fields made of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from multicor_cli.model.model import Floats, Model
from multicor_cli.post.coarse import CoarseGrid
from multicor_cli.post.contacts import loaded_contacts
from multicor_cli.post.field_points import FieldPoints
from multicor_cli.post.source import FrameSource, GrainFrame, model_of

_GRAINS = ("area", "mass", "p0", "p1", "spin", "k00", "k01", "k11")
_HEAT = ("capacity", "energy")
_SLOPES = ("m_0", "m_1", "p0_0", "p0_1", "p1_0", "p1_1")
_STRESS = ("s00", "s01", "s10", "s11")
_WHICH = {"x": "horizontal", "y": "vertical", "r": "radial", "t": "azimuthal"}
_SYMMETRIC = ((0, 0), (0, 1), (1, 1))


class Field(NamedTuple):
    """A coarse-grained field: its name, what it is called, its symbol in figures (TeX), its unit and whether it has both signs."""

    name: str
    label: str
    symbol: str
    unit: str
    is_signed: bool = False


def field_list(axes: str, *, has_heat: bool, has_stress: bool) -> list[Field]:
    """The fields that there are, with their components along the local axes."""
    tex = [r"\theta" if axis == "t" else axis for axis in axes]

    def tensor(name: str, symbol: str, unit: str, pairs: tuple[tuple[int, int], ...], *, is_signed: bool = False) -> list[Field]:
        made = []
        for i, j in pairs:
            names = f"{axes[i]}{axes[j]}"
            label = f"{name.replace('-', ' ')} {names}"
            made.append(Field(f"{name}-{names}", label, f"{symbol}_{{{tex[i]} {tex[j]}}}", unit, is_signed or i != j))
        return made

    found = [
        Field("solid-fraction", "solid fraction", r"\nu", "1"),
        *(Field(f"velocity-{k}", f"{_WHICH[k]} velocity", f"v_{t}", "m/s", True) for k, t in zip(axes, tex, strict=True)),
        Field("speed", "speed of the mean flow", r"|\mathbf{v}|", "m/s"),
        Field("spin", "spin", r"\omega", "rad/s", True),
        Field("shear-rate", "shear rate", r"|\dot\gamma|", "1/s"),
        *tensor("strain-rate", r"\dot\varepsilon", "1/s", _SYMMETRIC, is_signed=True),
        Field("vorticity", "vorticity", r"\nabla\times\mathbf{v}", "1/s", True),
        Field("granular-temperature", "granular temperature", r"T_g", "m2/s2"),
        *tensor("kinetic-stress", r"\sigma^\mathrm{kin}", "N/m", _SYMMETRIC),
    ]
    if has_heat:
        found.append(Field("temperature", "temperature", "T", "K"))
    if has_stress:
        found.append(Field("pressure", "contact pressure", "p", "N/m"))
        found += tensor("stress", r"\sigma", "N/m", ((0, 0), (0, 1), (1, 0), (1, 1)))
    return found


def column_names(*, has_heat: bool, has_stress: bool) -> tuple[str, ...]:
    """Names of the densities of a frame."""
    return (*_GRAINS, *_SLOPES, *(_HEAT if has_heat else ()), *(_STRESS if has_stress else ()))


def frame_sums(source: FrameSource, frame: GrainFrame, points: FieldPoints, coarse: CoarseGrid, *, has_stress: bool) -> Floats:
    """Densities of a frame, by `column_names`, components along the local axes; means over a ring's points, shape ``(rows, q)``."""
    model = model_of(source, frame)
    position = np.array(np.asarray(frame.position, np.float64)[:, :2])
    if model.period > 0.0:
        position[:, 0] %= model.period
    columns = _of_grains(frame, model, position, points, coarse)
    if model.thermal is not None:
        assert frame.temperature is not None
        capacity = model.thermal.capacity
        columns = [*columns, *coarse.densities(position, np.column_stack([capacity, capacity * np.asarray(frame.temperature)])).T]
    if has_stress:
        columns = [*columns, *_of_contacts(frame, model, position, points, coarse)]
    weight = np.bincount(points.row)
    return np.column_stack([np.bincount(points.row, column) / weight for column in columns])


def _of_grains(frame: GrainFrame, model: Model, position: Floats, points: FieldPoints, coarse: CoarseGrid) -> list[Floats]:
    grains, velocity = model.grains, np.asarray(frame.velocity, np.float64)[:, :2]
    m = grains.mass
    vx, vy = velocity.T
    carried = np.column_stack(
        [np.pi * grains.radius**2, m, m * vx, m * vy, m * np.asarray(frame.spin, np.float64), m * vx * vx, m * vx * vy, m * vy * vy]
    )
    found = coarse.densities(position, carried)
    slopes = coarse.gradients(position, carried[:, 1:4])
    c, s = np.cos(points.turn), np.sin(points.turn)
    momentum = _vector(found[:, 2], found[:, 3], c, s)
    k00, k01, _, k11 = _tensor(found[:, 5], found[:, 6], found[:, 6], found[:, 7], c, s)
    flow = _tensor(slopes[:, 1, 0], slopes[:, 1, 1], slopes[:, 2, 0], slopes[:, 2, 1], c, s)
    return [
        found[:, 0],
        found[:, 1],
        *momentum,
        found[:, 4],
        k00,
        k01,
        k11,
        *_vector(slopes[:, 0, 0], slopes[:, 0, 1], c, s),
        *flow,
    ]


def _of_contacts(frame: GrainFrame, model: Model, position: Floats, points: FieldPoints, coarse: CoarseGrid) -> list[Floats]:
    contacts = loaded_contacts(frame, model)
    virial = np.column_stack([contacts.virial(a, b) for a in (0, 1) for b in (0, 1)])
    xx, xy, yx, yy = coarse.densities_along(position[contacts.i], -contacts.branch, virial).T
    return _tensor(xx, xy, yx, yy, np.cos(points.turn), np.sin(points.turn))


def derive(sums: Floats, names: tuple[str, ...], axes: str) -> dict[str, Floats]:
    """The fields, by name, from sums of densities over frames.

    The mean velocity is momentum over mass (mean spin likewise); velocity gradients are those of the mean velocity,
    (∂_b p_a − v_a ∂_b m)/m. The granular temperature is half the trace of the kinetic stress over the mass. The
    shear rate is √((ε_aa − ε_bb)² + 4 ε_ab²): |γ̇| in simple shear.

    Args:
        sums: Mean densities, shape ``(…, q)``.
        names: Names of the densities.
        axes: Names of the local axes.

    Returns:
        By name, shape ``(…)``; nan where nothing is near.
    """
    s = dict(zip(names, np.moveaxis(sums, -1, 0), strict=True))
    a, b = axes[0], axes[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        m = s["mass"]
        v = (s["p0"] / m, s["p1"] / m)
        slope = {(i, j): (s[f"p{i}_{j}"] - v[i] * s[f"m_{j}"]) / m for i in (0, 1) for j in (0, 1)}
        shear = 0.5 * (slope[0, 1] + slope[1, 0])
        kinetic = {(i, j): s[f"k{i}{j}"] - m * v[i] * v[j] for i, j in _SYMMETRIC}
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
    is_empty = ~(m > 0.0)
    return {name: np.where(is_empty & (name != "solid-fraction"), np.nan, values) for name, values in found.items()}


def _vector(x: Floats, y: Floats, c: Floats, s: Floats) -> list[Floats]:
    """Components of vectors along axes that are turned."""
    return [c * x + s * y, c * y - s * x]


def _tensor(xx: Floats, xy: Floats, yx: Floats, yy: Floats, c: Floats, s: Floats) -> list[Floats]:
    """Components of tensors along axes that are turned: R T Rᵀ, row by row."""
    (ax, bx), (ay, by) = _vector(xx, yx, c, s), _vector(xy, yy, c, s)  # the first index
    return [*_vector(ax, ay, c, s), *_vector(bx, by, c, s)]
