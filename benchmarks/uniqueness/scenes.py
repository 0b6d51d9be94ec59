"""The scenarios: a bed in a box, plane shear, a column that collapses. Discs of 1 mm ± 20 %, sizes
in m.
"""

from __future__ import annotations

_HEAD = """\
[scenario]
name = "{name}"
seed = {seed}
[domain]
size = [{width!r}, {height!r}]
periodic = {periodic}
gravity = [0.0, {gravity!r}]
[materials.stuff]
density = 1000.0
[materials.gate]
density = 1000.0
[[contacts]]
pair = ["*", "*"]
friction = {friction!r}
restitution = 0.0
[[contacts]]
pair = ["*", "gate"]
friction = 0.0
[[particles]]
name = "grains"
material = "stuff"
shape = "disc"
thickness = 0.01
sizes = {{ kind = "uniform", min = 0.4e-3, max = 0.6e-3 }}
count = {count}
region = {{ min = [{left!r}, {bottom!r}], max = [{right!r}, {top!r}] }}
packing = {packing}
{motion}
"""

PITCH = 1.25e-3
"""Of the lattice that grains fall from [m]."""

DIAMETER = 1e-3
RATES = {0.1: 131.1, 0.01: 13.11}
"""Shear rate [1/s] of each nominal inertial number: √(m̄/P) is 0.9 ms."""


def _head(name: str, seed: int, count: int, size: tuple[float, float], **other: object) -> str:
    width, height = size
    lattice = f'{{ kind = "lattice", lattice = "square", spacing = {PITCH!r}, jitter = 0.02 }}'
    values = {
        "periodic": "false", "gravity": -9.81, "friction": 0.5, "left": 0.0, "bottom": 0.0,
        "right": width, "top": height,
        "packing": lattice, "motion": "", **other,
    }  # fmt: skip
    return _HEAD.format(name=name, seed=seed, count=count, width=width, height=height, **values)


def _plane(name: str, x: float, y: float, nx: float, ny: float) -> str:
    return (
        f'[[walls]]\nname = "{name}"\nmaterial = "stuff"\n'
        f'geometry = {{ kind = "plane", point = [{x!r}, {y!r}], normal = [{nx!r}, {ny!r}] }}\n'
    )


def _tail(dt: float, tolerance: float = 1e-3) -> str:
    """The other tolerances keep their ratio to that of the rms."""
    tolerances = (
        f"tolerance_rms = {tolerance!r}\ntolerance_max = {50.0 * tolerance!r}\n"
        f"tolerance_energy = {10.0 * tolerance!r}\n"
    )
    return f"[solver]\ndt = {dt!r}\nthreads = 1\n{tolerances}[output]\nframe_interval = 10.0\n"


def bed(count: int, seed: int, duration: float) -> str:
    """Grains that fall into a box with friction and come to rest in it."""
    columns = round((1.2 * count) ** 0.5)
    size = (columns * PITCH, (count / columns + 2.0) * PITCH)
    walls = (
        _plane("floor", 0.0, 0.0, 0.0, 1.0)
        + _plane("left", 0.0, 0.0, 1.0, 0.0)
        + _plane("right", size[0], 0.0, -1.0, 0.0)
    )
    stages = f'[[loading]]\nname = "fall"\nduration = {duration!r}\n'
    return _head("bed", seed, count, size) + walls + stages + _tail(2e-4)


def shear(count: int, seed: int, inertial: float, strain: float, tolerance: float) -> str:
    """A square layer between rough walls under a load of 10 N/m, without gravity (as
    ``configs/shear-gravity-free.toml``).
    """
    rate = RATES[inertial]
    width = round(0.9 * count**0.5) * DIAMETER
    layer = 1.065e-6 * count / width  # area per grain of the random packing
    gap = layer + 2.4e-3
    speed = rate * gap
    walls = "".join(
        (
            f'[[walls]]\nname = "{name}"\nmaterial = "stuff"\n'
            f'{mass}geometry = {{ kind = "rough", from = [0.0, {y!r}], to = [{width!r}, {y!r}], '
            f'side = "{side}" }}\n'
        )
        for name, y, side, mass in (
            ("bottom", 0.0, "left", ""),
            ("top", gap, "right", f"mass = {8e-6 * 1e3 * width!r}\n"),
        )
    )
    stages = (
        f'[[loading]]\nname = "shear"\nduration = {strain / rate!r}\n'
        f"drives.top = {{ x = {{ velocity = {speed!r} }}, y = {{ force = {-10.0 * width!r} }} }}\n"
    )
    motion = f"velocity = [{0.5 * speed!r}, 0.0]\nshear_rate = {rate!r}"
    head = _head(
        "shear", seed, count, (width, gap + 4e-3), periodic="true", gravity=0.0, friction=0.4,
        packing='{ kind = "random" }',
        bottom=1.2e-3, top=1.2e-3 + layer, motion=motion,
    )  # fmt: skip
    return head + walls + stages + _tail(8.9e-5 if inertial > 0.05 else 1.78e-4, tolerance)


def column_width(count: int) -> float:
    """Width of the column that collapses [m]."""
    return max(4, round((count / 2.0) ** 0.5)) * PITCH


def collapse(count: int, seed: int, settle: float, spread: float, tolerance: float = 1e-3) -> str:
    """A column, twice as high as wide, at a wall; a smooth gate beside it is pulled up, and it
    spreads over a rough floor.
    """
    width = column_width(count)
    height = (count / (width / PITCH) + 2.0) * PITCH
    length = 6.0 * width
    floor = (
        '[[walls]]\nname = "floor"\nmaterial = "stuff"\n'
        f'geometry = {{ kind = "rough", from = [0.0, 0.0], to = [{length!r}, 0.0], side = "left" '
        f"}}\n"
    )
    gate = (
        '[[walls]]\nname = "gate"\nmaterial = "gate"\n'
        f'geometry = {{ kind = "polyline", points = [[{width!r}, 0.0], [{width!r}, {height!r}]] '
        f"}}\n"
    )
    walls = (
        floor + _plane("left", 0.0, 0.0, 1.0, 0.0) + _plane("end", length, 0.0, -1.0, 0.0) + gate
    )
    stages = (
        f'[[loading]]\nname = "settle"\nduration = {settle!r}\n[[loading]]\nname = "spread"\n'
        f"duration = {spread!r}\ndrives.gate = {{ y = {{ velocity = 2.0 }} }}\n"
    )
    return (
        _head("collapse", seed, count, (length, height), right=width, bottom=1.0e-3, top=height)
        + walls
        + stages
        + _tail(2e-4, tolerance)
    )
