"""Named scenes of any size. They are scenarios, so what is measured is what users run.

Periodic scenes are prepared as one narrow tile of about a thousand grains, which is then repeated
with its velocities, contacts and impulses (`multicor_cli.bench.driving`): a bed of 10⁶ grains at
rest, or in steady flow, costs no more preparation than one of 10³.

Where a scene is measured is a criterion, not a number of steps: a bed when its kinetic energy says
that it rests (`multicor_cli.bench.driving.Rest`), plane shear after a strain, a drum after an
angle. Only the collapse has a time, that of its fall.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

_HEAD = """\
[scenario]
name = "{name}"
seed = {seed}
[solver]
dt = {dt!r}
[output]
frame_interval = 1.0
[domain]
size = [{width!r}, {height!r}]
periodic = {periodic}
gravity = [0.0, {gravity!r}]
[materials.stuff]
density = 2500.0
young = 70e9
poisson = 0.22
conductivity = 1.0
heat_capacity = 800.0
[[contacts]]
pair = ["stuff", "stuff"]
friction = 0.5
restitution = 0.0
[[particles]]
name = "grains"
material = "stuff"
shape = "sphere"
sizes = {{ kind = "uniform", min = 0.8e-3, max = 1.2e-3 }}
count = {count}
region = {{ min = [{left!r}, {bottom!r}], max = [{right!r}, {top!r}] }}
packing = {packing}
"""

_FLOOR = """\
[[walls]]
name = "floor"
material = "stuff"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
"""

_DIAMETER = 2e-3
_COLUMNS, _ROWS = 28, 36  # of a tile
_TILE = _COLUMNS * _ROWS
_PATIENCE = 2.0  # longest time that a bed may take to come to rest [s]
# of the lattice that grains start from; the largest grain has 1.2 diameters
_PITCH = 1.25 * _DIAMETER


@dataclass(frozen=True)
class BenchScene:
    """A scene.

    Attributes:
        text: Makes the scenario of a number of grains (of one tile if it is tiled) and a seed.
        warm_steps: Steps of the last stage before the clock starts.
        tile: Grains of the tile that is repeated; 0 if the scene itself grows.
        is_frozen: Whether nothing moves in the last stage and heat flows.
        is_weighed: Whether the floor carries the weight of all grains.
        rests: Whether the first stage ends when the grains rest, and its duration is a limit.
    """

    name: str
    text: Callable[[int, int, int], str]
    warm_steps: int
    steps: int
    tile: int = 0
    is_frozen: bool = False
    is_weighed: bool = False
    rests: bool = False


def _head(name: str, seed: int, count: int, size: tuple[float, float], **other: object) -> str:
    width, height = size
    values = {
        "dt": 2e-4, "gravity": -9.81, "periodic": "true", "left": 0.0, "bottom": 0.0,
        "right": width, "top": height,
        "packing": '{ kind = "random" }', **other,
    }  # fmt: skip
    return _HEAD.format(name=name, seed=seed, count=count, width=width, height=height, **values)


def _lattice(bottom: float = 0.0) -> dict[str, object]:
    packing = f'{{ kind = "lattice", lattice = "square", spacing = {_PITCH!r}, jitter = 0.02 }}'
    return {"packing": packing, "bottom": bottom}


def _bed(name: str, rest: str, count: int, seed: int, copies: int) -> str:
    """Grains laid down one by one, each on two: forces, and costs of a solve, are nearly unique."""
    size = (_COLUMNS * _PITCH * copies, 1.5 * _ROWS * _PITCH)
    head = _head(name, seed, count * copies, size, packing='{ kind = "deposited" }')
    return head + _FLOOR + rest.replace("PATIENCE", repr(_PATIENCE))


_REST = """\
[[loading]]
name = "settle"
duration = PATIENCE
[[loading]]
name = "rest"
duration = 9.0
"""

_HEATED = """\
thermal = { temperature = 350.0 }
[heat]
temperature = 300.0
[[loading]]
name = "settle"
duration = PATIENCE
heat = false
[[loading]]
name = "heat"
frozen = true
duration = 1e5
dt = 2.0
"""

_FALL = """\
[heat]
temperature = 300.0
[[loading]]
name = "fall"
duration = 1.0
"""


def _shear(
    name: str, speed: float, dt: float, strain: float, count: int, seed: int, copies: int
) -> str:
    """A layer between rough walls under a load, without gravity. I = (V/H) √(m/P)."""
    width, layer = _COLUMNS * _PITCH, _ROWS * _PITCH
    size = (width * copies, 1.2 * layer)
    wall = (
        '[[walls]]\nname = "{}"\nmaterial = "stuff"\ngeometry = {{ kind = "rough", '
        'from = [0.0, {!r}], to = [{!r}, {!r}], side = "{}" }}\n'
    ).format
    top = layer + 2.5 * _DIAMETER
    walls = wall("bottom", 0.0, size[0], 0.0, "left") + wall("top", top, size[0], top, "right")
    walls += f"mass = {1e-3 * copies!r}\n"
    load = -_LOAD * size[0]
    drives = (
        f"drives.top = {{ x = {{ velocity = {speed!r} }}, y = {{ force = {load!r}, damping = "
        f"{0.5 * copies!r} }} }}\n"
    )
    until = f'until = {{ strain = {{ walls = ["bottom", "top"], value = {strain!r} }} }}\n'
    stages = (
        f'[[loading]]\nname = "begin"\n{until}{drives}[[loading]]\nname = "flow"\nduration = 1e3\n'
        f"{drives}"
    )
    start = {"dt": dt, "gravity": 0.0, "top": layer + 1.5 * _DIAMETER, **_lattice(1.2 * _DIAMETER)}
    return _head(name, seed, count * copies, size, **start) + walls + stages


_LOAD = 10.0  # P: force per length on the upper wall [N/m]; √(m/P) is 1.0 ms


def _collapse(count: int, seed: int, _copies: int) -> str:
    """A column of half the height of its base's square falls apart."""
    width = round(math.sqrt(count) / 1.6) * _PITCH
    height = (count / (width / _PITCH) + 2.0) * _PITCH
    size = (4.0 * width, height)
    head = _head("collapse", seed, count, size, periodic="false", right=width, **_lattice())
    left = _FLOOR.replace("floor", "left").replace("[0.0, 1.0]", "[1.0, 0.0]")
    fall = f'[[loading]]\nname = "fall"\nduration = {math.sqrt(0.5 * height / 9.81)!r}\n'
    return head + _FLOOR + left + fall + '[[loading]]\nname = "spread"\nduration = 99.0\n'


