"""Each mistake in a scenario gives one clear problem at its place, with its value and a remedy."""

import pytest
from scenario_problems import check_one, problems_of
from scenes import HEATED, SHEAR, changed

STRAIN = 'strain = { walls = ["bottom", "top"], value = 1.0 }'
REGION = "region = { min = [0, 0.001], max = [0.03, 0.049] }"
TOP = "{ force = -0.015, damping = 0.02 }"
PADDLE = 'kind = "polyline", points = [[0.01, 0.02], [0.02, 0.02]]'


def until(condition):
    """A change of what the first stage waits for."""
    return "until = { kinetic_energy_ratio = 1e-4 }", f"until = {{ {condition} }}"


def region(text):
    return REGION, f"region = {{ {text} }}"


def softer(entries):
    """A change of the friction in the last stage."""
    return "duration = 0.5\n", f"duration = 0.5\ncontacts = [{entries}]\n"


# change, key, where the problem points (text at that place), words that the message must have
MISTAKES = {
    "unknown key": (("density = 2500", "densty = 2500"), "materials.glass.densty", "densty", "unknown key", "'density'"),
    "unit in key": (("density = 2500", "density_g = 2500"), "materials.glass.density_g", "density_g", "SI", "'density'"),
    "unknown table": (("[output]", "[outputs]"), "outputs", "[outputs]", "unknown key", "'output'"),
    "text for number": (("density = 2500", 'density = "2500"'), "materials.glass.density", 'density = "', "number", '"2500"'),
    "bool for number": (("friction = 0.4", "friction = true"), "contacts.0.friction", "friction = true", "number", "true"),
    "number for bool": (("periodic = true", "periodic = 1"), "domain.periodic", "periodic = 1", "true or false", "is 1"),
    "number for fixed": (("fixed = true", "fixed = 1"), "loading.0.drives.paddle.x.fixed", "fixed = 1", "true or false"),
    "not fixed": (("fixed = true", "fixed = false"), "loading.0.drives.paddle.x.fixed", "fixed = false", "velocity or force"),
    "float for count": (("count = 100", "count = 100.0"), "particles.0.count", "count = 100.0", "whole number", "100.0"),
    "date for number": (("count = 100", "count = 2020-01-01"), "particles.0.count", "count = 2020", "date", "2020-01-01"),
    "negative radius": (("min = 0.4e-3", "min = -0.4e-3"), "particles.0.sizes.min", "min = -0.4", "positive", "-0.0004", "[m]"),
    "crossed radii": (("min = 0.4e-3", "min = 0.8e-3"), "particles.0.sizes.max", "max = 0.6e-3", "0.0006", "0.0008"),
    "not a number": (("min = 0.4e-3", "min = nan"), "particles.0.sizes.min", "min = nan", "finite", "nan"),
    "infinite": (("dt = 2e-4", "dt = inf"), "solver.dt", "dt = inf", "finite", "inf"),
    "unit slip of E": (("young = 70e9", "young = 193"), "materials.glass.young", "young", "193 Pa", "193e9"),
    "unit slip of density": (("density = 7800.0", "density = 0.0078"), "materials.steel.density", "density = 0.0", "7.8"),
    "E without Poisson": (("poisson = 0.2\n", ""), "materials.glass.young", "young", "poisson"),
    "friction of temperature": (("{ speed = [0, 1.0]", "{ temperature = [0, 1.0]"), "contacts.1.friction.temperature", "temperature", "not a table of temperatures", "softening"),
    "negative adhesion": (("restitution = 0.5", "adhesion = -1"), "contacts.1.adhesion", "adhesion = -1", "-1", "[N]"),
    "adhesion without force": (("restitution = 0.5", "adhesion = { range = 1e-5 }"), "contacts.1.adhesion.force", "adhesion = {", "is missing", "F_a [N]"),
    "kind of adhesion": (("restitution = 0.5", 'adhesion = { force = 1e-5, kind = "moist" }'), "contacts.1.adhesion.kind", 'kind = "moist"', "'dry', 'wet'"),
    "no range": (("restitution = 0.5", "adhesion = { force = 1e-5, range = 0.0 }"), "contacts.1.adhesion.range", "range = 0.0", "greater than 0", "[m]"),
    "rolling too hard": (("restitution = 0.5", "rolling_friction = 11"), "contacts.1.rolling_friction", "rolling_f", "11", "10"),
    "descending table": (("speed = [0, 1.0]", "speed = [1.0, 0]"), "contacts.1.friction.speed.1", "0], values", "ascend"),
    "uneven table": (("[0.3, 0.2]", "[0.3]"), "contacts.1.friction.values", "values = [0.3]", "1 values for 2 speeds"),
    "missing material": (('material = "steel"', 'material = "stele"'), "walls.2.material", 'material = "stele"', "'steel'"),
    "uncovered pair": (('pair = ["*", "*"]', 'pair = ["steel", "*"]'), "contacts", "[[contacts]]", '["glass", "glass"]'),
    "pair given twice": (('["steel", "glass"]', '["*", "*"]'), "contacts.1.pair", 'pair = ["*", "*"]\nfriction = {', "twice", "remove"),
    "wrong kind": (('kind = "random"', 'kind = "rndom"'), "particles.0.packing.kind", 'kind = "rndom"', "'random'"),
    "no kind": (('kind = "random", ', ""), "particles.0.packing.kind", "packing", "missing"),
    "key of another kind": (("separation = 0.1", "pressure = 1"), "particles.0.packing.pressure", "pressure", 'unknown key of kind = "random"', "belongs to 'compacted'"),
    "wrong word": (('side = "left"', 'side = "up"'), "walls.0.geometry.side", 'side = "up"', "'left', 'right'"),
    "missing key": (('material = "glass"\nshape', "shape"), "particles.0.material", "[[particles]]", "missing", "[materials.NAME]"),
    "missing table": (("[output]\nframe_interval = 0.01\n", ""), "output", "[scenario]", "missing", "add [output]"),
    "short vector": (("size = [0.03, 0.05]", "size = [0.03]"), "domain.size", "size = [0.03]", "too few"),
    "long vector": (("size = [0.03, 0.05]", "size = [0.03, 0.05, 1]"), "domain.size", "size = [0.03", "at most 2", "has 3"),
    "single table": (("[[particles]]", "[particles]"), "particles", "[particles]", "[[particles]]"),
    "no thickness": (("thickness = 1e-3\n", ""), "particles.0", "[[particles]]", "thickness"),
    "no count": (("count = 100\n", ""), "particles.0", "[[particles]]", "neither count nor fill"),
    "count and fill": (("count = 100\n", "count = 100\nfill = 0.5\n"), "particles.0.fill", "fill", "both"),
    "too many grains": (("count = 100\n", "count = 100000\n"), "particles.0.count", "count", "100000", "region"),
    "hostile count": (("count = 100\n", f"count = {10**400}\n"), "particles.0.count", "count", "more than 30 digits"),
    "hostile hexadecimal": (("count = 100\n", f"count = 0x{'f' * 9999}\n"), "particles.0.count", "count", "more than 30 digits"),
    "grains in mm": (("min = 0.4e-3, max = 0.6e-3", "min = 0.4, max = 0.6"), "particles.0.sizes", "sizes = { kind", "1.2 m", "meters"),
    "region outside": (("max = [0.03, 0.049]", "max = [0.04, 0.049]"), "particles.0.region", "region", "0.04", "period"),
    "unknown kind of region": (region('kind = "cirle", center = [0, 0], radius = 1'), "particles.0.region.kind", 'kind = "cirle"', "'circle'"),
    "annulus inside out": (region('kind = "annulus", center = [0.015, 0.02], inner = 0.01, outer = 0.005'), "particles.0.region.outer", "outer = 0.005", "0.005", "not larger than inner = 0.01"),
    "polygon that crosses itself": (region('kind = "polygon", points = [[0, 0], [0.03, 0.04], [0.03, 0], [0, 0.04]]'), "particles.0.region.points.0", "[0, 0], [0.03, 0.04]", "crosses", "in their order along the outline"),
    "circle outside": (region('kind = "circle", center = [0.015, 0.02], radius = 0.016'), "particles.0.region", "region = {", "beyond the period"),
    "narrow annulus": (region('kind = "annulus", center = [0.015, 0.02], inner = 0.008, outer = 0.009'), "particles.0.sizes", "sizes = { kind", "0.0012", "annulus from radius 0.008 to 0.009 m"),
    "too many for a circle": (region('kind = "circle", center = [0.015, 0.02], radius = 0.003'), "particles.0.count", "count = 100", "circle of radius 0.003 m"),
    "compacted in a circle": ((f'{REGION}\npacking = {{ kind = "random", separation = 0.1 }}', 'region = { kind = "circle", center = [0.015, 0.02], radius = 0.01 }\npacking = { kind = "compacted", pressure = 1 }'), "particles.0.region", "region = {", 'kind = "compacted" fills rectangles only', 'kind = "lattice"'),
    "two corners": ((PADDLE, 'kind = "polygon", grains = "outside", points = [[0, 0], [1, 0]]'), "walls.2.geometry.points", "points = [[0, 0], [1, 0]]", "at least 3"),
    "corner given twice": ((PADDLE, 'kind = "polygon", grains = "outside", points = [[0, 0], [1, 0], [1, 1], [1, 0]]'), "walls.2.geometry.points.3", "[1, 0]] }", "given twice"),
    "polygon that runs back": ((PADDLE, 'kind = "polygon", grains = "outside", points = [[0, 0], [2, 0], [1, 0], [1, 1]]'), "walls.2.geometry.points.1", "[2, 0]", "runs back on itself"),
    "grains neither in nor out": ((PADDLE, 'kind = "polygon", grains = "out", points = [[0, 0], [0.01, 0], [0.01, 0.01]]'), "walls.2.geometry.grains", 'grains = "out"', "'outside', 'inside'"),
    "wide polygon": ((PADDLE, 'kind = "polygon", grains = "outside", points = [[0, 0.02], [0.029, 0.02], [0.01, 0.022]]'), "walls.2.geometry.points", "points = [[0, 0.02]", "0.0320278 m wide when it is turned", "periodic = false"),
    "wide line that turns": ((PADDLE, 'kind = "polyline", points = [[0, 0.02], [0.02, 0.05]]'), "loading.0.drives.paddle.spin", "spin = { force", "reaches from one period to the next", "periodic = false"),
    "side shorter than a glued grain": ((PADDLE, 'kind = "polygon", grains = "outside", rough = "grains", points = [[0.01, 0.02], [0.0105, 0.02], [0.01, 0.03]]'), "walls.2.geometry.rough", 'rough = "grains"', "the shortest side is 0.0005 m long"),
    "wide disc": ((PADDLE, 'kind = "disc", center = [0.015, 0.02], radius = 0.016'), "walls.2.geometry.radius", "radius = 0.016", "0.03 m", "periodic = false"),
    "small rough disc": ((PADDLE, 'kind = "disc", center = [0.015, 0.02], radius = 1e-3, rough = "grains"'), "walls.2.geometry.rough", 'rough = "grains"', "radius of 0.001 m"),
    "wide cluster": ((PADDLE, 'kind = "cluster", discs = [[0, 0.02, 1e-3], [0.029, 0.02, 1e-3]]'), "walls.2.geometry.discs", "discs = [[0", "0.031 m wide"),
    "two grains in one place": ((PADDLE, 'kind = "cluster", discs = [[0.01, 0.02, 1e-3], [0.01, 0.02, 2e-3]]'), "walls.2.geometry.discs.1", "[0.01, 0.02, 2e-3]", "[0.01, 0.02]"),
    "wall named twice": (('name = "top"', 'name = "bottom"'), "walls.1.name", 'name = "bottom"\nmaterial = "glass"\ngeometry = { kind = "rough", from = [0, 0.05]', "walls.0"),
    "stage named twice": (('name = "shear"\nuntil', 'name = "compress"\nuntil'), "loading.1.name", 'name = "compress"\nuntil', "loading.0"),
    "unknown wall": (("drives.bottom", "drives.botom"), "loading.2.drives.botom", "drives.botom", "'bottom'"),
    "unknown strain wall": (('["bottom", "top"]', '["floor", "top"]'), "loading.1.until.strain.walls.0", '"floor"', "'bottom', 'top'"),
    "unknown group": (('sizes = "grains"', 'sizes = "grain"'), "walls.1.geometry.sizes", 'sizes = "grain"', "'grains'"),
    "torque without inertia": (("inertia = 1e-8\n", ""), "walls.2.inertia", '[[walls]]\nname = "paddle"', "loading.0", "add inertia"),
    "gravity without force": (("inertia = 1e-8\n", "inertia = 1e-8\ngravity = true\n"), "walls.2.gravity", "gravity = true\n[[loading]]", "paddle"),
    "turning wall": (("[solver]", "[[loading]]\nduration = 1.0\ndrives.top = { spin = { velocity = 1.0 } }\n\n[solver]"), "loading.3.drives.top.spin", "spin = { velocity = 1.0", "cannot turn", "periodic = false"),
    "stage without end": (("duration = 0.5\n", ""), "loading.2", "[[loading]]\ndrives.bottom", "has no end", "duration"),
    "rest without bound": (("duration = 1.0\n", ""), "loading.0.until", "until = { kinetic", "may never end", "duration"),
    "strain without motion": (("ramp = [0.0, 0.1]", "ramp = [0, 0]"), "loading.1.until.strain", "strain = {", "moves in x"),
    "strain that stalls": (("ramp = [0.0, 0.1]", "ramp = [0.1, 0]"), "loading.1.until.strain", "strain = {", "never end"),
    "timeout without condition": (("duration = 0.5\n", 'duration = 0.5\non_timeout = "stop"\n'), "loading.2.on_timeout", "on_timeout", "no effect without until", "remove on_timeout"),
    "timeout without duration": (('name = "shear"\nuntil', 'name = "shear"\non_timeout = "stop"\nuntil'), "loading.1.on_timeout", "on_timeout", "no effect without duration"),
    "another timeout": (("duration = 1.0\n", 'duration = 1.0\non_timeout = "end"\n'), "loading.0.on_timeout", 'on_timeout = "end"', "'go on', 'stop'"),
    "axial strain without bound": ((STRAIN, 'axial_strain = { walls = ["bottom", "top"] }'), "loading.1.until.axial_strain", "axial_strain", "neither above nor below"),
    "axial strain with two bounds": ((STRAIN, 'axial_strain = { walls = ["bottom", "top"], above = 1, below = 1 }'), "loading.1.until.axial_strain", "axial_strain", "both above and below"),
    "axial strain without end": ((STRAIN, 'axial_strain = { walls = ["bottom", "top"], below = -0.1 }'), "loading.1.until", "until = { axial", "may never end"),
    "axial strain of walls that stay": (until('axial_strain = { walls = ["bottom", "paddle"], axis = "x", below = -0.1 }'), "loading.0.until.axial_strain", "axial_strain", "moves in x"),
    "displacement of a fixed wall": (until('displacement = { wall = "bottom", axis = "y", above = 1 }'), "loading.0.until.displacement", "displacement", "does not move in y", "drives.bottom.y"),
    "displacement of no wall": (until('displacement = { wall = "tpo", axis = "y", above = 1 }'), "loading.0.until.displacement.wall", 'wall = "tpo"', "'top'"),
    "force in a long window": (until('force = { wall = "top", axis = "y", above = 1, window = 2.0 }'), "loading.0.until", "until = { force", "no window of 2 s", "shorter windows"),
    "stress by turning": (until('stress = { wall = "top", axis = "spin", above = 1, window = 0.1 }'), "loading.0.until.stress.axis", 'axis = "spin"', "'x', 'y'"),
    "gravity of one number": (("duration = 0.5\n", "duration = 0.5\ngravity = 9.81\n"), "loading.2.gravity", "gravity = 9.81", "array"),
    "gravity with a bad signal": (("duration = 0.5\n", "duration = 0.5\ngravity = [0.0, { ramp = [0, 1] }]\n"), "loading.2.gravity.1.duration", "{ ramp = [0, 1] }", "missing"),
    "velocity and force": (("force = -0.015", "force = -0.015, velocity = 1"), "loading.0.drives.top.y", "y = { force", "exactly one of"),
    "displacement that jumps": ((TOP, "{ position = { ramp = [0.01, 0.02], duration = 1.0 } }"), "loading.0.drives.top.y.position", "position = { ramp", "begins with 0.01", "subtract 0.01"),
    "vibration that jumps": ((TOP, "{ position = { sine = { amplitude = 2e-3, frequency = 5, phase = 1.5707963267948966 } } }"), "loading.0.drives.top.y.position", "position = { sine", "begins with 0.002", "mean = -0.002"),
    "force and stress": (("force = -0.015", "force = -0.015, stress = 1.0"), "loading.0.drives.top.y.stress", "stress = 1.0", "both force and stress"),
    "length without stress": (("force = -0.015", 'force = -0.015, between = ["top", "bottom"]'), "loading.0.drives.top.y.between", "between", "without stress"),
    "stress between one wall": (("force = -0.015", 'stress = -0.5, between = ["bottom", "bottom"]'), "loading.0.drives.top.y.between", "between", "'bottom' is named twice"),
    "stress between no wall": (("force = -0.015", 'stress = -0.5, between = ["botom", "paddle"]'), "loading.0.drives.top.y.between.0", '"botom"', "there is no wall", "'bottom'"),
    "stress on a neighbor": (("force = -0.015", 'stress = -0.5, between = ["top", "paddle"]'), "loading.0.drives.top.y.between", "between", "neighbors"),
    "stress without length": (("force = -0.015", 'stress = -0.5, between = ["bottom", "paddle"]'), "loading.0.drives.top.y.between", "between", "both lie at x = 0.015", "apart in x"),
    "stress that turns": (("spin = { force = { sine", "spin = { stress = { sine"), "loading.0.drives.paddle.spin", "spin = { stress", "not on the spin", "torque"),
    "spring without stiffness": (("force = -0.015", "spring = { anchor = 0.1 }"), "loading.0.drives.top.y.spring.stiffness", "spring", "missing"),
    "spring that pushes": (("force = -0.015", "spring = { stiffness = -1 }"), "loading.0.drives.top.y.spring.stiffness", "stiffness = -1", "greater than 0", "[N/m]"),
    "spring and velocity": (("force = -0.015", "spring = { stiffness = 1.0 }, velocity = 1"), "loading.0.drives.top.y", "y = { spring", "exactly one of", "spring"),
    "friction of no material": (softer('{ pair = ["glas", "*"], friction = 0.1 }'), "loading.2.contacts.0.pair.0", '"glas"', "no material", "'glass'"),
    "friction twice": (softer('{ pair = ["*", "*"], friction = 0.1 }, { pair = ["*", "*"], friction = 0.2 }'), "loading.2.contacts.1.pair", 'pair = ["*", "*"], friction = 0.2', "given twice, first in loading.2.contacts.0"),
    "friction of two general entries": (softer('{ pair = ["*", "steel"], friction = 0.1 }, { pair = ["glass", "*"], friction = 0 }'), "loading.2.contacts.1.pair", 'pair = ["glass", "*"], friction = 0 ', "both apply", "add an entry"),
    "restitution by stage": (softer('{ pair = ["*", "*"], friction = 0.1, restitution = 0.2 }'), "loading.2.contacts.0.restitution", "restitution = 0.2", "unknown key"),
    "softening by stage without heat": (softer('{ pair = ["*", "*"], friction = { value = 0.1, softening = 1e-3 } }'), "loading.2.contacts.0.friction.softening", "softening = 1e-3", "no heat", "[heat]"),
    "steadiness of nothing": (until('steady = { of = "force", wall = "top", window = 0.1, tolerance = 0.1 }'), "loading.0.until.steady", "steady", "axis is missing"),
    "steadiness of a wall's motion": (until('steady = { of = "kinetic_energy", wall = "top", window = 0.1, tolerance = 0.1 }'), "loading.0.until.steady.wall", 'wall = "top"', "no meaning", "remove"),
    "steadiness of a turned stress": (until('steady = { of = "friction", wall = "top", axis = "spin", window = 0.1, tolerance = 0.1 }'), "loading.0.until.steady.axis", 'axis = "spin"', "no component"),
    "steadiness of no wall": (until('steady = { of = "force", wall = "tpo", axis = "y", window = 0.1, tolerance = 0.1 }'), "loading.0.until.steady.wall", 'wall = "tpo"', "'top'"),
    "steadiness that comes too late": (until('steady = { of = "kinetic_energy", window = 0.6, after = 0.5, tolerance = 0.1 }'), "loading.0.until", "until = { steady", "1.1 s", "shorter windows"),
    "unknown signal": (("ramp = [0.0, 0.1]", "rmp = [0.0, 0.1]"), "loading.1.drives.top.x.velocity", "drives.top.x", "ramp, sine, times"),
    "frames too often": (("frame_interval = 0.01", "frame_interval = 1e-4"), "output.frame_interval", "frame_interval", "0.0002"),
    "too many steps": (("duration = 0.5", "duration = 1e9"), "loading.2.duration", "duration = 1e9", "steps"),
    "plane across the period": (('{ kind = "polyline", points = [[0.01, 0.02], [0.02, 0.02]] }', '{ kind = "plane", point = [0, 0], normal = [1, 0] }'), "walls.2.geometry.normal", "normal", "crosses", "[1.0, 0.0]"),
    "bad name": (('name = "shear"\nseed', 'name = "../shear"\nseed'), "scenario.name", 'name = "../', "letters, digits"),
    "wall of unknown groups": (("gravity = true", 'gravity = true\ngroups = ["grain"]'), "walls.1.groups.0", '"grain"]', 'there is no group of particles "grain"', "'grains'"),
    "wall of no group": (("gravity = true", "gravity = true\ngroups = []"), "walls.1.groups", "groups = []", "at least 1"),
    "wall of one group twice": (("gravity = true", 'gravity = true\ngroups = ["grains", "grains"]'), "walls.1.groups.1", '"grains"]', "named twice"),
    "surface with a force too": (("x = { fixed = true } }", "surface = { velocity = 1.0, force = 1.0 } }"), "loading.0.drives.paddle.surface.force", "force = 1.0", "unknown key", "'velocity'"),
    "surface as a number": (("x = { fixed = true } }", "surface = 1.0 }"), "loading.0.drives.paddle.surface", "surface = 1.0", "{ velocity = 0.1 }"),
    "bad seed": (("seed = 7", 'seed = "dice"'), "scenario.seed", 'seed = "dice"', "'random'"),
    "two values": (("seed = 7", "seed = 7\nseed = 8"), "", "\n[domain]", "not TOML"),
    "no quotes": (('name = "top"', "name = top"), "", "top\nmaterial", "not TOML"),
    "open string": (('name = "top"', 'name = "top'), "", None, "not TOML"),
    "nul byte": (("seed = 7", "seed = 7\x00"), "", "\x00", "not TOML"),
    "endless number": (("seed = 7", "seed = " + "7" * 9999), "", "7" * 9999, "digits"),
    "deep nesting": (("seed = 7", "seed = " + "[" * 9999), "", None, "deep"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_gives_one_problem_at_its_place(name):
    change, *expected = MISTAKES[name]
    check_one(changed(SHEAR, change), *expected)


TILT = ("duration = 0.5\n", "duration = 0.5\ngravity = { angle = 10.0 }\n")
PUSHED = ("x = { fixed = true }", "x = { force = 1.0 }")
NO_MASS = ("mass = 1e-3\n", "")
NO_INERTIA = ("mass = 1e-3\ninertia = 1e-8\n", "")
CONTAINER = (
    'kind = "polygon", points = [[0.005, 0.02], [0.015, 0.02], [0.01, 0.03]], grains = "inside"'
)
FROZEN = 'frozen = true\ncontacts = [{ pair = ["*", "*"], friction = 0.1 }]'

# text, changes, key, words that the message must have
TOGETHER = {
    "nothing to tilt": (SHEAR, (TILT, ("[0, -9.81]", "[0, 0]")), "loading.2.gravity", "which no angle turns", "magnitude = 9.81"),
    "two general entries for a pair": (SHEAR, (('pair = ["*", "*"]', 'pair = ["glass", "*"]'), ('pair = ["steel", "glass"]', 'pair = ["steel", "*"]')), "contacts.1.pair", 'add an entry with pair = ["glass", "steel"]'),
    "period of less than four grains": (SHEAR, (("size = [0.03, 0.05]", "size = [0.0024, 0.05]"), ("max = [0.03, 0.049]", "max = [0.0024, 0.049]"), ("count = 100", "count = 1"), (PADDLE, 'kind = "polyline", points = [[0.0, 0.02], [0.001, 0.02]]')), "particles.0.sizes", "0.0024 m"),
    "force on a wall without mass": (SHEAR, (PUSHED, NO_MASS), "walls.2.mass", "its x in loading.0", "add mass [kg]"),
    "stress on a wall without mass": (SHEAR, (NO_MASS, ("x = { fixed = true }", "x = { stress = { ramp = [0, 1], duration = 1 } }")), "walls.2.mass", "add mass [kg]"),
    "spring on a wall without mass": (SHEAR, (NO_MASS, ("x = { fixed = true }", "x = { spring = { stiffness = 1e3, anchor = 0.1 } }")), "walls.2.mass", "add mass [kg]"),
    "container without inertia": (SHEAR, (NO_INERTIA, (PADDLE, CONTAINER)), "walls.2.inertia", "add inertia"),
    "friction of a frozen stage": (HEATED, (("frozen = true", FROZEN),), "loading.1.contacts", "nothing moves"),
}  # fmt: skip


@pytest.mark.parametrize("name", TOGETHER)
def test_tables_that_do_not_fit_together_give_one_problem(name):
    text, changes, key, *words = TOGETHER[name]
    check_one(changed(text, *changes), key, None, *words)


@pytest.mark.parametrize("changes", [
    (),
    (TILT,),  # there is gravity that can be tilted
    # solid bodies need no mass
    (PUSHED, NO_INERTIA, (PADDLE, 'kind = "disc", center = [0.015, 0.02], radius = 2e-3')),
    (PUSHED, NO_INERTIA, (PADDLE, 'kind = "cluster", discs = [[0.015, 0.02, 2e-3]]')),
])  # fmt: skip
def test_what_is_no_mistake(changes):
    assert problems_of(changed(SHEAR, *changes)) == []


SEVERAL = {
    "all at once, in the order of the file": ((("density = 2500", "densty = 2500"),
        ("min = 0.4e-3", "min = -1"), ('material = "steel"', 'material = "iron"'),
        ("drives.bottom", "drives.floor"), ("frame_interval = 0.01", "frame_interval = true")),
        "materials.glass.densty", "particles.0.sizes.min", "walls.2.material",
        "loading.2.drives.floor", "output.frame_interval"),
    "an unknown key does not hide what else is wrong with its table": (
        (('material = "steel"\ngeometry', 'color = "red"\nmaterial = "stel"\ngeometry'),),
        "walls.2.color",
        "walls.2.material",
    ),
    "a misspelled key is taken for the one it means": ((('material = "steel"\ngeometry',
        'materal = "stel"\ngeometry'),), "walls.2.material", "walls.2.materal"),
    "also where that one is needed": ((("thickness = 1e-3\n", "thicknes = 1e-3\n"),),
        "particles.0.thicknes"),
    "a key with a unit hides the checks of its table": ((("thickness = 1e-3\n",
        "thickness_mm = 1\n"),), "particles.0.thickness_mm"),
}  # fmt: skip


@pytest.mark.parametrize("name", SEVERAL)
def test_all_problems_are_told(name):
    changes, *keys = SEVERAL[name]
    problems = problems_of(changed(SHEAR, *changes))
    assert [problem.key for problem in problems] == keys
    assert [problem.line for problem in problems] == sorted(problem.line for problem in problems)


def test_very_many_problems_are_cut_short():
    materials = "".join(f"[materials.m{k}]\n" for k in range(90))
    contacts = "".join(f'[[contacts]]\npair = ["x{k}", "*"]\n' for k in range(50))
    added = (
        ("[[contacts]]", f"{contacts}[[contacts]]"),
        ("[[particles]]", f"{materials}[[particles]]"),
    )
    problems = problems_of(changed(SHEAR, *added))
    assert len(problems) == 101
    assert "more problems" in problems[-1].message


def test_a_problem_reads_as_file_line_column_key_and_shows_the_line():
    (problem,) = problems_of(changed(SHEAR, ("density = 2500", "\tdensty\t= 2500")))
    line = SHEAR[: SHEAR.index("density")].count("\n") + 1
    assert (
        str(problem)
        == f"shear.toml:{line}:2: materials.glass.densty: unknown key; did you mean 'density'?"
    )
    assert problem.excerpt().splitlines() == ["     densty = 2500", "     ^"]


@pytest.mark.parametrize("word", ["timestep", "time_step", "Delta_t"])
def test_words_of_other_programs_are_understood(word):
    (problem,) = problems_of(changed(SHEAR, ("[solver]", f"[solver]\n{word} = 1e-4")))
    assert "did you mean 'dt'?" in problem.remedy


def test_messages_carry_no_control_characters_and_long_lines_are_cut():
    (problem,) = problems_of(
        changed(SHEAR, ("seed = 7", 'seed = 7\n"a\\u001b[2J\\nb' + "c" * 500 + '" = 1'))
    )
    assert str(problem).isprintable()
    assert all(line.isprintable() and len(line) < 140 for line in problem.excerpt().splitlines())
    (problem,) = problems_of(changed(SHEAR, ("[0, 0.001]", "[0" + " " * 500 + ", -nan]")))
    quoted, caret = problem.excerpt().splitlines()
    assert quoted[caret.index("^") :].startswith("-nan")
