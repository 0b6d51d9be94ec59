"""Each check of a scenario, provoked by a scenario that deserves it."""

from __future__ import annotations

import math
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest
from cut_runs import BOX
from scenes import HEATED, PACKED, SMALL, changed, write_small

from multicor_cli import check_scenario
from multicor_cli.checks import Check, Verdict, resolution, worst_verdict
from multicor_cli.checks.floor import escape_share
from multicor_cli.checks.resolution import impact_deflection
from multicor_cli.engine.heat.hertz import contact_modulus
from multicor_cli.packing import build
from multicor_cli.scenario import load_scenario

OK, WARNING, BAD = Verdict.OK, Verdict.WARNING, Verdict.BAD


def checked(directory: Path, text: str = SMALL, *changes: tuple[str, str]) -> dict[str, Check]:
    return {
        check.name: check
        for check in check_scenario(write_small(directory, changed(text, *changes)))
    }


def test_an_ordinary_scenario_is_ok(tmp_path: Path) -> None:
    assert worst_verdict(checked(tmp_path, SMALL, ("dt = 2e-4", "")).values()) is OK


GHOST = ('side = "right" }', 'side = "right" }\nmass = 1e-18')
SINGLE = ("frame_interval = 0.002", 'frame_interval = 0.002\nprecision = "single"')


def _at_height(height: float) -> list[tuple[str, str]]:
    return [
        (
            "min = [0.0, 0.001], max = [0.02, 0.009]",
            f"min = [0.0, {height + 0.001}], max = [0.02, {height + 0.009}]",
        ),
        ("from = [0.0, 0.0], to = [0.02, 0.0]", f"from = [0.0, {height}], to = [0.02, {height}]"),
        (
            "from = [0.0, 0.01], to = [0.02, 0.01]",
            f"from = [0.0, {height + 0.01}], to = [0.02, {height + 0.01}]",
        ),
    ]


SHIFTED, FAR = _at_height(1e3), _at_height(9e5)
"""The same far above the origin."""


@pytest.mark.parametrize(
    ("name", "verdict", "changes"),
    [
        ("time step", WARNING, [("dt = 2e-4", "dt = 5e-4")]),
        ("time step", BAD, [("dt = 2e-4", "dt = 2e-3")]),
        ("density", WARNING, [("density = 2500.0", "density = 2.5")]),
        ("density", WARNING, [("density = 2500.0", "density = 28000.0")]),
        ("Young's modulus", WARNING, [("young = 70e9", "young = 7e4")]),
        ("deflection", WARNING, [("young = 70e9", "young = 1e8")]),
        ("deflection", BAD, [("young = 70e9", "young = 1e6")]),
        ("deflection in impacts", WARNING, [("young = 70e9", "young = 3e7")]),
        ("deflection in impacts", BAD, [("young = 70e9", "young = 3e5")]),
        ("friction coefficient", WARNING, [("friction = 0.4", "friction = 2.5")]),
        ("load off the grains", WARNING, [("force = -0.1", "force = 0.1")]),
        ("round-off", BAD, [("force = -0.1, damping = 0.1 } }\n", "force = -0.1 } }\n"), GHOST]),
        ("round-off", OK, [("force = -0.1, damping = 0.1 } }\n", "force = -0.1 } }\n")]),
        ("round-off", OK, [GHOST]),
        ("round-off", WARNING, FAR),
        ("round-off", OK, SHIFTED),
        ("stored places", OK, [SINGLE]),
        ("stored places", BAD, [*SHIFTED, SINGLE]),
        ("grain diameter", WARNING, [
            ("size = [0.02, 0.02]", "size = [20.0, 20.0]"),
            ("min = 0.4e-3, max = 0.6e-3", "min = 0.4, max = 0.6"),
            ("min = [0.0, 0.001], max = [0.02, 0.009]", "min = [0.0, 1.0], max = [20.0, 9.0]"),
            ("from = [0.0, 0.0], to = [0.02, 0.0]", "from = [0.0, 0.0], to = [20.0, 0.0]"),
            ("from = [0.0, 0.01], to = [0.02, 0.01]", "from = [0.0, 10.0], to = [20.0, 10.0]"),
        ]),
    ],
)  # fmt: skip
def test_each_verdict(
    name: str, verdict: Verdict, changes: list[tuple[str, str]], tmp_path: Path
) -> None:
    found = checked(tmp_path, SMALL, *changes)[name]
    assert found.verdict is verdict, found


