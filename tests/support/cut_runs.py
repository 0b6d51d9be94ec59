"""Scenarios cut in two: the first stages, and the others as a run that goes on from these."""

import re
from pathlib import Path

import numpy as np
from scenes import SMALL, WARM, changed

from multicor_cli.model import State

_SHAKE = "drives.floor = { x = { velocity = { sine = { amplitude = 0.2, period = 0.005 } } } }"
_LID = (
    "drives.top = { y = { force = -0.1, damping = 0.1 }, x = { velocity = { ramp = [0.0, 0.1], "
    "duration = 0.03 } } }"
)

NAMED = changed(
    SMALL, ("drives.top = { x = { velocity = { ramp = [0.0, 0.1], duration = 0.03 } } }", _LID)
)
"""The small scene, whose second stage names all drives: nothing is kept from the first."""

INELASTIC = changed(NAMED, ("restitution = 0.3", "restitution = 0.0"))
"""The same without rebounds."""

STICKY = changed(
    NAMED, ("restitution = 0.3", "restitution = 0.3\nadhesion = 1e-3\nrolling_friction = 0.05")
)
"""The same with adhesion and rolling resistance."""

WET = changed(
    STICKY, ("adhesion = 1e-3", 'adhesion = { force = 1e-3, range = 2e-4, kind = "wet" }')
)
"""The same with bridges of liquid."""

HOT = changed(WARM, ('name = "wait"', 'name = "wait"\n'), (
    'name = "shake-again"\nduration = 0.005',
    f'name = "shake-again"\nduration = 0.005\n{_SHAKE}\nthermal.floor = {{ temperature = 330.0 }}',
))  # fmt: skip
"""The warm scene: heat of all kinds, averages, a frozen stage; its third stage names all drives."""

_CORNERS = """\
[[particles]]
name = "corners"
material = "glass"
thickness = 1e-3
sizes = { kind = "list", radii = [0.5e-3] }
count = 6
region = { min = [0.0, 0.006], max = [0.02, 0.009] }
packing = { kind = "random" }
spin = 20.0
[particles.shape]
kind = "clump"
pieces = [
    { vertices = [[0, 0], [3, 0]], radius = 0.5 },
    { vertices = [[0, 0], [1, 0], [1, 3], [0, 3]] },
]
[[walls]]"""

SHAPED = changed(
    NAMED,
    ('shape = "disc"', 'shape = { kind = "polygon", sides = 5, rounding = 0.05 }'),
    ("count = 60", "count = 30"),
    ("max = [0.02, 0.009]", "max = [0.02, 0.006]"),
    ("[[walls]]", _CORNERS),
)
"""The small scene with pentagons and clumps, which are concave."""

BOX = """\
[scenario]
name = "box"
seed = 11
[domain]
size = [0.012, 0.02]
[materials.glass]
density = 2500.0
[[contacts]]
pair = ["*", "*"]
friction = 0.3
restitution = 0.5
[[particles]]
name = "large"
material = "glass"
shape = "sphere"
sizes = { kind = "uniform", min = 0.5e-3, max = 0.7e-3 }
count = 25
packing = { kind = "random" }
[[particles]]
name = "small"
material = "glass"
shape = "sphere"
sizes = { kind = "uniform", min = 0.3e-3, max = 0.4e-3 }
count = 25
packing = { kind = "random" }
spin = 20.0
[[walls]]
name = "floor"
material = "glass"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
[[walls]]
name = "left"
material = "glass"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [1.0, 0.0] }
[[walls]]
name = "right"
material = "glass"
geometry = { kind = "plane", point = [0.012, 0.0], normal = [-1.0, 0.0] }
[[loading]]
duration = 0.03
drives.right = { x = { velocity = -0.02 } }
[[loading]]
duration = 0.02
drives.right = { x = { velocity = 0.01 } }
[solver]
dt = 5e-4
[output]
frame_interval = 0.005
"""
"""Two groups of spheres fall into a box with a side that moves; nothing is periodic."""

