"""What ends a stage, by scenes whose end is known in closed form; what happens when it does not;
and who is told."""

import json
import math
from dataclasses import asdict

import pytest
from command_line import read_info
from run_fakes import in_pieces
from scenarios import digests
from scenes import ONE, changed

from multicor_cli import run as run_scenario
from multicor_cli.running.outcome import StageTimeout
from multicor_cli.store import StorageFull, run_info
from multicor_cli.store import checkpoint as checkpoint_module
from multicor_cli.store import rundir as rundir_module

MASS = 2500.0 * math.pi * 1e-4 * 1e-3
HEAVIER = "gravity = [0.0, { ramp = [0.0, -10.0], duration = 1.0 }]"
"""The floor carries m·10t; the mean over the window that ends at kT is m·10 (k − 1/2) T."""


def write(folder, stage):
    path = folder / "one.toml"
    path.write_text(ONE.replace("STAGE", stage))
    return path


def run_one(folder, stage):
    return run_scenario(write(folder, stage), folder / "run")


def until(kind, **keys):
    words = ", ".join(f"{key} = {value}" for key, value in keys.items())
    return f"until = {{ {kind} = {{ {words} }} }}\n"


def of_wall(kind, wall, axis, **keys):
    return until(kind, wall=f'"{wall}"', axis=f'"{axis}"', **keys)


ENDS = {
    # A wall at rest is told v: it has moved v Δt (n − 1/2) after n steps. 0.05 m/s for 0.2 s out of
    # 0.1 m: 10 % nearer.
    "axial strain": (
        until("axial_strain", walls='["floor", "lid"]', below=-0.1)
        + "drives.lid = { y = { velocity = -0.05 } }",
        201, -0.10025,
    ),
    "the first wall moves": (
        until("axial_strain", walls='["lid", "floor"]', above=0.25)
        + "drives.floor = { y = { velocity = -0.1 } }",
        251, 0.2505,
    ),
    # x = v t²/(2 T) on a ramp to v in T: 0.2 · 0.3²/(2 · 0.5) = 0.018 m
    "displacement": (
        of_wall("displacement", "lid", "x", above=0.018)
        + "drives.lid = { x = { velocity = { ramp = [0.0, 0.2], duration = 0.5 } } }",
        300, 0.018,
    ),
    "angle": (
        of_wall("displacement", "lid", "spin", below=-0.02)
        + "drives.lid = { spin = { velocity = -0.1 } }",
        201, -0.02005,
    ),
    # reached by the window that ends at 8 · 0.02 s: (8 − 1/2) · 0.02 · 10 = 1.5 m/s²
    "force": (
        of_wall("force", "floor", "y", below=-1.45 * MASS, window=0.02) + HEAVIER,
        160, -1.5 * MASS,
    ),
    "stress": (
        of_wall("stress", "floor", "y", below=-14.5 * MASS, window=0.02) + HEAVIER,
        160, -15.0 * MASS,
    ),
}  # fmt: skip
"""The stage, the step after which it ends, and the value then."""


@pytest.mark.parametrize("name", ENDS)
def test_stages_end_when_they_are_to(name, tmp_path):
    stage, steps, value = ENDS[name]
    outcome = run_one(tmp_path, stage)
    first, second = outcome.stage_ends
    assert (first.reason, first.step) == ("condition", steps)
    assert first.time == first.duration == pytest.approx(steps * 1e-3)
    # Forces are as exact as the solver's tolerances, places as rounding.
    assert first.value == pytest.approx(value, rel=1e-2 if name in ("force", "stress") else 1e-9)
    assert (second.reason, second.step) == ("duration", steps + 10)
    assert second.value is second.goal is None


@pytest.mark.parametrize("name", ["axial strain", "displacement", "force"])
def test_a_stage_that_was_stopped_ends_as_if_it_was_not(name, tmp_path):
    """Stopped in the middle of a window, whose sum the checkpoint holds."""
    path = write(tmp_path, ENDS[name][0])
    assert in_pieces(path, tmp_path / "run", 133) == in_pieces(path, tmp_path / "whole")
    assert run_info(tmp_path / "run")["stage_ends"] == run_info(tmp_path / "whole")["stage_ends"]


LATE = of_wall("displacement", "lid", "y", below=-0.09) + "drives.lid = { y = { velocity = -0.1 } }"
GO_ON = "run one.toml --set 'loading.0.on_timeout=go on' -o"


