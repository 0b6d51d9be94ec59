"""Scenarios for tests, each defined once; `changed` makes others of them."""

from pathlib import Path

SMALL = """\
[scenario]
name = "small"
seed = 3
[domain]
size = [0.02, 0.02]
periodic = true
[materials.glass]
density = 2500.0
young = 70e9
poisson = 0.22
[[contacts]]
pair = ["*", "*"]
friction = 0.4
restitution = 0.3
[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 60
region = { min = [0.0, 0.001], max = [0.02, 0.009] }
packing = { kind = "random" }
[[walls]]
name = "bottom"
material = "glass"
geometry = { kind = "rough", from = [0.0, 0.0], to = [0.02, 0.0], side = "left" }
[[walls]]
name = "top"
material = "glass"
geometry = { kind = "rough", from = [0.0, 0.01], to = [0.02, 0.01], side = "right" }
[[loading]]
name = "settle"
duration = 0.03
until = { kinetic_energy_ratio = 1e-2 }
drives.top = { y = { force = -0.1, damping = 0.1 } }
[[loading]]
name = "shear"
until = { strain = { walls = ["bottom", "top"], value = 0.15 } }
drives.top = { x = { velocity = { ramp = [0.0, 0.1], duration = 0.03 } } }
[[loading]]
name = "on"
duration = 0.004
[solver]
dt = 2e-4
tolerance_rms = 1e-2
[output]
frame_interval = 0.002
"""
"""To be run: 60 grains settle, are sheared to a strain, and on as the ramp of before goes on."""

CONDUCTING = """\
[scenario]
name = "packing"
seed = 1
[variables]
d = 1e-3
pressure = 10.0
time = "= sqrt(0.25 * pi * d**3 * 2500 / pressure)"
[domain]
size = [0.019, 0.019]
periodic = ["x", "y"]
gravity = [0.0, 0.0]
[materials.glass]
density = 2500.0
young = 60e9
poisson = 0.25
conductivity = 1.0
heat_capacity = 800.0
[[contacts]]
pair = ["*", "*"]
friction = 0.0
restitution = 0.0
[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "list", radii = [0.5e-3, 0.7e-3] }
count = 200
packing = { kind = "random" }
[heat]
temperature = 300.0
gradient = [0.0, 1000.0]
gas = { conductivity = 0.026, model = "parallel" }
[[loading]]
name = "close"
duration = "= 40 * time"
cell = { xx = { rate = "= -0.01 / time" }, yy = { rate = "= -0.01 / time" } }
until = { stress = { cell = "yy", above = "= 0.5 * pressure", window = "= 0.5 * time" } }
[[loading]]
name = "compress"            # until nothing moves: without friction that takes long
duration = "= 120 * time"
cell = { xx = { stress = "= pressure" }, yy = { stress = "= pressure" } }
[[loading]]
name = "more"
duration = "= 5 * time"
cell = { xx = { stress = "= 8 * pressure" }, yy = { stress = "= 8 * pressure" } }
[[loading]]
name = "most"
duration = "= 5 * time"
cell = { xx = { stress = "= 64 * pressure" }, yy = { stress = "= 64 * pressure" } }
[[loading]]
name = "still"
frozen = true
dt = 1.0
duration = 2.0
[output]
frame_interval = "= time"
series_interval = "= time"
"""
"""In a cell with heat, frictionless discs bear three pressures, one after the other."""