_THERMAL = "young = 70e9\npoisson = 0.22\nconductivity = 1.0\nheat_capacity = 800.0"
_INTRUDER = """\
[[walls]]
name = "intruder"
material = "glass"
thermal = { capacity = 1e-3 }
geometry = { kind = "disc", center = [0.003, 0.0035], radius = 1.5e-3 }
[[loading]]
duration = 0.03
drives.intruder = { x = { velocity = 0.1 } }
"""
BODY = changed(
    BOX,
    ("density = 2500.0", f"density = 2500.0\n{_THERMAL}"),
    ('name = "large"', 'name = "large"\ntemperature = 350.0'),
    ("[[contacts]]", "[heat]\ntemperature = 300.0\n[[contacts]]"),
    ("[[loading]]\nduration = 0.03\n", _INTRUDER),
    ("duration = 0.02\n", "duration = 0.02\ndrives.intruder = { x = { velocity = -0.02 } }\n"),
)
"""The same with a solid disc that has a temperature, and is pulled to where grains have been."""

_RUNNING = "{ sine = { amplitude = 0.3, period = 0.02, phase = 1.0 } }"
_SIDE = "drives.right = { x = { velocity = 0.01 } }"
BELT = changed(
    BOX,
    ("duration = 0.03\n", f"duration = 0.03\ndrives.floor.surface.velocity = {_RUNNING}\n"),
    (_SIDE, f"{_SIDE}\ndrives.floor.surface.velocity = -0.1"),
)
"""The same on a floor whose surface runs to and fro, then to the left."""

_SIEVE = """\
[[walls]]
name = "sieve"
material = "glass"
geometry = { kind = "polyline", points = [[0.0, 0.008], [0.012, 0.007]] }
groups = ["large"]
[[loading]]"""
SIEVE = changed(BELT, ("[[loading]]", _SIEVE))
"""The same with a sieve that only the large grains meet, in their middle at first."""

CELL = """\
[scenario]
name = "cell"
seed = 5
[domain]
size = [0.012, 0.01]
periodic = ["x", "y"]
gravity = [0.0, 0.0]
[materials.glass]
density = 2500.0
[[contacts]]
pair = ["*", "*"]
friction = 0.3
restitution = 0.3
[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 100
packing = { kind = "random" }
[[loading]]
name = "shear"
duration = 0.01
cell = { xx = { stress = 50.0 }, yy = { stress = 50.0 }, xy = { rate = 40.0 } }
[[loading]]
name = "back"
duration = 0.005
cell = { xx = { rate = 0.0 }, yy = { stress = 40.0 }, xy = { rate = -20.0 } }
[solver]
dt = 5e-5
[output]
frame_interval = 0.001
"""
"""Discs in a cell that is loaded and sheared, and then sheared back at a constant width."""

TAKEN = (
    "position", "image", "velocity", "wall_position", "wall_velocity", "wall_surface", "contact_i",
    "contact_j", "contact_impulse",
    "contact_couple", "last_dt", "heat", "heat_dt", "wall_temperature", "mean_i", "mean_j",
    "mean_force", "mean_age",
)  # fmt: skip
"""Fields of a state that depend on nothing but what the next step depends on."""


def shortened(text: str, stages: int) -> str:
    """A scenario with its first stages only."""
    head, loading, tail = _parts(text)
    return head + "".join(loading[:stages]) + tail


def going_on(text: str, stages: int, run: str, moment: str = "") -> str:
    """A scenario without its first stages and own grains, that goes on from a run of these."""
    head, loading, tail = _parts(text)
    end = head.index("[[walls]]") if "[[walls]]" in head else None
    grains = head[head.index("[[particles]]") : end]
    head = head.replace(grains, f'[start]\nrun = "{run}"\n{moment}\n')
    return head + "".join(loading[stages:]) + tail


def _parts(text: str) -> tuple[str, list[str], str]:
    """What stands before the loading stages, these, and what stands after them."""
    head, *loading = text.split("[[loading]]")
    end = re.search(r"\n\[(solver|output)\]", loading[-1]).start()
    loading[-1], tail = loading[-1][:end], loading[-1][end:]
    return head, [f"[[loading]]{stage}" for stage in loading], tail


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def unlike(a: State, b: State) -> list[str]:
    """Fields among `TAKEN` in which two states differ."""
    pairs = [(name, np.asarray(getattr(a, name)), np.asarray(getattr(b, name))) for name in TAKEN]
    return [name for name, x, y in pairs if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f")]