# That a drum has turned before it is measured: more than twice the angle of repose [rad]
_ANGLE = 1.0


def _drum(count: int, seed: int, _copies: int) -> str:
    """A rough drum, a third full, turns at a Froude number of 0.05 while grains fall into it."""
    radius = math.sqrt(1.1 * count * _PITCH * _PITCH / 1.05)
    low, high = 0.34 * radius, 1.66 * radius  # a square inside the circle
    spin = math.sqrt(0.05 * 9.81 / radius)
    geometry = f'{{ kind = "circle", center = [{radius!r}, {radius!r}], radius = {radius!r} }}'
    drive = f"drives.drum = {{ spin = {{ velocity = {spin!r} }} }}\n"
    place = {"left": low, "right": high, "bottom": low, "top": high, **_lattice(low)}
    head = _head("drum", seed, count, (2.0 * radius, 2.0 * radius), periodic="false", **place)
    wall = f'[[walls]]\nname = "drum"\nmaterial = "stuff"\ngeometry = {geometry}\n'
    begin = f'[[loading]]\nname = "begin"\nduration = {_ANGLE / spin!r}\n{drive}'
    return f'{head}{wall}{begin}[[loading]]\nname = "turn"\nduration = 99.0\n{drive}'


START = BenchScene("start", partial(_bed, "start", _FALL), 0, 2)
"""What a fresh installation is timed with: the first steps of a bed with heat, which has contacts
and needs nearly all kernels."""

_BED, _HEATED_BED = partial(_bed, "bed", _REST), partial(_bed, "heated-bed", _HEATED)
_SLOW = partial(_shear, "shear", 0.55, 2e-4, 0.5)  # quasi-static: I = 0.01
_FAST = partial(_shear, "shear-dynamic", 5.5, 1e-4, 4.0)  # dynamic: I = 0.1

SCENES = {
    scene.name: scene
    for scene in (
        BenchScene("bed", _BED, 20, 20, tile=_TILE, is_weighed=True, rests=True),
        BenchScene("shear", _SLOW, 10, 60, tile=_TILE),
        BenchScene("shear-dynamic", _FAST, 10, 60, tile=_TILE),
        BenchScene("collapse", _collapse, 10, 20),
        BenchScene("heated-bed", _HEATED_BED, 2, 20, tile=_TILE, is_frozen=True, rests=True),
        BenchScene("drum", _drum, 100, 20),
    )
}
"""All scenes by name."""
