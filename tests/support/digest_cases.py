"""Short runs with frozen bits: every shipped scenario, packing, size distribution, kind of law.

Two, the million and the large heated bed, have enough contacts for several threads.
"""

from dataclasses import dataclass, replace
from pathlib import Path

CONFIGS = Path(__file__).parents[2] / "configs"


@dataclass(frozen=True)
class Case:
    """A run of a shipped scenario, or of a text, perhaps from the end of the case ``after``."""

    source: Path | str
    overrides: tuple[str, ...] = ()
    after: str = ""


SHIPPED = {
    "shear": (
        "loading.0.duration=2e-3", "loading.1.until.strain.value=0.001",
        "output.frame_interval=2e-3",
    ),
    "shear-dynamic": (
        "loading.0.duration=2e-3", "loading.1.until.strain.value=0.01",
        "output.frame_interval=2e-3",
    ),
    "shear-gravity-free": ("loading.0.until.strain.value=0.3",),
    "column-collapse": ("loading.0.duration=0.01", "loading.1.duration=0.01"),
    "drum": ("loading.0.duration=0.02", "loading.1.duration=0.02"),
    "hopper": ("loading.0.duration=0.02", "loading.1.duration=0.02"),
    "lattice14": (),
    "heated-bed": (
        "particles.0.count=400", "domain.size=[0.06,0.13]", "walls.2.geometry.point=[0.06,0.0]",
        "loading.0.duration=0.3", "loading.1.duration=0.02",
    ),
    "chute": ("loading.0.duration=0.02",),
    "dense-packing": (
        "loading.0.duration=0.01", "loading.0.until.steady.window=4e-3",
        "loading.0.until.steady.after=0.0", "loading.1.until.strain.value=0.01",
        "variables.height=10",
    ),
    "vibrated-bed": ("variables.cycles=1", "variables.layers=2"),
    "silo": (
        "loading.0.duration=0.03", "loading.1.duration=0.2", "variables.fill=150",
        "variables.drop=5",
    ),
    "heap": ("variables.plate=20", "loading.0.duration=0.02", "loading.1.duration=0.02"),
    "sieve-curve": ("variables.count=300", "loading.0.duration=0.02", "loading.1.duration=0.02"),
    "intruder": (
        "particles.0.count=400", "variables.depth=13", "loading.0.duration=0.02",
        "loading.1.duration=0.02",
    ),
    "annular-shear": ("variables.turns=0.02",),
    "polygons": ("particles.0.count=100", "loading.0.duration=0.02", "loading.1.duration=0.02"),
    "arch": ("loading.0.duration=0.02", "loading.1.duration=0.02"),
    "clumps": ("particles.0.count=40", "loading.0.duration=0.02", "loading.1.duration=0.02"),
    "biaxial": (
        "variables.side=16", "loading.0.duration=0.015", "loading.0.until.steady.window=4e-3",
        "loading.0.until.steady.after=0.0", "loading.1.until.axial_strain.below=-0.02",
    ),
    "cell-shear": (
        "variables.side=14", "loading.1.until.strain.value=0.3", "variables.I=0.05",
    ),
    "cell-compression": (
        "particles.0.count=150", "variables.side=17", "loading.1.duration=0.003",
        "loading.2.duration=0.001",
    ),
    "rods": ("variables.side=10", "loading.1.until.strain.value=0.3"),
    "conductivity": (
        "variables.side=14", "loading.0.duration=0.003", "loading.1.duration=20.0",
        "loading.2.until.strain.value=0.3",
    ),
    "flash-heating": ("variables.side=14", "loading.1.until.strain.value=0.3"),
    "million": ("particles.0.count=20_000", "domain.size=[1.2,0.14]"),
}  # fmt: skip
"""What makes each shipped scenario short."""