WARM = """\
[scenario]
name = "warm"
seed = 4
[domain]
size = [0.02, 0.03]
periodic = true
[materials.steel]
density = 7500.0
young = 193e9
poisson = 0.29
conductivity = 15.0
heat_capacity = 500.0
emissivity = 0.3
hardness = 2e9
[[contacts]]
pair = ["steel", "steel"]
friction = { value = 0.5, softening = 1e-3, reference = 300.0, min = 0.1 }
wear = 1e-4
[[particles]]
name = "grains"
material = "steel"
shape = "sphere"
sizes = { kind = "uniform", min = 0.4e-3, max = 0.6e-3 }
count = 150
packing = { kind = "deposited" }
temperature = { value = 300.0, gradient = [0.0, 2000.0] }
[[walls]]
name = "floor"
material = "steel"
geometry = { kind = "rough", from = [0.0, 0.0], to = [0.02, 0.0], side = "left" }
thermal = { temperature = { sine = { mean = 310.0, amplitude = 10.0, period = 0.05 } } }
[heat]
impact = true
force = { average = 2e-3 }
gas = { conductivity = 0.026, reach = 0.3 }
radiation = { surroundings = 280.0, neighbors = true, reach = 0.2 }
ambient = { temperature = 290.0, coefficient = 5.0 }
[[loading]]
name = "shake"
duration = 0.01
drives.floor = { x = { velocity = { sine = { amplitude = 0.2, period = 0.005 } } } }
[[loading]]
name = "wait"
duration = 100.0
frozen = true
dt = 20.0
thermal.floor = { temperature = 330.0 }
[[loading]]
name = "shake-again"
duration = 0.005
[[loading]]
name = "cold"
duration = 0.002
heat = false
[solver]
dt = 5e-4
max_sweeps = 500
[output]
frame_interval = 2e-3
series_interval = 1e-3
"""
"""To be run with every field of a state: all heat, softening, wear, averages, frozen stages."""

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
"""To be read: most keys of the mechanics."""

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
"""To be read: most thermal keys."""

PACKED = """\
[scenario]
name = "packing"
seed = 5
[domain]
size = [0.06, 0.08]
[materials.glass]
density = 2500.0
[materials.steel]
density = 7800.0
[[contacts]]
pair = ["*", "*"]
friction = 0.4
[[particles]]
name = "grains"
material = "glass"
shape = "disc"
thickness = 2e-3
sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }
count = 200
packing = { kind = "random" }
[[loading]]
duration = 1.0
[solver]
dt = 1e-4
[output]
frame_interval = 0.1
"""
"""To be built: grains without walls, to which tests add walls and groups."""

ONE = """\
[scenario]
name = "one"
seed = 1
[domain]
size = [0.1, 0.1]
[materials.glass]
density = 2500.0
[[contacts]]
pair = ["*", "*"]
friction = 0.3
[[particles]]
name = "grain"
material = "glass"
shape = "disc"
thickness = 1e-3
sizes = { kind = "uniform", min = 1e-2, max = 1e-2 }
count = 1
packing = { kind = "deposited" }
[[walls]]
name = "floor"
material = "glass"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
[[walls]]
name = "lid"
material = "glass"
geometry = { kind = "plane", point = [0.0, 0.1], normal = [0.0, -1.0] }
[[walls]]
name = "side"
material = "glass"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [1.0, 0.0] }
[[loading]]
name = "first"
duration = 0.5
STAGE
[[loading]]
name = "second"
duration = 0.01
[solver]
dt = 1e-3
[output]
frame_interval = 0.1
"""
"""A disc of 10 mm that lies on the floor; walls move as a stage says."""


def changed(text: str, *changes: tuple[str, str]) -> str:
    """The text with the first place of each ``(old, new)`` replaced; ``old`` must be there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


LASTING = changed(SMALL, ("duration = 0.004", "duration = 100.0"))
"""The small scenario with a last stage that no test waits for."""


def write_small(directory: Path, text: str = SMALL) -> Path:
    path = directory / "small.toml"
    path.write_text(text)
    return path


RAIN = """\
[scenario]
name = "rain"
seed = 2
[domain]
size = [0.02, 0.03]
gravity = [0.0, -9.81]
[materials.steel]
density = 7500.0
[[contacts]]
pair = ["*", "*"]
friction = 0.3
[[particles]]
name = "large"
material = "steel"
shape = "sphere"
sizes = { kind = "list", radii = [0.7e-3] }
count = 20
release = { rate = 400.0, region = { min = [0.005, 0.025], max = [0.015, 0.03] } }
[[particles]]
name = "small"
material = "steel"
shape = "sphere"
sizes = { kind = "list", radii = [0.5e-3] }
count = 20
release = { rate = 400.0, region = { min = [0.005, 0.025], max = [0.015, 0.03] } }
[[walls]]
name = "floor"
material = "steel"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
[[outlets]]
name = "all"
region = { min = [0.0, 0.0], max = [0.02, 0.008] }
then = "release"
[[loading]]
name = "rain"
duration = 0.2
[solver]
dt = 2e-4
[output]
frame_interval = 0.005
series_interval = 0.001
"""
"""Two groups fall into an outlet and begin again."""
