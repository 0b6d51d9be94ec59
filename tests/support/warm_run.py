"""A scenario that uses every field of a state: heat of all kinds, softening friction, wear, averages, moving and frozen stages."""

from __future__ import annotations

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
