"""How stages end: with durations that are no whole number of steps, and with conditions that
nothing ever comes up to."""

import math

import numpy as np
import pytest
from run_fakes import in_pieces
from scenarios import digests, plane, scenario

import multicor_cli as multicor
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.outcome import StageTimeout

DT = 1e-3


def scene(stages, *overrides, grain=(0.5, 0.01, 0.01), gravity=-9.81, **more):
    walls = {"floor": plane(), "lid": {"geometry": plane(0.1, -1), "mass": 1.0}}
    said = {
        "grains": [grain], "size": [1.0, 1.0], "gravity": [0.0, gravity], "dt": DT,
        "frame_interval": 0.01,
    } | more  # fmt: skip
    return scenario(stages, walls=walls, overrides=overrides, **said)


def stage(duration, more=""):
    return f"[[loading]]\nduration = {duration!r}\n{more}\n"


SHAKEN = "drives.lid = { x = { velocity = { sine = { amplitude = 0.02, period = 0.06 } } } }"


@pytest.mark.parametrize(("duration", "steps", "last"), [
    (1.5, 2, 0.5), (12.3, 13, 0.3), (12.05, 12, 1.05), (12.99, 13, 0.99), (1.02, 1, 1.02),
    (12.0, 12, 1.0),
])  # fmt: skip
def test_a_stage_lasts_for_its_duration(duration, steps, last, tmp_path):
    """To the bit, in frames, rows and what is said; a signal that goes on in the next stage is
    where it should be."""
    given = scene(stage(duration * DT, SHAKEN) + stage(10.6 * DT))
    outcome = multicor.run(given, tmp_path / "run")
    assert outcome.stage_ends[0].why == f"its duration of {duration * DT:.6g} s was over"
    with multicor.open_run(outcome.directory) as run:
        first = [frame for frame in run.frames if frame.stage == 0][-1]
        assert (first.step, first.time) == (steps, duration * DT)
        assert first.dt == pytest.approx(last * DT, rel=1e-9)
        assert max(run.frames.column("steps/dt")) <= 1.1 * DT
        assert outcome.time == pytest.approx((duration + 10.6) * DT, rel=1e-15)
        assert math.fsum(run.series["window_duration"]) == pytest.approx(outcome.time, rel=1e-12)
        omega = 2.0 * math.pi / 0.06
        for frame in run.frames:
            way = 0.02 / omega * (1.0 - math.cos(omega * frame.time))
            assert frame.wall_position[1, 0] == pytest.approx(
                way, abs=0.02 / omega * (omega * DT) ** 2 / 6.0
            )


def test_a_run_that_is_cut_anywhere_gives_the_same_bits(tmp_path):
    stages = (
        stage(3.5 * DT, SHAKEN)
        + stage(2.3 * DT, "frozen = false")
        + stage(4.7 * DT, SHAKEN.replace("0.06", "0.05"))
    )
    whole = multicor.run(scene(stages), tmp_path / "whole")
    assert whole.step == 4 + 3 + 5
    for step in (1, 3, 4, 5, 7, 8, 11):
        assert in_pieces(scene(stages), tmp_path / f"cut-{step}", step) == digests(whole.directory)


def test_stages_that_are_added_go_on_from_a_cut_step(tmp_path):
    first, second = stage(3.5 * DT, SHAKEN), stage(2.3 * DT)
    multicor.run(scene(first), tmp_path / "pieces")
    whole = in_pieces(scene(first + second), tmp_path / "whole")
    assert in_pieces(scene(first + second), tmp_path / "pieces", extend=True) == whole


@pytest.mark.parametrize("dt", ["auto", "1e-3"])
def test_a_stage_that_has_timed_out_after_a_cut_step_is_over(dt, tmp_path):
    """Its last step must not be taken for its time step."""
    until = "until = { displacement = { wall = 'lid', axis = 'x', above = 1.0 } }\n" + SHAKEN
    stages = stage(10.37e-3, until) + stage(2.3 * DT)
    late = [f"solver.dt={dt}", 'loading.0.on_timeout="stop"']
    with pytest.raises(StageTimeout):
        multicor.run(scene(stages, *late), tmp_path / "pieces")
    whole = in_pieces(scene(stages, late[0]), tmp_path / "whole")
    assert in_pieces(scene(stages, late[0]), tmp_path / "pieces") == whole


