"""The first row of the time series tells the start as it is, in runs that begin, that go on, and
that are taken up."""

import numpy as np
import pytest
from run_fakes import in_pieces
from scenes import ONE, changed

from multicor_cli import open_run, post
from multicor_cli import run as run_scenario
from multicor_cli.checks import Verdict, check_run
from multicor_cli.scenario import parse_scenario
from multicor_cli.store import run_info

MOVING = changed(
    ONE,
    ("size = [0.1, 0.1]", "size = [0.1, 0.1]\ngravity = [0.0, 0.0]"),
    ("count = 1", "count = 6\nvelocity = [0.2, 0.1]\nspin = 5.0"),
    ('{ kind = "deposited" }', '{ kind = "random" }'),
    ("duration = 0.5", "duration = 0.05"),
    ("STAGE", ""),
    ("frame_interval = 0.1", "frame_interval = 0.01"),
)  # fmt: skip
HEATED = changed(MOVING, (
    "density = 2500.0",
    "density = 2500.0\nheat_capacity = 800.0\nyoung = 70e9\npoisson = 0.2\nconductivity = 1.0",
), ("[solver]", "[heat]\ntemperature = 310.0\n[solver]"))  # fmt: skip
FROZEN = changed(
    HEATED,
    ("temperature = 310.0", 'temperature = 310.0\nconduction = "none"'),
    ("duration = 0.05", "duration = 0.05\nfrozen = true\ndt = 0.01"),
)


def kinetic(model, velocity, spin):
    grains = model.grains
    return float(
        (0.5 * grains.mass * (velocity**2).sum(axis=1) + 0.5 * grains.inertia * spin**2).sum()
    )


def text_of(case):
    return {"moving": MOVING, "heated": HEATED, "frozen at first": FROZEN}[case]


@pytest.mark.parametrize("case", ["moving", "heated", "frozen at first"])
def test_the_first_row_of_a_new_run(case, tmp_path):
    run_scenario(parse_scenario(text_of(case), "one.toml"), tmp_path / "run")
    with open_run(tmp_path / "run") as run:
        first = {name: run.series[name][0] for name in run.series}
        expected = kinetic(run.model, run.frames[0].velocity, run.frames[0].spin)
        assert expected > 0.0
        assert (
            first["kinetic"]
            == first["kinetic_start"]
            == run.series["kinetic_start"][-1]
            == pytest.approx(expected, rel=1e-14)
        )
        assert first["time"] == first["window_duration"] == first["imbalance"] == 0.0
        if case != "moving":
            assert (
                first["temperature_mean"]
                == first["temperature_min"]
                == first["temperature_max"]
                == 310.0
            )
        table = post.series(run, ["kinetic"], start=0.0)
        smallest = table.rows[0][table.headings.index("smallest")]
        assert smallest == run.series["kinetic"].min() > 0.0
    assert run_info(tmp_path / "run")["energy_closure"] < 1e-12
    assert {
        check.name for check in check_run(tmp_path / "run") if check.verdict is Verdict.BAD
    } <= {"negative losses"}


def test_the_first_row_of_a_run_that_goes_on_from_another(tmp_path):
    """With a wall that a load moves: its kinetic energy is that of the last row of the run
    before."""
    loaded = changed(MOVING, ('name = "lid"\n', 'name = "lid"\nmass = 0.1\n'))
    drives = "drives.lid = { y = { force = -0.4 } }\n"
    before = changed(
        loaded, ('[[loading]]\nname = "second"\n', drives + '[[loading]]\nname = "second"\n')
    )
    run_scenario(parse_scenario(before, "one.toml"), tmp_path / "before")
    group = loaded[loaded.index("[[particles]]") : loaded.index("[[walls]]")]
    second = changed(loaded, (group, '[start]\nrun = "before"\n'))
    second = changed(
        second, ('[[loading]]\nname = "second"\n', drives + '[[loading]]\nname = "second"\n')
    )
    run_scenario(parse_scenario(second, tmp_path / "next.toml"), tmp_path / "next")
    with open_run(tmp_path / "before") as a, open_run(tmp_path / "next") as b:
        wall = 0.5 * 0.1 * float(b.frames[0].wall_velocity[1, 1]) ** 2
        assert wall > 0.1 * a.series["kinetic"][-1]
        assert b.series["kinetic"][0] == pytest.approx(a.series["kinetic"][-1], rel=1e-14)
        assert np.all(b.series["kinetic_start"] == b.series["kinetic"][0])
    assert run_info(tmp_path / "next")["energy_closure"] < 1e-12


@pytest.mark.parametrize(
    ("case", "step"),
    [("moving", 1), ("moving", 20), ("frozen at first", 1), ("frozen at first", 12)],
)
def test_a_run_in_pieces_has_the_same_rows(case, step, tmp_path):
    scenario = parse_scenario(text_of(case), "one.toml")
    assert in_pieces(scenario, tmp_path / "pieces", step) == in_pieces(scenario, tmp_path / "whole")