_BASE = """\
[scenario]
name = "short"
seed = 11
[domain]
size = [0.03, 0.05]
periodic = {periodic}
[materials.glass]
density = 2500.0
young = 70e9
poisson = 0.22
conductivity = 1.0
heat_capacity = 800.0
emissivity = 0.8
roughness = 1e-6
asperity_slope = 0.1
microhardness = 3e9
hardness = 6e9
[[contacts]]
pair = ["*", "*"]
friction = {friction}
restitution = 0.3
{wear}
[[particles]]
name = "grains"
material = "glass"
{shape}
{sizes}
{number}
{region}
packing = {packing}
velocity = [0.1, -0.2]
spin = 3.0
shear_rate = 2.0
{temperature}
{walls}
[[loading]]
name = "first"
duration = 0.01
{drives}
[[loading]]
name = "second"
{second}
[solver]
dt = 2e-4
[output]
frame_interval = 0.005
{heat}
"""

_FLOOR = """\
[[walls]]
name = "floor"
material = "glass"
geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }
"""

_LID = (
    _FLOOR.replace("floor", "lid")
    .replace("[0.0, 0.0]", "[0.0, 0.05]")
    .replace("[0.0, 1.0]", "[0.0, -1.0]")
)

_UNIFORM = '{ kind = "uniform", min = 0.4e-3, max = 0.6e-3 }'
_DISC = 'shape = "disc"\nthickness = 1e-3'
_SPHERE = 'shape = "sphere"'


def _scene(**parts: str) -> Case:
    values = {
        "friction": "0.4", "shape": _DISC, "sizes": f"sizes = {_UNIFORM}", "number": "count = 120",
        "region": "", "packing": '{ kind = "random" }', "temperature": "", "walls": _FLOOR,
        "drives": "", "second": "duration = 0.005", "heat": "", "periodic": "true", "wear": "",
    }  # fmt: skip
    return Case(_BASE.format(**{**values, **parts}))


def _region(top: float) -> str:
    return f"region = {{ min = [0.0, 0.001], max = [0.03, {top}] }}"


_LIST = 'kind = "list", radii = [0.4e-3, 0.5e-3, 0.7e-3], fractions = [0.2, 0.5, 0.3]'
_LOGNORMAL = 'kind = "lognormal", median = 0.5e-3, sigma = 0.3, min = 0.25e-3, max = 0.9e-3'
_SIZES = {
    "list-number": f"{{ {_LIST} }}",
    "list-mass": f'{{ {_LIST}, by = "mass" }}',
    "uniform-number": _UNIFORM,
    "uniform-mass": '{ kind = "uniform", min = 0.3e-3, max = 0.6e-3, by = "mass" }',
    "lognormal-number": f"{{ {_LOGNORMAL} }}",
    "lognormal-mass": f'{{ {_LOGNORMAL}, by = "mass" }}',
    "power-number": '{ kind = "power", exponent = 2.5, min = 0.25e-3, max = 0.9e-3 }',
    "power-mass": '{ kind = "power", exponent = 1.5, min = 0.25e-3, max = 0.9e-3, by = "mass" }',
}

_PACKINGS = {
    "lattice-triangular": {
        "packing": '{ kind = "lattice", lattice = "triangular", spacing = 1.4e-3, jitter = 0.05 }'
    },
    "lattice-square": {
        "packing": '{ kind = "lattice", lattice = "square", spacing = 1.5e-3, jitter = 0.1 }',
        "shape": _SPHERE,
    },
    "random-fill": {"packing": '{ kind = "random", separation = 0.05 }', "number": "fill = 0.3",
        "region": _region(0.012)},
    "random-dense": {"number": "fill = 0.78", "region": _region(0.008)},
    "deposited": {"packing": '{ kind = "deposited" }', "region": _region(0.03)},
    "compacted": {"packing": '{ kind = "compacted", pressure = 5.0, friction = 0.3 }',
        "number": "fill = 0.6", "region": _region(0.008)},
    "tile-random": {
        "packing": (
            '{ kind = "tile", source = { kind = "random" }, tile = [0.01, 0.01], tile_fill = 0.7, '
            "repeat = [3, 2] }"
        ),
        "number": "",
        "region": _region(0.03),
    },
    "tile-deposited": {
        "packing": (
            '{ kind = "tile", source = { kind = "deposited" }, tile = [0.015, 0.02], tile_count = '
            "60, repeat = [2, 1] }"
        ),
        "number": "",
        "region": _region(0.03),
    },
}  # fmt: skip

_DRUM = """\
[[walls]]
name = "drum"
material = "glass"
geometry = { kind = "circle", center = [0.015, 0.025], radius = 0.012, rough = "grains" }
"""

