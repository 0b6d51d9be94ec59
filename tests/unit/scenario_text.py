"""A small valid scenario that uses most keys, and how tests change it."""

from multicor_cli.scenario import ScenarioError, parse_scenario

SHEAR = """\
[scenario]
name = "shear"
seed = 7

[domain]
size = [0.03, 0.05]
periodic = true
gravity = [0, -9.81]

[materials.glass]
density = 2500
young = 70e9
poisson = 0.2

[materials.steel]
density = 7800.0

[[contacts]]
pair = ["*", "*"]
friction = 0.4

[[contacts]]
pair = ["steel", "glass"]
friction = { speed = [0, 1.0], values = [0.3, 0.2] }
restitution = 0.5

[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 100
region = { min = [0, 0.001], max = [0.03, 0.049] }
packing = { kind = "random", separation = 0.1 }

[[walls]]
name = "bottom"
material = "glass"
geometry = { kind = "rough", from = [0, 0], to = [0.03, 0], side = "left" }

[[walls]]
name = "top"
material = "glass"
geometry = { kind = "rough", from = [0, 0.05], to = [0.03, 0.05], side = "right", sizes = "grains" }
gravity = true

[[walls]]
name = "paddle"
material = "steel"
geometry = { kind = "polyline", points = [[0.01, 0.02], [0.02, 0.02]] }
mass = 1e-3
inertia = 1e-8

[[loading]]
name = "compress"
duration = 1.0
until = { kinetic_energy_ratio = 1e-4 }
drives.top = { y = { force = -0.015, damping = 0.02 } }
drives.paddle = { spin = { force = { sine = { amplitude = 1e-6, period = 0.1 } } }, x = { fixed = true } }

[[loading]]
name = "shear"
until = { strain = { walls = ["bottom", "top"], value = 1.0 } }
drives.top.x.velocity = { ramp = [0.0, 0.1], duration = 0.02 }
dt = 1e-4
solver = { tolerance_rms = 1e-4, max_sweeps = 500 }

[[loading]]
duration = 0.5
drives.bottom.x.velocity = { times = [0, 1], values = [0, 0.5] }

[solver]
dt = 2e-4

[output]
frame_interval = 0.01
"""


def changed(*changes, text=SHEAR):
    """The text with each ``(old, new)`` replaced; every ``old`` must be there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def problems_of(text, overrides=()):
    """The problems of a scenario, none if it is right."""
    try:
        parse_scenario(text, "shear.toml", overrides)
    except ScenarioError as error:
        return error.problems
    return []


def place_of(text, word):
    """Line and column of a word in a text, both from 1."""
    before = text[: text.index(word)]
    return before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