@pytest.mark.parametrize("every", [2.5, 3.3, 1.5, 4.0])
def test_frames_and_rows_come_when_they_are_wanted(every, tmp_path):
    """Within half a step, however long the stage."""
    wanted = [
        f"output.frame_interval={2.0 * every * DT!r}",
        f"output.series_interval={every * DT!r}",
    ]
    with multicor.open_run(
        multicor.run(scene(stage(0.2), *wanted), tmp_path / "run").directory
    ) as run:
        for times, interval in ((run.frames.time, 2.0 * every), (run.series["time"], every)):
            here = np.asarray(times)[1:-1] / DT
            assert np.abs(here - interval * np.arange(1, here.size + 1)).max() <= 0.5 + 1e-9
            assert here.size == pytest.approx(200.0 / interval, abs=2)


def test_what_is_said_before_a_run(tmp_path):
    given = scene(stage(1.5 * DT))
    plan = make_plan(given, build(given)[0])
    assert plan.stages[0].length == 1.5 * DT
    assert [plan.stages[0].step_after(k) for k in range(2)] == [DT, 0.5 * DT]


PUSH = (
    "drives.lid = { y = { velocity = { times = [0.0, 0.05, 0.051], values = [-1.0, -1.0, 0.0] } } }"
)
COMING = "drives.lid = { y = { velocity = -1.0 } }"
AWAY = (0.5, 0.05, 0.01)
ENDS = {
    "rest": (0.02, "until = { kinetic_energy_ratio = 1e-300 }\n" + COMING, (0.5, 0.01, 0.01),
        "condition", 0.02, "was 0"),
    "rest without gravity": (0.02, "until = { kinetic_energy_ratio = 0.5 }", AWAY, "condition",
        0.02, "was 0"),
    "rest that comes later": (0.2, "until = { kinetic_energy_ratio = 1e-6 }\n" + PUSH, AWAY,
        "condition", 0.08, ""),
    "steady": (
        0.1, "until = { steady = { of = 'kinetic_energy', window = 0.02, tolerance = 0.05 } }",
        AWAY, "condition", 0.1, "was 0",
    ),
    "friction of nothing": (
        0.1,
        ("until = { steady = { of = 'friction', wall = 'lid', axis = 'x', window = 0.02, "
            "tolerance = 0.05 } }"),
        AWAY,
        "timeout",
        0.1,
        "(no window was over in which there was a force) never had a value",
    ),
    "force of nothing": (
        0.1, "until = { force = { wall = 'lid', axis = 'y', above = 1.0, window = 0.02 } }", AWAY,
        "timeout", 0.1, "was 0 N",
    ),
    "window as long as the stage": (
        0.0115, "until = { force = { wall = 'lid', axis = 'y', above = 1, window = 0.0115 } }",
        AWAY, "timeout", 0.0115, "was 0 N",
    ),
    "walls at one place": (
        0.02,
        ("until = { axial_strain = { walls = ['floor', 'lid'], axis = 'x', below = -0.1 } }\n"
            "drives.lid.x = { velocity = 0.1 }"),
        AWAY,
        "timeout",
        0.02,
        "(they were at the same place when the stage began) never had a value",
    ),
}  # fmt: skip
"""Duration, stage, grain, how it ends and when, and what is said."""


@pytest.mark.parametrize("case", ENDS)
def test_ends_of_stages_in_which_nothing_happens(case, tmp_path):
    duration, keys, grain, reason, at, said = ENDS[case]
    gravity = -9.81 if case == "rest" else 0.0
    outcome = multicor.run(
        scene(stage(duration, keys), grain=grain, gravity=gravity), tmp_path / "run"
    )
    (end,) = outcome.stage_ends
    assert end.reason == reason
    assert end.duration == pytest.approx(at, abs=0.01 if case == "rest that comes later" else 1e-12)
    assert said in end.text


def test_nothing_is_at_rest_before_it_has_come(tmp_path):
    """A grain that is let in later has not been at rest before."""
    particles = {"sizes": {"kind": "uniform", "min": 0.01, "max": 0.01}, "count": 1}
    particles["release"] = {
        "rate": 100.0,
        "start": 0.02,
        "region": {"min": [0.4, 0.03], "max": [0.6, 0.06]},
    }
    stages = stage(1.0, "until = { kinetic_energy_ratio = 1e-6 }")
    given = scene(stages, grains=None, particles=[particles])
    (end,) = multicor.run(given, tmp_path / "run").stage_ends
    assert end.reason == "condition"
    assert 0.05 < end.time < 0.5