_MOVING = """\
[[walls]]
name = "shaker"
material = "glass"
geometry = { kind = "box", min = [0.002, 0.002], max = [0.028, 0.03], open = ["top"] }
[[walls]]
name = "paddle"
material = "glass"
geometry = { kind = "polyline", points = [[0.008, 0.035], [0.014, 0.037], [0.022, 0.034]] }
mass = 1e-3
inertia = 1e-8
"""

_SHAKE = (
    "drives.shaker = { x = { velocity = { sine = { amplitude = 0.2, period = 0.007, phase = 0.4 } "
    "} } }\n"
    "drives.paddle = { x = { fixed = true }, y = { force = -0.02, damping = 0.1 }, spin = { force "
    "= { sine = { amplitude = 1e-5, period = 0.01 } } } }"
)

_PULL = (
    "drives.shaker = { x = { position = { sine = { amplitude = 2e-4, period = 0.007 } } } }\n"
    'drives.paddle = { x = { stress = 1.0, between = ["shaker", "lid"] }, y = { force = -0.02, '
    "spring = { stiffness = 20.0 } }, "
    "spin = { spring = { stiffness = 1e-3, anchor = { ramp = [0.0, 0.5], duration = 0.01 } } } }"
)

_WARM_FLOOR = (
    _FLOOR
    + "thermal = { temperature = { sine = { mean = 350.0, amplitude = 20.0, period = 0.01 } } }\n"
)

_HEAT = """
[heat]
temperature = 300.0
impact = true
"""

_ALL_HEAT = """
[heat]
temperature = 300.0
conduction = "rough"
friction = "sliding"
impact = true
collisional = {collisional}
partition = "{partition}"
force = {force}
gas = {{ conductivity = 0.026, model = "{gas}" }}
ambient = {{ temperature = 320.0, correlation = "{correlation}", {fluid} }}
radiation = {{ surroundings = 290.0, neighbors = true }}
integrator = "{integrator}"
"""

_AIR = "conductivity = 0.026, viscosity = 1.6e-5, prandtl = 0.7"
_GRADIENT = "temperature = { value = 320.0, gradient = [400.0, 900.0] }"
_BED = {
    "shape": _SPHERE, "packing": '{ kind = "deposited" }', "region": _region(0.03),
    "walls": _WARM_FLOOR, "temperature": _GRADIENT,
}  # fmt: skip


def _all_heat(**choices: str) -> str:
    values = {
        "collisional": "false", "partition": "effusivity", "force": "{ average = 2e-3 }",
        "gas": "parallel", "correlation": "whitaker", "fluid": _AIR, "integrator": "implicit",
    }  # fmt: skip
    return _ALL_HEAT.format(**{**values, **choices})


_POROUS = _AIR + ", porosity = 0.5"
_HEAT_OF_IMPACTS = _all_heat(
    collisional="true", correlation="gunn", fluid=_POROUS, partition="conductivity",
    force="{ prescribed = 0.01 }",
).replace('conduction = "rough"', 'conduction = "hertz"')  # fmt: skip

_SOFT = "{ softening = 2e-3, reference = 300.0, value = 0.4, min = 0.1, max = 0.5 }"
_FLASHES = "{ value = 0.5, weakened = 0.1, weakening_speed = 0.02, weakening_temperature = 900.0 }"
_SPEEDS = "{ speed = [0.0, 0.05, 0.3], values = [0.5, 0.4, 0.2] }"

