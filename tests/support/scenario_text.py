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

HEATED = """\
[scenario]
name = "heated"
seed = 7

[domain]
size = [0.03, 0.05]
periodic = true

[materials.glass]
density = 2500.0
young = 70e9
poisson = 0.2
conductivity = 1.0
heat_capacity = 800.0
emissivity = 0.9
roughness = 3e-7
asperity_slope = 0.1
microhardness = 6e9
hardness = 5e9
resistivity = 1e10

[materials.steel]
density = 7800.0
young = 193e9
poisson = 0.29
conductivity = 15.0
heat_capacity = 500.0
emissivity = 0.3
roughness = 4e-7
asperity_slope = 0.2
microhardness = 3e9
hardness = 2e9
resistivity = 7e-7

[materials.spare]
density = 1000.0

[[contacts]]
pair = ["*", "*"]
friction = { value = 0.5, softening = 1e-3, reference = 298.15, min = 0.1, max = 1.0 }

[[contacts]]
pair = ["steel", "glass"]
friction = { speed = [0, 1.0], values = [0.3, 0.2], softening = 2e-3 }
wear = 1e-4

[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 100
region = { min = [0, 0.001], max = [0.03, 0.049] }
packing = { kind = "random" }
temperature = { value = 300.0, gradient = [0.0, 100.0], at = [0.0, 0.025] }

[[walls]]
name = "floor"
material = "steel"
geometry = { kind = "plane", point = [0, 0], normal = [0, 1] }
thermal = { temperature = { ramp = [300.0, 350.0], duration = 2.0 } }

[[walls]]
name = "lid"
material = "steel"
geometry = { kind = "plane", point = [0, 0.05], normal = [0, -1] }

[[loading]]
name = "fall"
duration = 1.0
heat = false

[[loading]]
name = "soak"
duration = 1800.0
frozen = true
dt = 60.0
thermal.lid = { flow = { sine = { mean = 1.0, amplitude = 2.0, period = 60.0 } } }

[[loading]]
name = "stir"
duration = 1.0
thermal.floor = { insulated = true }

[heat]
temperature = 310.0
force = { average = 0.01 }
gas = { conductivity = 0.026, model = "batchelor" }
ambient = { temperature = 290.0, correlation = "gunn", conductivity = 0.026, viscosity = 1.5e-5, prandtl = 0.7, porosity = 0.4 }
radiation = { surroundings = 293.15, neighbors = true }

[solver]
dt = 2e-4

[output]
frame_interval = 0.01
"""
"""A small valid scenario that uses most thermal keys."""


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
