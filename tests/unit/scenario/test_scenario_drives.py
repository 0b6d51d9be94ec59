"""From loading stages to the drives of the engine: what is not named again is kept, and its signal
goes on."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import HEATED, SHEAR

from multicor_cli.engine.motion.drives import (
    Constant,
    DofDrive,
    Interpolated,
    Ramp,
    Shifted,
    Sine,
    WallDrive,
)
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.stage_drives import NEVER

SCENARIO = parse_scenario(SHEAR, "shear.toml")
BOTTOM, TOP, PADDLE = range(3)


def test_signals_are_carried_over_and_all_else_is_fixed_or_kept():
    stage = SCENARIO.drives()[0]
    assert stage.walls[BOTTOM] == WallDrive()
    assert stage.walls[TOP].x == DofDrive()
    assert stage.named_by == ((NEVER,) * 4, (NEVER, 0, NEVER, NEVER), (0, NEVER, 0, NEVER))
    compress, shear, last = SCENARIO.drives()
    assert compress.walls[TOP].y == DofDrive(force=Constant(-0.015), damping=0.02)
    assert compress.walls[PADDLE].spin == DofDrive(force=Sine(0.0, 1e-6, 0.1, 0.0))
    assert shear.walls[TOP].x == DofDrive(velocity=Ramp(0.0, 0.1, 0.02))
    assert last.walls[BOTTOM].x == DofDrive(velocity=Interpolated((0.0, 1.0), (0.0, 0.5)))
    _, shear, last = SCENARIO.drives()
    assert shear.walls[TOP].y == last.walls[TOP].y == DofDrive(force=Constant(-0.015), damping=0.02)
    assert last.walls[TOP].x == shear.walls[TOP].x
    assert last.named_by == ((2, NEVER, NEVER, NEVER), (1, 0, NEVER, NEVER), (0, NEVER, 0, NEVER))
    assert SCENARIO.drives(("top", "paddle", "bottom"))[0].walls[0].y.force == Constant(-0.015)


def test_a_kept_signal_goes_on_and_knows_its_past():
    last = SCENARIO.drives()[2]
    starts = [0.0, 0.375, 0.5]
    walls = last.started(starts)
    assert walls[TOP].x == DofDrive(velocity=Shifted(Ramp(0.0, 0.1, 0.02), 0.125))
    assert walls[TOP].x.velocity.value(0.25) == Ramp(0.0, 0.1, 0.02).value(0.375)
    assert walls[PADDLE].spin.force.value(0.25) == Sine(0.0, 1e-6, 0.1).value(0.75)
    assert walls[TOP].y == last.walls[TOP].y
    assert walls[BOTTOM] == last.walls[BOTTOM]
    assert Shifted(Interpolated((0.0, 1.0), (0.0, 2.0)), 0.25).value(0.25) == pytest.approx(1.0)


def test_a_kept_signal_waits_while_a_stage_is_frozen():
    """Nothing moves then: a wall would leap afterwards. Its temperature goes on."""
    walls = replace(SCENARIO.drives()[2], frozen=(1,)).started([0.0, 0.375, 0.5])
    assert walls[PADDLE].spin.force == Shifted(Sine(0.0, 1e-6, 0.1, 0.0), 0.375)
    frozen = [stage.frozen for stage in parse_scenario(HEATED, "h.toml").loading]
    before = [stage.frozen for stage in parse_scenario(HEATED, "h.toml").drives()]
    assert any(frozen[:-1])
    assert before == [tuple(np.flatnonzero(frozen[:k])) for k in range(len(frozen))]


def test_only_kept_signals_that_vary_need_the_starts_of_stages():
    with pytest.raises(IndexError):
        SCENARIO.drives()[2].started([])
    constant = parse_scenario(
        SHEAR,
        "s.toml",
        ["loading.0.drives.paddle.spin.force=0", "loading.1.drives.top.x.velocity=1"],
    )
    assert constant.drives()[2].started([]) == list(constant.drives()[2].walls)


def test_naming_again_fixes_or_restarts():
    again = [
        "loading.2.drives.top={x={fixed=true}, y={velocity=0.5}}",
        "loading.1.drives.paddle={spin={velocity=2}}",
    ]
    stages = parse_scenario(SHEAR, "s.toml", again).drives()
    assert stages[2].walls[TOP] == WallDrive(y=DofDrive(velocity=Constant(0.5)))
    assert stages[1].walls[PADDLE].spin == DofDrive(velocity=Constant(2.0))
    assert stages[2].named_by[TOP] == (2, 2, NEVER, NEVER)


def test_a_surface_keeps_running_until_it_is_named_again():
    more = [
        "loading.0.drives.paddle.surface={velocity={sine={amplitude=0.1, period=0.2}}}",
        "loading.2.drives.top={surface={velocity=-1}}",
    ]
    stages = parse_scenario(SHEAR, "s.toml", more).drives()
    wave = Sine(0.0, 0.1, 0.2, 0.0)
    assert [stage.walls[PADDLE].surface for stage in stages] == [wave] * 3
    assert stages[0].started([0.0])[PADDLE].surface == wave
    assert stages[2].started([0.0, 0.7, 1.0])[PADDLE].surface == Shifted(wave, 1.0)
    assert stages[2].walls[TOP].surface == Constant(-1.0)
    assert stages[1].walls[TOP].surface is None