def test_upward_gravity(tmp_path: Path) -> None:
    assert (
        checked(tmp_path, SMALL, ("periodic = true", "periodic = true\ngravity = [0.0, 9.81]"))[
            "upward gravity"
        ].verdict
        is WARNING
    )


def test_temperatures_in_degrees(tmp_path: Path) -> None:
    assert checked(tmp_path, HEATED)["lowest temperature"].verdict is OK
    found = checked(tmp_path, HEATED, ("ramp = [300.0, 350.0]", "ramp = [20.0, 70.0]"))[
        "lowest temperature"
    ]
    assert (found.verdict, found.value) == (WARNING, 20.0)
    assert "wall floor in stage fall" in found.text
    assert (
        checked(tmp_path, HEATED, ("value = 300.0,", "value = 20.0,"))["lowest temperature"].verdict
        is WARNING
    )


@pytest.mark.parametrize(
    ("changes", "verdict", "what"),
    [
        ([], OK, "wall floor in stage fall"),
        ([("ramp = [300.0, 350.0]", "ramp = [300.0, 4400.0]")], BAD, "4400 K, wall floor"),
        ([("[materials.steel]", "[materials.steel]\nmelting = 340.0")], BAD, "350 K, wall floor"),
        ([("[materials.steel]", "[materials.steel]\nmelting = 400.0")], OK, "350 K, wall floor"),
        ([("value = 300.0,", "value = 5000.0,")], BAD, "a grain of"),
    ],
)
def test_temperatures_that_no_solid_bears(
    changes: list[tuple[str, str]], verdict: Verdict, what: str, tmp_path: Path
) -> None:
    found = checked(tmp_path, HEATED, *changes)["highest temperature"]
    assert found.verdict is verdict
    assert what in found.text


def test_predicted_biot_number(tmp_path: Path) -> None:
    """Bi = 2 a_c/a with a_c = a √(δ/2a)."""
    soft = checked(tmp_path, HEATED, ("young = 70e9", "young = 1e5"))
    assert soft["Biot number"].value == pytest.approx(2.0 * math.sqrt(soft["deflection"].value))
    assert soft["Biot number"].verdict is not OK
    assert checked(tmp_path, HEATED)["Biot number"].verdict is OK


def test_a_lid_whose_weight_outweighs_the_pull_is_no_lid_that_is_pulled(tmp_path: Path) -> None:
    heavy = ('side = "right" }', 'side = "right" }\nmass = 1.0\ngravity = true')
    assert (
        checked(tmp_path, SMALL, heavy, ("force = -0.1", "force = 0.1"))[
            "load off the grains"
        ].verdict
        is OK
    )


def test_impact_of_spheres() -> None:
    """Against the energy: ½ m* v² = ∫ F dδ = (8/15) E* √a* δ^(5/2)."""
    radius, density, young, poisson, speed = 2e-3, 2500.0, 70e9, 0.2, 3.0
    reduced = 0.5 * density * 4.0 / 3.0 * math.pi * radius**3
    stiffness = contact_modulus(young, poisson, young, poisson) * math.sqrt(0.5 * radius)
    delta = impact_deflection(speed, density, young, poisson) * 2.0 * radius
    assert 8.0 / 15.0 * stiffness * delta**2.5 == pytest.approx(0.5 * reduced * speed**2)


