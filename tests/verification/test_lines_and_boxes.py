"""Lines and boxes are where they are drawn, and nowhere else: at their ends, over the period, on both sides, moving and turned."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scene_parts import TIGHT, make_engine, make_model

import multicor_cli as multicor
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind
from multicor_cli.scenario import ScenarioError

G = 9.81
PACKED = {"packing": {"kind": "file", "path": "grains.csv"}}
GROUND = {"kind": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


def case(
    directory: Path,
    grains: list[list[float]],
    walls: dict[str, dict[str, Any]],
    *,
    size: tuple[float, float] = (0.2, 0.15),
    **more: Any,
) -> multicor.Scenario:
    """Discs from rows of x, y, radius, v_x, v_y beside walls, for ``duration``."""
    rows = "\n".join(",".join(map(repr, (*row, 0.0, 0.0)[:5])) for row in grains)
    (directory / "grains.csv").write_text(f"x,y,radius,vx,vy\n{rows}\n")
    data: dict[str, Any] = {
        "scenario": {"name": "case", "seed": 1},
        "domain": {"size": list(size), "periodic": more.pop("periodic", False), "gravity": more.pop("gravity", [0.0, -G])},
        "materials": {"m": {"density": 2500.0}},
        "contacts": [{"pair": ["*", "*"], "friction": more.pop("friction", 0.4), "restitution": more.pop("restitution", 0.0)}],
        "particles": [{"name": "g", "material": "m", "shape": "disc", "thickness": 1e-3, **more.pop("particles", PACKED)}],
        "walls": [{"name": name, "material": "m", "geometry": geometry} for name, geometry in walls.items()],
        "loading": [{"duration": more.pop("duration", 0.2), "drives": more.pop("drives", {})}],
        "solver": {"dt": more.pop("dt", 5e-4)},
        "output": {"frame_interval": 0.02},
    }
    assert not more
    return multicor.Scenario.from_dict(data, directory)


def last_frame(scenario: multicor.Scenario, directory: Path) -> Any:
    multicor.run(scenario, directory / "run", threads=1)
    return multicor.open_run(directory / "run").frames[-1]


BOX = {"kind": "box", "min": [0.1, 0.0], "max": [0.12, 0.04], "open": ["top"]}


@pytest.mark.parametrize("is_inside", [True, False])
def test_a_side_of_a_box_holds_on_both_sides(tmp_path: Path, is_inside: bool) -> None:
    """A disc thrown at a side from inside or outside stays on that side, at its radius from it."""
    x, speed = (0.117, 0.3) if is_inside else (0.123, -0.3)
    frame = last_frame(case(tmp_path, [[x, 0.02, 0.002, speed, 0.0]], {"ground": GROUND, "box": BOX}, gravity=[0.0, 0.0]), tmp_path)
    assert frame.position[0, 0] == pytest.approx(0.118 if is_inside else 0.122, abs=2e-6)


def test_what_flies_over_the_rim_falls_beside_the_box(tmp_path: Path) -> None:
    """It leaves at 0.5 m/s, 0.038 m above where it lands: 0.044 m farther."""
    away = 0.5 * math.sqrt(2.0 * 0.038 / G)
    start = 0.121 + 0.0025
    box = {"kind": "box", "min": [0.1, 0.0], "max": [0.12, 0.035], "open": ["top"]}
    frame = last_frame(
        case(tmp_path, [[start, 0.04, 0.002, 0.5, 0.0]], {"ground": GROUND, "box": box}, friction=0.0, duration=0.0881, dt=1e-4),
        tmp_path,
    )
    assert frame.position[0, 0] == pytest.approx(start + away, rel=2e-3)
    assert frame.position[0, 1] == pytest.approx(0.002, abs=2e-5)


@pytest.mark.parametrize("place", [(0.0979, 0.01), (0.1221, 0.0382), (0.11, 0.0421), (0.09, 0.0021), (0.11, 0.06)])
def test_grains_may_lie_outside_of_a_box(tmp_path: Path, place: tuple[float, float]) -> None:
    closed = {**BOX, "open": []}
    frame = last_frame(case(tmp_path, [[*place, 0.002]], {"box": closed}, gravity=[0.0, 0.0], duration=0.02), tmp_path)
    assert frame.position[0, :2] == pytest.approx(place, abs=1e-12)


@pytest.mark.parametrize("is_two_lines", [True, False])
def test_a_lifted_container_lets_its_grains_go(tmp_path: Path, is_two_lines: bool) -> None:
    """A column 18 mm wide and 25 mm high spreads to a heap far wider than the container, which ends up above it."""
    grains = [[0.0912 + 0.0021 * (k % 9) + 0.0007 * (k // 9 % 2), 0.0011 + 0.0021 * (k // 9), 1e-3] for k in range(108)]
    walls: dict[str, dict[str, Any]] = {"ground": GROUND}
    if is_two_lines:
        walls["left"], walls["right"] = ({"kind": "polyline", "points": [[x, 0.0], [x, 0.06]]} for x in (0.09, 0.11))
    else:
        walls["box"] = {"kind": "box", "min": [0.09, 0.0], "max": [0.11, 0.06], "open": ["top", "bottom"]}
    up = {name: {"y": {"velocity": 0.3}} for name in walls if name != "ground"}
    position = last_frame(case(tmp_path, grains, walls, drives=up, duration=0.3, dt=2e-4), tmp_path).position
    assert np.ptp(position[:, 0]) > 0.06
    assert position[:, 1].max() < 0.012


TURNING = {"box": {"spin": {"velocity": 10.0}, "x": {"velocity": 0.02}}}


def test_a_box_that_turns_and_moves_keeps_its_grains_and_keeps_others_out(tmp_path: Path) -> None:
    box = {"kind": "box", "min": [0.08, 0.08], "max": [0.12, 0.11]}
    inside = [[0.085 + 0.006 * k, 0.085 + 0.006 * m, 0.002] for k in range(5) for m in range(3)]
    outside = [[0.06 + 0.01 * k, 0.13, 0.002] for k in range(8)]
    frame = last_frame(
        case(tmp_path, inside + outside, {"ground": GROUND, "box": box}, drives=TURNING, duration=0.5, dt=2e-4), tmp_path
    )
    x, y, angle = frame.wall_position[1]
    c, s = math.cos(angle), math.sin(angle)
    away = frame.position[:, :2] - (x, y)
    local = np.abs(np.column_stack([c * away[:, 0] + s * away[:, 1], c * away[:, 1] - s * away[:, 0]]))
    depth = np.maximum(local[:, 0] - 0.02, local[:, 1] - 0.015)
    assert depth[: len(inside)].max() < -0.002 + 4e-6
    corner = np.hypot(*np.maximum(local[len(inside) :] - (0.02, 0.015), 0.0).T)
    assert corner.min() > 0.002 - 4e-6


@pytest.mark.parametrize("speed", [0.0, 3.0])
@pytest.mark.parametrize("points", [[[0.0, 0.02], [0.1, 0.02]], [[0.03, 0.02], [-0.07, 0.02]], [[0.0, 0.02], [0.6, 0.02]]])
def test_a_floor_as_wide_as_the_period_carries_grains_anywhere(tmp_path: Path, points: list[list[float]], speed: float) -> None:
    """Also at its seam, and while it moves through the period under them."""
    places = [0.0125 * k for k in range(8)]
    floor = {"floor": {"kind": "polyline", "points": points}}
    scenario = case(
        tmp_path, [[x, 0.03, 0.005] for x in places], floor, size=(0.1, 0.1), periodic=True, friction=0.0,
        drives={"floor": {"x": {"velocity": speed}}},
    )  # fmt: skip
    assert {check.name: check.value for check in multicor.check_scenario(scenario)}["grains without a floor"] == 0.0
    frame = last_frame(scenario, tmp_path)
    assert frame.position[:, 0] == pytest.approx(places, abs=1e-9)
    assert frame.position[:, 1] == pytest.approx(0.025, abs=1e-5)


def test_a_ramp_longer_than_half_the_period_is_there_for_packings_and_for_grains(tmp_path: Path) -> None:
    ramp = {"kind": "polyline", "points": [[0.01, 0.03], [0.09, 0.02]]}
    pieces = {**ramp, "points": [[0.01 + 0.01 * k, 0.03 - 0.00125 * k] for k in range(9)]}
    held = []
    for k, geometry in enumerate((ramp, pieces)):
        directory = tmp_path / str(k)
        directory.mkdir()
        grains = [[0.004 + 0.0082 * k, 0.045, 0.002] for k in range(12)]
        walls = {"ground": GROUND, "ramp": geometry}
        frame = last_frame(case(directory, grains, walls, size=(0.1, 0.1), periodic=True), directory)
        held.append(int((frame.position[:, 1] > 0.015).sum()))
    assert held[0] == held[1] > 8
    packed = {"sizes": {"kind": "list", "radii": [1e-3]}, "count": 900, "packing": {"kind": "random"}}
    directory = tmp_path / "packed"
    directory.mkdir()
    scenario = case(directory, [], {"ramp": ramp}, size=(0.1, 0.1), periodic=True, duration=5e-4, particles=packed)
    multicor.run(scenario, directory / "run", threads=1)
    position = multicor.open_run(directory / "run").frames[0].position
    along = np.clip((position[:, 0] - 0.01) / 0.08, 0.0, 1.0)
    assert np.hypot(position[:, 0] - 0.01 - 0.08 * along, position[:, 1] - 0.03 + 0.01 * along).min() > 0.9e-3


@pytest.mark.parametrize("offset", [0.0, 0.3, 0.77])
@pytest.mark.parametrize("turn", [0.4, -0.7, 2.5])
def test_torques_know_which_image_of_a_grain_touches(offset: float, turn: float) -> None:
    """A beam 0.96 periods long, free to turn about its middle, is hit at its tip: angular momentum about the middle is kept."""
    half = 0.48
    tip = np.array([half * math.cos(turn), half * math.sin(turn)])
    normal = np.array([math.cos(turn + 0.9), math.sin(turn + 0.9)])  # towards the grain, beyond the end
    shapes = [(ShapeKind.SEGMENT, 0, (-half, 0.0, 0.0, 0.0)), (ShapeKind.SEGMENT, 0, (0.0, 0.0, half, 0.0))]
    shapes += [(ShapeKind.VERTEX, 0, (-half, 0.0, -1.0, 0.0)), (ShapeKind.VERTEX, 0, (half, 0.0, 1.0, -1.0))]
    model = make_model([0.1], shapes, ("beam",), gravity=(0.0, 0.0), period=1.0, mass=1.0, inertia=2e-3, friction=0.7)
    start = tip + 0.13 * normal
    engine = make_engine(
        model, [[(offset + start[0]) % 1.0, start[1], 0.0]], [[*-normal, 5.0]], settings=TIGHT,
        drives=[WallDrive(spin=DofDrive(force=Constant(0.0)))],
    )  # fmt: skip
    engine.state.wall_position[0] = offset, 0.0, turn
    mass, inertia = model.grains.mass[0], model.grains.inertia[0]
    before = inertia * 5.0 - mass * (start[0] * normal[1] - start[1] * normal[0])
    for k in range(60):
        engine.step(1e-3, 1e-3 * k)
        if engine.state.wall_velocity[0, 2] != 0.0:
            break
    position, velocity = engine.state.position[0], engine.state.velocity[0]
    away = np.array([position[0] + engine.state.image[0] - offset, position[1]])
    away[0] -= np.rint(away[0] - start[0])
    after = inertia * velocity[2] + mass * (away[0] * velocity[1] - away[1] * velocity[0]) + 2e-3 * engine.state.wall_velocity[0, 2]
    assert abs(engine.state.wall_velocity[0, 2]) > 0.1
    assert after == pytest.approx(
        before, rel=2e-3
    )  # the lever is that of the middle of the step, the grain moves on for half of one


@pytest.mark.parametrize(
    "disc", [{"kind": "disc", "center": [0.05, 0.1], "radius": 0.04}, {"kind": "cluster", "discs": [[0.05, 0.1, 0.04]]}]
)
def test_a_grain_that_may_touch_a_disc_and_its_image_is_refused(tmp_path: Path, disc: dict[str, Any]) -> None:
    """Twice as wide with two such discs it is computed: the grain rests on both, m g/(2 cos) each."""
    with pytest.raises(ScenarioError) as refusal:
        multicor.run(case(tmp_path, [[0.0, 0.15, 0.011]], {"post": disc}, size=(0.1, 0.3), periodic=True), tmp_path / "run")
    assert "leave 0.02 m between them, less than 2 times the largest diameter of 0.022 m" in str(refusal.value)
    walls = {
        "first": {"kind": "disc", "center": [0.05, 0.1], "radius": 0.04},
        "second": {"kind": "disc", "center": [0.15, 0.1], "radius": 0.04},
    }
    frame = last_frame(
        case(tmp_path, [[0.0, 0.15, 0.011], [0.1, 0.15, 0.011]], walls, size=(0.2, 0.3), periodic=True, friction=0.0, duration=0.6),
        tmp_path,
    )
    assert frame.position[:, 1] == pytest.approx(0.1 + math.sqrt(0.051**2 - 0.05**2), abs=1e-5)
    weight, cosine = 2500.0 * math.pi * 0.011**2 * 1e-3 * G, math.sqrt(0.051**2 - 0.05**2) / 0.051
    assert np.asarray(frame.contacts.impulse)[:, 0] / frame.dt == pytest.approx(weight / (2.0 * cosine), rel=1e-3)
