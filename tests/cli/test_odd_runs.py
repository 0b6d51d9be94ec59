"""Every command that reads a run, on runs with hardly anything in them: a table or a message, never a crash."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from scene_parts import between_planes
from scenes import changed

from multicor_cli.cli.post_commands import COMMANDS
from multicor_cli.model import State, Thermal
from multicor_cli.post import MAPPED, PROFILED
from multicor_cli.running.outcome import ExitCode
from multicor_cli.store import Moment, RunDirectory, open_run

FEW = """\
[scenario]
name = "few"
seed = 1
[domain]
size = [1.0, 1.0]
periodic = true
[materials.stone]
density = 2500.0
conductivity = 1.0
heat_capacity = 800.0
young = 70e9
poisson = 0.22
[[contacts]]
pair = ["*", "*"]
friction = 0.3
[[particles]]
name = "grains"
material = "stone"
shape = "sphere"
sizes = { kind = "list", radii = [0.01] }
count = COUNT
packing = { kind = "deposited" }
[[walls]]
name = "floor"
material = "stone"
geometry = { kind = "plane", point = [0, 0], normal = [0, 1] }
thermal = { temperature = 400.0 }
[[walls]]
name = "lid"
material = "stone"
geometry = { kind = "plane", point = [0, 0.2], normal = [0, -1] }
[heat]
temperature = 300.0
[[loading]]
duration = 4e-3
drives.lid = { x = { velocity = 0.1 } }
[solver]
dt = 1e-3
[output]
frame_interval = 1e-3
"""
"""To be run: so many grains on a warm floor, and a lid that moves above them."""

WAITING = changed(FEW, ('packing = { kind = "deposited" }', "release = { rate = 500.0, start = START, region = REGION }"))
REGION = "{ min = [0.4, 0.1], max = [0.6, 0.15] }"
"""Grains that are not there at first."""

OUTLET = '\n[[outlets]]\nname = "out"\nregion = { min = [0.0, -0.1], max = [1.0, 0.19] }\n'
"""Whoever is there leaves before the first step."""

COLD = changed(FEW, ("COUNT", "2"), ("temperature = 400.0", "temperature = 300.0"))

SCENARIOS = {
    "one grain": changed(FEW, ("COUNT", "1")),
    "none yet": changed(WAITING, ("COUNT", "5"), ("START", "100.0"), ("REGION", REGION)),
    "none at first": changed(WAITING, ("COUNT", "5"), ("START", "2e-3"), ("REGION", REGION)),
    "none any more": changed(FEW, ("COUNT", "2")) + OUTLET,
    "two grains, everything cold": COLD,
}


def write_by_hand(path: Path, places: list[tuple[float, float]], frames: int) -> None:
    """A run of grains at these places that nothing happens to."""
    model = between_planes([0.1] * len(places))
    n = len(places)
    model = replace(model, thermal=Thermal(np.ones(n), np.full(n, 300.0), np.ones(n)))
    state = State.at_rest(model, np.array(places, float).reshape(-1, 2))
    with RunDirectory.create(path, "", "", {"seed": 1}, stages=("only",)) as run:
        writer = run.writer(model)
        for _ in range(frames):
            writer.frame(Moment(state, model, None))
            writer.series_row(Moment(state, model))
            state.step, state.time, state.last_dt = state.step + 1, state.time + 0.5, 0.5
        run.checkpoint(state, writer)
        run.finish("finished")


BY_HAND = {
    "no frame": ([(1.0, 0.1), (2.0, 0.1)], 0),
    "one frame": ([(1.0, 0.1), (2.0, 0.1)], 1),
    "all in one place": ([(1.0, 0.5)] * 4, 3),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The odd runs by name."""
    folder = tmp_path_factory.mktemp("odd")
    for name, scenario in SCENARIOS.items():
        file = folder / f"{name.replace(' ', '-')}.toml"
        file.write_text(scenario)
        done = call("run", file.name, "-o", name, cwd=folder)
        assert done.returncode == 0, done.stderr
    for name, (places, frames) in BY_HAND.items():
        write_by_hand(folder / name, places, frames)
    return {name: folder / name for name in (*SCENARIOS, *BY_HAND)}