_SHAKEN = {
    "walls": _MOVING,
    "periodic": "false",
    "region": "region = { min = [0.003, 0.003], max = [0.027, 0.029] }",
    "drives": _SHAKE,
}
_STRAINED = '["x", "y"]\ngravity = [0.0, 0.0]\ncell_rates = { xy = 40.0 }'
_LAWS = {
    "rough-drum": {"walls": _DRUM,
        "region": "region = { min = [0.008, 0.018], max = [0.022, 0.032] }", "number": "count = 60",
        "sizes": "sizes = " + _SIZES["lognormal-number"].replace("0.9e-3", "0.6e-3"),
        "drives": "drives.drum = { spin = { velocity = 4.0 } }"},
    "moving-walls": _SHAKEN,
    "adhesion-and-rolling": {**_SHAKEN, "wear": "adhesion = 1e-4\nrolling_friction = 0.1"},
    "bridges": {**_SHAKEN, "wear": 'adhesion = { force = 1e-4, range = 5e-5, kind = "wet" }'},
    "positions-springs-stages": {**_SHAKEN, "walls": _MOVING + _LID, "drives": _PULL,
        "second": 'duration = 0.005\ncontacts = [{ pair = ["*", "*"], friction = 0.1 }]'},
    "gas-in-a-cell": {"walls": "", "periodic": _STRAINED, "number": "fill = 0.4",
        "drives": "cell = { xx = { rate = 3.0 }, yy = { rate = -5.0 }, xy = { rate = 40.0 } }",
        "heat": _HEAT + "gradient = [500.0, 1000.0]\n"},
    "friction-of-speed": {"friction": _SPEEDS, "packing": '{ kind = "deposited" }',
        "region": _region(0.03)},
    "friction-of-flashes": {**_BED, "friction": _FLASHES, "heat": _HEAT},
    "friction-of-temperature": {**_BED, "friction": _SOFT, "heat": _HEAT},
    "shapes": {**_BED, "packing": '{ kind = "random" }', "friction": _SOFT, "heat": _HEAT,
        "shape": "thickness = 1e-3\nshape = "
        '{ kind = "polygon", sides = 5, rounding = 0.1, irregular = 0.3 }'},
    "heat": {**_BED, "heat": _HEAT, "second": "frozen = true\nduration = 20.0\ndt = 0.5"},
    "heat-everything-implicit": {**_BED, "wear": "wear = 1e-4", "heat": _all_heat()},
    "heat-everything-explicit": {**_BED, "heat": _all_heat(integrator="explicit",
        correlation="li-mason", fluid=_POROUS, gas="batchelor")},
    "heat-of-impacts": {**_BED, "packing": '{ kind = "random" }', "wear": "wear = 1e-4",
        "heat": _HEAT_OF_IMPACTS},
}  # fmt: skip

_LATTICE_FILE = (CONFIGS / "lattice14.csv").as_posix()
_OF_FILE = f'{{ kind = "file", path = "{_LATTICE_FILE}", shift = [0.01, 0.01] }}'
_OF_RUN = '{ kind = "run", path = "packing-deposited", frame = 1 }'
_BROUGHT = {
    "packing-file": _scene(packing=_OF_FILE, sizes="", number="", periodic="false"),
    "packing-run": replace(_scene(packing=_OF_RUN, sizes="", number=""), after="packing-deposited"),
}

_LARGE = (
    "particles.0.count=5000", "domain.size=[0.3,0.35]", "walls.2.geometry.point=[0.3,0.0]",
    "particles.0.packing={kind='deposited'}", "loading.0.duration=0.002", "loading.0.heat=true",
    "loading.1.duration=0.002", "loading.1.solver={max_sweeps=100}", "heat.impact=true",
    "heat.gas={conductivity=0.026}",
)  # fmt: skip

_GROWING = (
    "materials.glass.expansion=1e-4", "heat.ambient={temperature=500.0, coefficient=2e3}",
)  # fmt: skip

_STICKY_CELL = (
    *SHIPPED["cell-shear"], 'contacts.0.adhesion={force=1e-3, kind="wet"}',
    'particles.0.shape={kind="polygon", sides=5, irregular=0.3}',
)  # fmt: skip

CASES: dict[str, Case] = {
    **{name: Case(CONFIGS / f"{name}.toml", overrides) for name, overrides in SHIPPED.items()},
    "heated-bed-large": Case(CONFIGS / "heated-bed.toml", _LARGE),
    **{f"packing-{name}": _scene(**parts) for name, parts in _PACKINGS.items()},
    **_BROUGHT,
    **{f"sizes-{name}": _scene(sizes=f"sizes = {sizes}") for name, sizes in _SIZES.items()},
    **{f"law-{name}": _scene(**parts) for name, parts in _LAWS.items()},
    "law-shapes-in-a-cell": Case(CONFIGS / "cell-shear.toml", _STICKY_CELL),
    "law-expansion": replace(_scene(**{**_BED, "heat": _HEAT}), overrides=_GROWING),
}
"""All cases by name."""
