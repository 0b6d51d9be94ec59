"""The cases as scenarios of the program."""

from __future__ import annotations

import math

from multicor_cli.bench.scenes import BenchScene

DIAMETER = 2e-3
"""Mean diameter of the grains [m]."""

SIZES = {
    "even": ('{ kind = "uniform", min = 0.8e-3, max = 1.2e-3 }', 1.25 * DIAMETER),
    "mixture": ('{ kind = "list", radii = [0.5e-3, 1.0e-3, 1.5e-3] }', 1.6 * DIAMETER),
}
"""Radii, spread evenly by ±20 % or for diameters of 1, 2 and 3 mm; and the spacing of the lattice
that grains start from [m]."""

DENSITY = 2500.0
"""Density of the grains [kg/m³]."""

FRICTION = 0.5
"""Coefficient of friction of all contacts."""

PRESSURE = 10.0
"""Load per length of the upper wall of the sheared layer [N/m]."""

_HEAD = """\
[scenario]
name = "{name}"
seed = {seed}
[domain]
size = [{width!r}, {height!r}]
periodic = true
gravity = [0.0, {gravity!r}]
[materials.stuff]
density = {density!r}
young = 70e9
poisson = 0.22
conductivity = 1.0
heat_capacity = 800.0
[[contacts]]
pair = ["stuff", "stuff"]
friction = {friction!r}
restitution = 0.0
[[particles]]
name = "grains"
material = "stuff"
shape = "sphere"
sizes = {sizes}
count = {count}
region = {{ min = [0.0, {bottom!r}], max = [{width!r}, {top!r}] }}
packing = {{ kind = "lattice", lattice = "square", spacing = {pitch!r}, jitter = 0.02 }}
"""

_ROUGH = """\
[[walls]]
name = "{name}"
material = "stuff"
geometry = {{ kind = "rough", from = [0.0, {y!r}], to = [{width!r}, {y!r}], side = "{side}" }}
"""

_FLOOR = """\
[[walls]]
name = "floor"
material = "stuff"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
"""


def shear_scene(
    inertial: float, begin: float, friction: float = FRICTION, sizes: str = "even"
) -> BenchScene:
    """Plane shear at an inertial number, measured after a strain ``begin`` from the lattice;
    ``sizes`` is a key of `SIZES`.
    """
    return BenchScene(
        "shear", lambda count, seed, _: _shear(inertial, begin, friction, sizes, count, seed), 0, 0
    )


def bed_scene(dt: float) -> BenchScene:
    """Grains on a loose lattice that begin to fall onto a floor, with a time step [s]."""
    return BenchScene("bed", lambda count, seed, _: _bed(dt, count, seed), 0, 0)


def columns_of(count: int) -> int:
    """Columns of the lattice that grains start from: it is about as wide as high."""
    return max(8, round(math.sqrt(count)))


def _head(
    name: str,
    count: int,
    seed: int,
    height: float,
    bottom: float,
    gravity: float,
    friction: float = FRICTION,
    sizes: str = "even",
) -> str:
    rows, (radii, pitch) = -(-count // columns_of(count)), SIZES[sizes]
    return _HEAD.format(
        name=name, seed=seed, width=columns_of(count) * pitch, height=height, gravity=gravity,
        density=DENSITY,
        friction=friction, sizes=radii, count=count, bottom=bottom, top=bottom + rows * pitch,
        pitch=pitch,
    )  # fmt: skip


def _shear(
    inertial: float, begin: float, friction: float, sizes: str, count: int, seed: int
) -> str:
    pitch = SIZES[sizes][1]
    width = columns_of(count) * pitch
    layer = -(-count // columns_of(count)) * pitch
    tau = (DENSITY * 4.19 * (0.5 * DIAMETER) ** 3 / PRESSURE) ** 0.5
    # About the height of the layer when it is dense
    dense = count * 0.785 * DIAMETER**2 / (0.8 * width)
    speed = inertial * dense / tau
    # Some ten grains per ten diameters; its motion along y dies away in 2 τ
    mass, damping = 0.015 * width, 7.0 * width
    walls = _ROUGH.format(name="bottom", y=0.0, width=width, side="left")
    walls += (
        _ROUGH.format(name="top", y=layer + 2.5 * DIAMETER, width=width, side="right")
        + f"mass = {mass!r}\n"
    )
    drives = (
        f"drives.top = {{ x = {{ velocity = {speed!r} }}, y = {{ force = {-PRESSURE * width!r}, "
        f"damping = {damping!r} }} }}\n"
    )
    until = f'until = {{ strain = {{ walls = ["bottom", "top"], value = {begin!r} }} }}\n'
    stages = (
        f'[[loading]]\nname = "begin"\n{until}{drives}[[loading]]\nname = "flow"\nduration = 1e3\n'
        f"{drives}"
    )
    solver = f"[solver]\ndt = {0.1 * tau!r}\n[output]\nframe_interval = 1.0\n"
    head = _head("shear", count, seed, layer + 4.0 * DIAMETER, 1.2 * DIAMETER, 0.0, friction, sizes)
    return head + walls + stages + solver


def _bed(dt: float, count: int, seed: int) -> str:
    height = -(-count // columns_of(count)) * SIZES["even"][1]
    stage = '[[loading]]\nname = "fall"\nduration = 1e3\n'
    solver = f"[solver]\ndt = {dt!r}\n[output]\nframe_interval = 1.0\n"
    return _head("bed", count, seed, 1.2 * height, 0.0, -9.81) + _FLOOR + stage + solver