def test_a_timeout_goes_on_and_is_told(typed, tmp_path):
    write(tmp_path, LATE)
    (warning,) = typed("run one.toml -o run --quiet").stderr.splitlines()
    for word in (
        "warning", "first", "timed out after 0.5 s", "displacement in y of lid", "-0.04995 m",
        "at most -0.09 m", "longer",
    ):  # fmt: skip
        assert word in warning
    ends = read_info(tmp_path / "run")["stage_ends"]
    assert [(end["name"], end["reason"], end["step"]) for end in ends] == [
        ("first", "timeout", 500),
        ("second", "duration", 510),
    ]
    assert "timed out" in typed("info run").stdout
    again = typed("run one.toml -o run").stderr
    assert "stage first: t = 0.5 s, step 500: timed out" in again
    assert "stage second: t = 0.51 s, step 510: its duration of 0.01 s was over" in again


@pytest.mark.parametrize("late", ["go on", "stop"])
def test_an_end_that_was_lost_is_not_told(late, typed, tmp_path, monkeypatch):
    """The disk is full when the checkpoint behind it is due: it will come once more."""
    path, written = write(tmp_path, LATE + f'\non_timeout = "{late}"'), 0

    def write_checkpoint(*args, **kwargs):
        nonlocal written
        written += 1
        if written > 1:  # that of the beginning
            raise StorageFull(args[0])
        return checkpoint_module.write_checkpoint(*args, **kwargs)

    with monkeypatch.context() as patched:
        patched.setattr(rundir_module, "write_checkpoint", write_checkpoint)
        with pytest.raises(StorageFull):
            run_scenario(path, tmp_path / "run")
    info = read_info(tmp_path / "run")
    assert (info["status"], info["exit_code"], info["step"]) == ("failed", 5, 0)
    assert info["stage_ends"] == []
    told = typed("info run").stdout
    assert "no space left" in told
    assert "timed out" not in told
    typed(f"{GO_ON} run")
    ends = read_info(tmp_path / "run")["stage_ends"]
    assert [end["reason"] for end in ends] == ["timeout", "duration"]


def test_a_timeout_may_stop_the_run(typed, tmp_path):
    """It stays where it is until it is told to go on, and then ends as a run that was never
    stopped."""
    path = write(tmp_path, LATE + '\non_timeout = "stop"')
    for _ in range(2):
        said = typed("run one.toml -o run", 4).stderr
        assert "stage first: t = 0.5 s, step 500: timed out" in said
        assert "--set 'loading.0.on_timeout=go on'" in said
        info = read_info(tmp_path / "run")
        assert (info["status"], info["exit_code"]) == ("failed", 4)
        assert (info["step"], info["stage"]) == (500, 0)
        assert [end["reason"] for end in info["stage_ends"]] == ["timeout"]
    with pytest.raises(StageTimeout, match="timed out"):
        run_scenario(path, tmp_path / "run")
    ends = []
    for name in ("run", "whole"):
        typed(f"{GO_ON} {name}")
        ends.append((digests(tmp_path / name), read_info(tmp_path / name)["stage_ends"]))
    assert ends[0] == ends[1]


def test_a_last_stage_that_timed_out_is_finished_by_going_on(tmp_path):
    path = write(tmp_path, LATE + '\non_timeout = "stop"')
    last = '[[loading]]\nname = "second"\nduration = 0.01\n'
    path.write_text(changed(path.read_text(), (last, "")))
    with pytest.raises(StageTimeout):
        run_scenario(path, tmp_path / "run")
    for name in ("run", "whole"):
        going_on = {"overrides": ["loading.0.on_timeout=go on"]}
        assert run_scenario(path, tmp_path / name, **going_on).is_finished
    assert digests(tmp_path / "run")[0] == digests(tmp_path / "whole")[0]


def test_results_alone_know_how_stages_ended(tmp_path):
    outcome = run_one(tmp_path, LATE)
    (tmp_path / "run" / "results.h5").rename(tmp_path / "mailed.h5")
    ends = run_info(tmp_path / "mailed.h5")["stage_ends"]
    assert ends == [asdict(end) for end in outcome.stage_ends]
    assert json.loads((tmp_path / "run" / "run.json").read_text())["stage_ends"] == ends
