"""Each check of a scenario, provoked by a scenario that deserves it."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cut_runs import BOX
from scenes import HEATED, PACKED, SMALL, changed, write_small
from shaped_frames import rod, shaped_model

from multicor_cli import check_scenario
from multicor_cli.checks import Verdict, resolution, worst_verdict
from multicor_cli.checks.floor import escape_share
from multicor_cli.checks.resolution import impact_deflection
from multicor_cli.engine.heat.hertz import contact_modulus
from multicor_cli.model import ShapeKind
from multicor_cli.packing import build
from multicor_cli.scenario import load_scenario

OK, WARNING, BAD = Verdict.OK, Verdict.WARNING, Verdict.BAD


def checked(directory, text=SMALL, *changes):
    checks = check_scenario(write_small(directory, changed(text, *changes)))
    return {check.name: check for check in checks}


def test_an_ordinary_scenario_is_ok(tmp_path):
    assert worst_verdict(checked(tmp_path, SMALL, ("dt = 2e-4", "")).values()) is OK


def clump(*pieces):
    """Grains that are a clump of these pieces."""
    pieces = ", ".join(f"{{ {piece} }}" for piece in pieces)
    return 'shape = "disc"', f'shape = {{ kind = "clump", pieces = [{pieces}] }}'


def disc(x, radius=1.0):
    """A piece."""
    return f"center = [{x}, 0.0], radius = {radius}"


BAR = "vertices = [[0.0, 0.0], [4.0, 0.0]], radius = 0.1"
SQUARE = "vertices = [[5.0, -1.0], [7.0, -1.0], [7.0, 1.0], [5.0, 1.0]]"


@pytest.mark.parametrize(("name", "value", "verdict", "pieces"), [
    ("gaps in clumps", 2 / 6, WARNING, [disc(0), disc(4)]),  # from 1 to 3 of -1 to 5
    ("gaps in clumps", 0.0, OK, [disc(0), disc(4), BAR]),
    ("gaps in clumps", 0.0, OK, [disc(0), disc(2)]),
    ("gaps in clumps", 0.9 / 8, WARNING, [BAR, disc(0), SQUARE]),  # from 4.1 to 5 of -1 to 7
    ("gaps in clumps", 0.0, OK, [disc(0), disc(0)]),
    ("gaps in clumps", (2**0.5 - 1) / 3, WARNING, ["vertices = [[1, 1], [2, 1], [2, 2], [1, 2]]", disc(0)]),
    ("pieces twice in clumps", 2.0, WARNING, [SQUARE, disc(5), disc(5), "vertices = [[7, -1], [7, 1], [5, 1], [5, -1]]"]),
    ("pieces twice in clumps", 0.0, OK, [disc(0), disc(0, 1.1)]),
    ("smallest piece of clumps", 1e-9, WARNING, [disc(0), disc(1, 1e-9)]),
    ("smallest piece of clumps", 0.2, OK, [disc(0.25, 0.25), disc(1), disc(1.5)]),
])  # fmt: skip
def test_pieces_of_clumps_make_one_grain(name, value, verdict, pieces, tmp_path):
    check = checked(tmp_path, SMALL, clump(*pieces))[name]
    assert check.value == pytest.approx(value, rel=1e-9, abs=1e-15)
    assert check.verdict is verdict


GHOST = ('side = "right" }', 'side = "right" }\nmass = 1e-18')
HEAVY = ('side = "right" }', 'side = "right" }\nmass = 1.0\ngravity = true')
UNDAMPED = ("force = -0.1, damping = 0.1 } }\n", "force = -0.1 } }\n")
PULLED = ("force = -0.1", "force = 0.1")
SINGLE = ("frame_interval = 0.002", 'frame_interval = 0.002\nprecision = "single"')
HALF = ("from = [0.0, 0.0], to = [0.02, 0.0]", "from = [0.0, 0.0], to = [0.01, 0.0]")


def gravity(up):
    return "periodic = true", f"periodic = true\ngravity = [0.0, {up}]"


def moved(height=0.0, scale=1.0):
    """The same at another height, so many times as wide."""
    low, high = (f"[0.0, {height + scale * y}]" for y in (0.0, 0.01))
    ends = (f"[{0.02 * scale}, {height + scale * y}]" for y in (0.0, 0.01))
    bottom, top = (height + scale * y for y in (0.001, 0.009))
    return [
        ("min = [0.0, 0.001], max = [0.02, 0.009]", f"min = [0.0, {bottom}], max = [{0.02 * scale}, {top}]"),
        ("from = [0.0, 0.0], to = [0.02, 0.0]", f"from = {low}, to = {next(ends)}"),
        ("from = [0.0, 0.01], to = [0.02, 0.01]", f"from = {high}, to = {next(ends)}"),
    ]  # fmt: skip


LARGE = [*moved(scale=1e3), ("size = [0.02, 0.02]", "size = [20.0, 20.0]"), ("min = 0.4e-3, max = 0.6e-3", "min = 0.4, max = 0.6")]  # fmt: skip


@pytest.mark.parametrize(("name", "verdict", "changes"), [
    ("time step", WARNING, [("dt = 2e-4", "dt = 1.5e-4")]),
    ("time step", BAD, [("dt = 2e-4", "dt = 2e-3")]),
    ("density", WARNING, [("density = 2500.0", "density = 2.5")]),
    ("density", WARNING, [("density = 2500.0", "density = 28000.0")]),
    ("Young's modulus", WARNING, [("young = 70e9", "young = 7e4")]),
    ("deflection", WARNING, [("young = 70e9", "young = 1e8")]),
    ("deflection", BAD, [("young = 70e9", "young = 1e6")]),
    ("deflection in impacts", WARNING, [("young = 70e9", "young = 3e7")]),
    ("deflection in impacts", BAD, [("young = 70e9", "young = 3e5")]),
    ("friction coefficient", WARNING, [("friction = 0.4", "friction = 2.5")]),
    ("upward gravity", WARNING, [gravity(9.81)]),
    ("load off the grains", WARNING, [PULLED]),
    ("load off the grains", OK, [HEAVY, PULLED]),
    ("round-off", BAD, [UNDAMPED, GHOST]),
    ("round-off", OK, [UNDAMPED]),
    ("round-off", OK, [GHOST]),
    ("round-off", WARNING, moved(9e5)),
    ("round-off", OK, moved(1e3)),
    ("stored places", OK, [SINGLE]),
    ("stored places", BAD, [*moved(1e3), SINGLE]),
    ("grain diameter", WARNING, LARGE),
    ("grains beyond the domain", OK, []),
    ("grains beyond the domain", WARNING, moved(1.0)),
    ("grains without a floor", OK, []),  # a rough floor of a period has no ends
    ("grains without a floor", WARNING, [HALF]),
])  # fmt: skip
def test_each_verdict(name, verdict, changes, tmp_path):
    found = checked(tmp_path, SMALL, *changes)[name]
    assert found.verdict is verdict, found


def melting(temperature):
    return [("[materials.steel]", f"[materials.steel]\nmelting = {temperature}")]


def ramp(*ends):
    return [("ramp = [300.0, 350.0]", f"ramp = [{ends[0]}, {ends[1]}]")]


@pytest.mark.parametrize(("name", "changes", "verdict", "what"), [
    ("lowest temperature", [], OK, ""),
    ("lowest temperature", ramp(20.0, 70.0), WARNING, "20 K (wall floor in stage fall"),
    ("lowest temperature", ramp(300.0, 20.0), WARNING, "20 K (wall floor in stage fall"),
    ("lowest temperature", [("value = 300.0,", "value = 20.0,")], WARNING, ""),
    ("highest temperature", [], OK, "wall floor in stage fall"),
    ("highest temperature", ramp(300.0, 4400.0), BAD, "4400 K, wall floor"),
    ("highest temperature", melting(340.0), BAD, "350 K, wall floor"),
    ("highest temperature", melting(400.0), OK, "350 K, wall floor"),
    ("highest temperature", [("value = 300.0,", "value = 5000.0,")], BAD, "a grain of"),
    ("gas conductivity", [], OK, "0.026 W/(m K)"),
    ("gas conductivity", [('0.026, model = "batchelor"', "26.0")], WARNING, "26 W/(m K)"),
])  # fmt: skip
def test_temperatures_in_degrees_that_no_solid_bears_and_gas_in_milliwatts(
    name, changes, verdict, what, tmp_path
):
    found = checked(tmp_path, HEATED, *changes)[name]
    assert found.verdict is verdict
    assert what in found.text


def test_predicted_biot_number(tmp_path):
    """Bi = 2 a_c/a with a_c = a √(δ/2a)."""
    soft = checked(tmp_path, HEATED, ("young = 70e9", "young = 1e5"))
    assert soft["Biot number"].value == pytest.approx(2.0 * math.sqrt(soft["deflection"].value))
    assert soft["Biot number"].verdict is not OK
    assert checked(tmp_path, HEATED)["Biot number"].verdict is OK


def test_impact_of_spheres():
    """Against the energy: ½ m* v² = ∫ F dδ = (8/15) E* √a* δ^(5/2)."""
    radius, density, young, poisson, speed = 2e-3, 2500.0, 70e9, 0.2, 3.0
    reduced = 0.5 * density * 4.0 / 3.0 * math.pi * radius**3
    stiffness = contact_modulus(young, poisson, young, poisson) * math.sqrt(0.5 * radius)
    delta = impact_deflection(speed, density, young, poisson) * 2.0 * radius
    assert 8.0 / 15.0 * stiffness * delta**2.5 == pytest.approx(0.5 * reduced * speed**2)


@pytest.mark.parametrize("name", ["disk", "memory"])
def test_space(name, tmp_path, monkeypatch):
    def check(free):
        monkeypatch.setattr(resolution, "available_memory", lambda: free)
        usage = SimpleNamespace(free=free)
        monkeypatch.setattr("shutil.disk_usage", lambda place: usage)
        return checked(tmp_path)[name]

    needed = check(10**9).value * 1e9
    for share, verdict in ((0.1, OK), (0.8, WARNING), (1.5, BAD)):
        assert check(int(needed / share)).verdict is verdict


FLOOR = 'kind = "plane", point = [0, 0], normal = [0, 1]'
CUP = (
    'kind = "polyline", points = [[-0.001, 0.09], [-0.001, -0.001], [0.061, -0.001], [0.061, 0.09]]'
)
TABLE = 'kind = "polyline", points = [[-0.001, -0.001], [0.061, -0.001]]'
HOPPER = (
    'kind = "polyline", points = [[-0.001, 0.09], [-0.001, -0.001], [0.02, -0.01]]',
    'kind = "polyline", points = [[0.061, 0.09], [0.061, -0.001], [0.04, -0.01]]',
)
LEFT = 'kind = "plane", point = [0, 0], normal = [1, 0]'
RIGHT = 'kind = "plane", point = [0.06, 0], normal = [-1, 0]'
DRUM = 'kind = "circle", center = [0.03, 0.04], radius = 0.051'
ROUGH = 'kind = "rough", from = [-0.01, -0.001], to = [0.07, -0.001], side = "left"'


def share_of(model, state):
    return escape_share(model, state.position, state.wall_position, model.gravity)


def placed(directory, text):
    return build(load_scenario(write_small(directory, text)))


@pytest.mark.parametrize(
    ("walls", "share"),
    [
        ([], 1.0), ([FLOOR], 0.0), ([CUP], 0.0), ([TABLE], 1.0), ([TABLE, LEFT, RIGHT], 0.0),
        ([TABLE, LEFT], 1.0), (HOPPER, 1.0),
        ([DRUM], 0.0), ([ROUGH], 1.0), ([ROUGH, LEFT, RIGHT], 0.0),
        ([*HOPPER, FLOOR.replace("[0, 0]", "[0, -0.1]")], 0.0),
    ],
)  # fmt: skip
def test_grains_that_can_get_out(walls, share, tmp_path):
    """Also with everything turned by right angles: gravity decides what is below."""
    wall = '\n[[walls]]\nname = "w{}"\nmaterial = "glass"\ngeometry = {{ {} }}\n'.format
    model, state = placed(tmp_path, PACKED + "".join(map(wall, range(len(walls)), walls)))
    assert share_of(model, state) == share
    for _ in range(2):
        model.gravity[:] = -model.gravity[1], model.gravity[0]
        for place in (state.position, state.wall_position):
            place[:, :2] = np.column_stack([-place[:, 1], place[:, 0]])
        state.wall_position[:, 2] += 0.5 * math.pi
        assert share_of(model, state) == share


def test_rods_get_out_of_gaps_that_are_wider_than_they_are():
    """0.4 m wide and 2 m long ones: of a gap of 1 m, not of one of 0.3 m."""
    for gap, share in ((1.0, 1.0), (0.3, 0.0)):
        floor = [(-9.0, 0.0, -0.5 * gap, 0.0), (0.5 * gap, 0.0, 9.0, 0.0)]
        shapes = [(ShapeKind.SEGMENT, 0, ends) for ends in floor]
        sides = [(ShapeKind.PLANE, 1, (-5.0, 0, 1, 0)), (ShapeKind.PLANE, 1, (5.0, 0, -1, 0))]
        model = shaped_model([[rod(1.6, 0.2)]] * 2, shapes + sides, ("floor", "sides"))
        place = np.array([[-2.0, 1.5, 0.0], [2.0, 1.5, 0.0]])
        assert escape_share(model, place, np.zeros((2, 3)), model.gravity) == share
    discs = replace(model, outlines=None)
    assert escape_share(discs, place, np.zeros((2, 3)), model.gravity) == 0.0


def test_a_floor_holds_those_alone_that_meet_it_where_there_is_gravity(tmp_path):
    plane = 'geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }'
    text = changed(BOX, (plane, plane + '\ngroups = ["large"]'))
    assert share_of(*placed(tmp_path, text)) == 0.5
    assert "grains without a floor" not in checked(tmp_path, SMALL, gravity(0.0))


def test_a_stage_without_gravity_does_not_hide_the_next(tmp_path):
    """Which throws all grains off the floor."""
    turned = ("duration = 0.03\n", "gravity = [0.0, 0.0]\nduration = 0.03\n"), (
        "duration = 0.02\n", "gravity = [0.0, 9.81]\nduration = 0.02\n",
    )  # fmt: skip
    found = checked(tmp_path, BOX, *turned)["grains without a floor"]
    assert found.value == 1.0