@pytest.mark.parametrize(("share", "verdict"), [(0.1, OK), (0.8, WARNING), (1.5, BAD)])
def test_disk(
    share: float, verdict: Verdict, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(resolution.shutil, "disk_usage", lambda place: usage(10**9))
    needed = checked(tmp_path)["disk"].value * 1e9
    monkeypatch.setattr(resolution.shutil, "disk_usage", lambda place: usage(int(needed / share)))
    assert checked(tmp_path)["disk"].verdict is verdict


@pytest.mark.parametrize(("share", "verdict"), [(0.1, OK), (0.8, WARNING), (1.5, BAD)])
def test_memory(
    share: float, verdict: Verdict, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resolution, "available_memory", lambda: 10**9)
    needed = checked(tmp_path)["memory"].value * 1e9
    monkeypatch.setattr(resolution, "available_memory", lambda: int(needed / share))
    assert checked(tmp_path)["memory"].verdict is verdict


WALL = '[[walls]]\nname = "w{k}"\nmaterial = "glass"\ngeometry = {geometry}\n'
FLOOR = '{ kind = "plane", point = [0, 0], normal = [0, 1] }'
CUP = (
    '{ kind = "polyline", points = [[-0.001, 0.09], [-0.001, -0.001], [0.061, -0.001], [0.061, '
    "0.09]] }"
)
TABLE = '{ kind = "polyline", points = [[-0.001, -0.001], [0.061, -0.001]] }'
HOPPER = (
    '{ kind = "polyline", points = [[-0.001, 0.09], [-0.001, -0.001], [0.02, -0.01]] }',
    ('{ kind = "polyline", points = [[0.061, 0.09], [0.061, -0.001], [0.04, -0.01]] }'),
)
LEFT, RIGHT = (
    '{ kind = "plane", point = [0, 0], normal = [1, 0] }',
    '{ kind = "plane", point = [0.06, 0], normal = [-1, 0] }',
)
DRUM = '{ kind = "circle", center = [0.03, 0.04], radius = 0.051 }'
ROUGH = '{ kind = "rough", from = [-0.01, -0.001], to = [0.07, -0.001], side = "left" }'


@pytest.mark.parametrize(
    ("walls", "share"),
    [
        ([], 1.0), ([FLOOR], 0.0), ([CUP], 0.0), ([TABLE], 1.0), ([TABLE, LEFT, RIGHT], 0.0),
        ([TABLE, LEFT], 1.0), (HOPPER, 1.0),
        ([DRUM], 0.0), ([ROUGH], 1.0), ([ROUGH, LEFT, RIGHT], 0.0),
        ([*HOPPER, FLOOR.replace("[0, 0]", "[0, -0.1]")], 0.0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("turns", [0, 1, 2])
def test_grains_that_can_get_out(
    walls: list[str], share: float, turns: int, tmp_path: Path
) -> None:
    """Also with everything turned by right angles: gravity decides what is below."""
    text = (
        PACKED
        + "\n"
        + "\n".join(WALL.format(k=k, geometry=geometry) for k, geometry in enumerate(walls))
    )
    model, state = build(load_scenario(write_small(tmp_path, text)))
    assert escape_share(model, state.position, state.wall_position, model.gravity) == share
    for _ in range(turns):
        model.gravity[:] = -model.gravity[1], model.gravity[0]
        state.position[:, :2] = np.column_stack([-state.position[:, 1], state.position[:, 0]])
        state.wall_position[:, :2] = np.column_stack(
            [-state.wall_position[:, 1], state.wall_position[:, 0]]
        )
        state.wall_position[:, 2] += 0.5 * math.pi
    assert escape_share(model, state.position, state.wall_position, model.gravity) == share


def test_a_rough_floor_of_a_period_has_no_ends(tmp_path: Path) -> None:
    assert checked(tmp_path)["grains without a floor"].verdict is OK
    half = ("from = [0.0, 0.0], to = [0.02, 0.0]", "from = [0.0, 0.0], to = [0.01, 0.0]")
    assert checked(tmp_path, SMALL, half)["grains without a floor"].verdict is WARNING


def test_a_floor_holds_those_alone_that_meet_it(tmp_path: Path) -> None:
    plane = 'geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }'
    text = changed(BOX, (plane, plane + '\ngroups = ["large"]'))
    model, state = build(load_scenario(write_small(tmp_path, text)))
    assert escape_share(model, state.position, state.wall_position, model.gravity) == 0.5


def test_no_floor_without_gravity(tmp_path: Path) -> None:
    assert "grains without a floor" not in checked(
        tmp_path, SMALL, ("periodic = true", "periodic = true\ngravity = [0.0, 0.0]")
    )