REGION_SEEN = "{ min = [0.3, 0.0], max = [0.7, 0.2] }"
LINE = "0.1,0.01:0.9,0.01"

VARIANTS = {
    "profile": [*(["--of", name] for name in PROFILED), ["--normalized"], ["--bins", "3"], ["--frames", ":"]],
    "map": [*(["--of", name] for name in MAPPED), ["--frame", "0"]],
    "theta-eta": [[], ["--wall", "floor"], ["--frame", "0"], ["--frames", ":"]],
    "forces": [[], ["--frame", "0"]],
    "rheology": [[], ["--margin", "0", "--frames", ":"]],
    "region": [["--in", REGION_SEEN], ["--in", "{ min = [0.0, 0.15], max = [0.1, 0.2] }", "--frames", ":"]],
    "fields": [
        [], ["--frames", ":"], ["--reach", "1e-9"], ["--reach", "0.01"], ["--reach", "1e-300"], ["--spacing", "1e9"],
        ["--line", LINE], ["--center", "0.5,0.1"], ["--center", "0.5,0.1", "--radial"], ["--center", "1e300,0"],
    ],
    "energy": [[], ["--from", "1e9"]],
    "compare": [["SELF"]],
    "series": [[], ["--of", "kinetic"]],
    "flow": [["--line", LINE], ["--line", LINE, "--frames", ":"]],
    "animate": [["-o", "film.gif", "--overwrite"]],
}  # fmt: skip
"""Options that change what a command of ``post`` computes."""

OTHERS = [
    ["info"], ["info", "--json"], ["verify"], ["report", "-o", "report.html", "--overwrite"],
    ["export", "gsd", "-o", "run.gsd", "--overwrite"], ["export", "csv", "-o", "csv", "--overwrite"],
    ["export", "fclib", "-o", "run.hdf5", "--overwrite"],
]  # fmt: skip


DRAWN = ("one grain", "none at first", "all in one place")
"""Of these runs every quantity is shown and every figure drawn."""


def commands(run: Path) -> Iterator[list[str]]:
    """Every command that reads, in every form of its output, and with what changes what it computes."""
    assert VARIANTS.keys() == COMMANDS.keys()
    is_drawn = run.name in DRAWN
    forms = [["--json"], ["--csv"], ["--plot", "term"], ["--plot", "figure.png", "--overwrite"]]
    forms = forms if is_drawn else forms[:1]
    for name, all_variants in VARIANTS.items():
        variants = [k for k in all_variants if is_drawn or k is all_variants[0] or "--of" not in k]
        for options in [*variants, *(variants[0] + form for form in forms if name != "animate")]:
            yield ["post", name, str(run), *(str(run) if word == "SELF" else word for word in options)]
    for words in OTHERS:
        place = 2 if words[0] == "export" else 1
        yield [*words[:place], str(run), *words[place:]]


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", [*SCENARIOS, *BY_HAND])
def test_a_reading_command_gives_a_table_or_a_message(runs: dict[str, Path], name: str, tmp_path: Path) -> None:
    for words in commands(runs[name]):
        done = call(*words, cwd=tmp_path)
        said = f"{words}: {done.returncode}\n{done.stderr}"
        assert done.returncode != ExitCode.BUG, said
        if done.returncode != ExitCode.DONE:
            assert (done.stdout, bool(done.stderr.strip())) == ("", True), said
        elif "--json" in words:
            json.loads(done.stdout)


@pytest.mark.parametrize("words", [["post", "map"], ["post", "forces"], ["post", "profile"], ["post", "fields"]])
def test_where_no_grain_is_a_command_says_so(runs: dict[str, Path], words: list[str], tmp_path: Path) -> None:
    done = call(*words, runs["none yet"], cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "no grain is there in frame" in done.stderr


def test_a_film_shows_frames_without_grains(runs: dict[str, Path], tmp_path: Path) -> None:
    done = call("post", "animate", runs["none at first"], "-o", "film.gif", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"{len(open_run(runs['none at first']).frames.time)} frames" in done.stderr
    done = call("post", "animate", runs["none yet"], "-o", "none.gif", cwd=tmp_path)
    assert done.returncode == 2
    assert "no grain is there" in done.stderr
