"""info, verify, post profile, doctor: pure results on stdout, the right codes, quiet when a pipe closes."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import call, command, environment
from heat_run import GRAINS, RATES, write_heated_run
from typer.testing import CliRunner

from multicor_cli.cli.app import app
from multicor_cli.optional import LIBRARIES

runner = CliRunner()

PROMISED = {
    "status", "grain_count", "frame_count", "step", "time", "state_digest", "energy_closure", "heat_closure", "max_overlap",
    "solver",
}  # fmt: skip


def test_info_json_holds_what_is_promised(finished: Path) -> None:
    done = runner.invoke(app, ["info", str(finished), "--json"])
    assert done.exit_code == 0
    data = json.loads(done.stdout)
    assert data.keys() >= PROMISED
    assert data["solver"].keys() >= {"sweeps_mean", "residual_rms_max", "unconverged_steps"}
    assert data["status"] == "finished"
    assert data["grain_count"] == 60
    assert data["energy_closure"] <= 1e-10
    assert data["max_overlap"] <= 1e-3
    assert done.stderr == ""


def test_info_for_people(finished: Path) -> None:
    done = runner.invoke(app, ["info", str(finished)])
    assert done.exit_code == 0
    assert "finished" in done.stdout
    assert "settle, shear, on" in done.stdout
    assert "Hertz" in done.stdout


@pytest.mark.parametrize(
    "arguments", [["info"], ["verify"], ["post", "profile"], ["post", "theta-eta"], ["post", "map"], ["post", "forces"]]
)
def test_what_is_no_run_is_code_6(arguments: list[str], tmp_path: Path) -> None:
    done = runner.invoke(app, [*arguments, str(tmp_path)])
    assert done.exit_code == 6
    assert done.stderr.count("\n") == 1
    assert str(tmp_path) in done.stderr


def test_verify_finds_damage(finished: Path, tmp_path: Path) -> None:
    assert runner.invoke(app, ["verify", str(finished)]).exit_code == 0
    shutil.copytree(finished, tmp_path / "run")
    file = tmp_path / "run" / "results.h5"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    done = runner.invoke(app, ["verify", str(tmp_path / "run")])
    assert done.exit_code == 7
    assert "results.h5" in done.stdout
    report = json.loads(runner.invoke(app, ["verify", str(tmp_path / "run"), "--json"]).stdout)
    assert report["whole"] is False


def test_profile_json_csv_and_table_agree(finished: Path) -> None:
    base = ["post", "profile", str(finished), "--of", "velocity", "--bins", "4"]
    data = json.loads(runner.invoke(app, [*base, "--json"]).stdout)
    rows = list(csv.reader(runner.invoke(app, [*base, "--csv"]).stdout.splitlines()))
    assert rows[0] == ["y [m]", "velocity [m/s]", "standard error [m/s]", "area [m2]"]
    assert [float(row[0]) for row in rows[1:]] == data["y"]
    assert [float(row[1]) for row in rows[1:]] == data["value"]
    assert data["walls"] == ["bottom", "top"]
    table = runner.invoke(app, base)
    shown = [float(word) for word in re.findall(r"-?\d[\d.e+-]*", table.stdout)]  # as many decimals as its column shows
    assert any(number == pytest.approx(data["value"][2], rel=1e-3) for number in shown)
    assert "1 frame from t" in table.stderr


def test_profile_options(finished: Path) -> None:
    base = ["post", "profile", str(finished), "--json"]
    scaled = json.loads(runner.invoke(app, [*base, "--normalized"]).stdout)
    assert scaled == json.loads(runner.invoke(app, [*base, "--normalised"]).stdout)
    assert (scaled["unit"], scaled["y"][-1] < 1.0) == ("1", True)
    assert json.loads(runner.invoke(app, [*base, "--frames", "-3:"]).stdout)["frame_count"] == 3
    early = json.loads(runner.invoke(app, [*base, "--from", "0", "--to", "0.002"]).stdout)
    assert early["times"] == [0.0, 0.002]


@pytest.mark.parametrize(
    "arguments",
    [
        ["--json", "--csv"], ["--of", "wetness"], ["--frames", "3"], ["--frames", "a:b"], ["--frames", "1:2", "--to", "3"],
        ["--from", "1e9"], ["--plot", "figure.gif"], ["--bins", "0"],
    ],
)  # fmt: skip
def test_profile_refuses_what_makes_no_sense(arguments: list[str], finished: Path) -> None:
    done = runner.invoke(app, ["post", "profile", str(finished), *arguments])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert "internal error" not in done.stderr


@pytest.mark.parametrize("command", ["temperature", "heat", "theta-eta", "map"])
def test_run_without_heat_says_so(command: str, finished: Path) -> None:
    words = {"theta-eta": ["theta-eta"], "map": ["map"]}.get(command, ["profile", "--of", command])
    done = runner.invoke(app, ["post", *words, str(finished)])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "has no heat" in done.stderr
    assert "[heat]" in done.stderr


@pytest.mark.parametrize("of", ["velocity", "fluctuation", "spin"])
def test_map_table_json_csv_and_figure(of: str, finished: Path, tmp_path: Path) -> None:
    base = ["post", "map", str(finished), "--of", of, "--frame", "-2"]
    data = json.loads(runner.invoke(app, [*base, "--json"]).stdout)
    rows = list(csv.reader(runner.invoke(app, [*base, "--csv"]).stdout.splitlines()))
    assert rows[0][:4] == ["x [m]", "y [m]", "radius [m]", f"{of} [{data['unit']}]"]
    assert [float(row[3]) for row in rows[1:]] == data["value"]
    assert len(data["value"]) == 60
    done = runner.invoke(app, [*base, "--plot", str(tmp_path / "map.png")])
    assert "largest" in done.stdout
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_forces_table_json_csv_and_figure(finished: Path, tmp_path: Path) -> None:
    base = ["post", "forces", str(finished)]
    data = json.loads(runner.invoke(app, [*base, "--json"]).stdout)
    rows = list(csv.DictReader(runner.invoke(app, [*base, "--csv"]).stdout.splitlines()))
    normal = [float(row["normal force [N]"]) for row in rows]
    assert len(rows) == data["contacts"]
    assert max(normal) == data["normal_force_max"]
    assert data["normal_force_mean"] == pytest.approx(sum(normal) / len(normal))
    walls = sum(int(row["j"]) >= 60 for row in rows)
    assert (data["wall_contacts"], data["coordination"]) == (walls, pytest.approx((2 * len(rows) - walls) / 60))
    done = runner.invoke(app, [*base, "--plot", str(tmp_path / "forces.pdf")])
    assert "coordination number Z" in done.stdout
    assert (tmp_path / "forces.pdf").read_bytes().startswith(b"%PDF")


@pytest.fixture(scope="module")
def heated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("heated") / "run"
    write_heated_run(path)
    return path


def test_theta_eta_table_json_csv_and_figure(heated: Path, tmp_path: Path) -> None:
    """T = 300 + 20 y under a top wall at 320 K: θ = 1 − η."""
    base = ["post", "theta-eta", str(heated), "--wall", "top", "--bins", "5"]
    data = json.loads(runner.invoke(app, [*base, "--json"]).stdout)
    assert data["theta"] == pytest.approx([1.0 - eta for eta in data["eta"]])
    assert "grains" not in data
    grains = json.loads(runner.invoke(app, [*base, "--json", "--grains"]).stdout)["grains"]
    assert grains["theta"] == pytest.approx([1.0 - eta for eta in grains["eta"]])
    rows = list(csv.reader(runner.invoke(app, [*base, "--csv"]).stdout.splitlines()))
    assert rows[0] == ["eta [1]", "theta [1]", "standard deviation [1]", "min [1]", "max [1]", "count"]
    assert len(rows) == 6
    assert len(runner.invoke(app, [*base, "--csv", "--grains"]).stdout.splitlines()) == GRAINS + 1
    done = runner.invoke(app, [*base, "--plot", str(tmp_path / "theta.svg")])
    assert done.exit_code == 0
    assert "'top' at 320 K, T0 = 300 K, H = 1 m" in done.stderr
    assert (tmp_path / "theta.svg").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--wall"), (["--wall", "lid"], "no wall 'lid'"), (["--wall", "bottom"], "--reference"),
        (["--wall", "top", "--frame", "99"], "no frame 99"), (["--wall", "top", "--grains"], "--grains needs"),
        (["--wall", "top", "--height", "-1"], "positive"),
    ],
)  # fmt: skip
def test_theta_eta_refuses_what_makes_no_sense(arguments: list[str], message: str, heated: Path) -> None:
    done = runner.invoke(app, ["post", "theta-eta", str(heated), *arguments])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert message in done.stderr


def test_profiles_of_heat(heated: Path, tmp_path: Path) -> None:
    base = ["post", "profile", str(heated), "--frames", "1:", "--bins", "10", "--exclude-walls", "0", "--json"]
    heat = json.loads(runner.invoke(app, [*base, "--of", "heat"]).stdout)
    assert heat["value"] == pytest.approx((RATES / 0.4).tolist())
    temperature = json.loads(runner.invoke(app, [*base, "--of", "temperature", "--normalized"]).stdout)
    assert temperature["value"] == pytest.approx(temperature["y"])
    done = runner.invoke(app, [*base[:-1], "--of", "heat", "--plot", str(tmp_path / "heat.svg")])
    assert done.exit_code == 0
    assert "W/m²" in (tmp_path / "heat.svg").read_text()


def test_info_of_heat(heated: Path) -> None:
    done = runner.invoke(app, ["info", str(heated)])
    assert "heat closure" in done.stdout
    assert "1e-15" in done.stdout
    assert "313 K on average, 301 to 319 K" in done.stdout
    assert re.search(r"warning +largest Biot number +0.23 ", done.stdout)
    data = json.loads(runner.invoke(app, ["info", str(heated), "--json"]).stdout)
    assert data["heat_closure"] == 1e-15
    assert data["heat"]["max_biot"] == 0.23
    assert data["heat"]["solid_gas_max"] is None


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_profile_draws(suffix: str, finished: Path, tmp_path: Path) -> None:
    figure = tmp_path / f"profile.{suffix}"
    done = runner.invoke(app, ["post", "profile", str(finished), "--plot", str(figure)])
    assert done.exit_code == 0, done.stderr
    head = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    assert figure.read_bytes().startswith(head)


def test_the_directory_of_a_figure_is_made(finished: Path, tmp_path: Path) -> None:
    done = runner.invoke(app, ["post", "profile", str(finished), "--plot", str(tmp_path / "new" / "p.png")])
    assert done.exit_code == 0, done.stderr
    assert (tmp_path / "new" / "p.png").is_file()


def test_figure_that_cannot_be_written_is_code_5(finished: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    done = runner.invoke(app, ["post", "profile", str(finished), "--plot", str(tmp_path / "file" / "p.png")])
    assert done.exit_code == 5
    assert done.stderr.count("\n") == 1 or "frames from" in done.stderr


@pytest.mark.parametrize(
    "arguments", [["schema"], ["info", "DIR", "--json"], ["post", "profile", "DIR", "--csv", "--bins", "5000"]]
)
def test_closed_pipe_is_quiet(arguments: list[str], finished: Path) -> None:
    """As in ``multicor … | true``, with nobody reading from the start."""
    words = [str(finished) if word == "DIR" else word for word in arguments]
    process = subprocess.Popen(
        command(*words), env=environment(PYTHONUNBUFFERED="1"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.close()
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0
    assert errors == ""


def test_closed_stderr_does_not_stop_a_run(finished: Path) -> None:
    process = subprocess.Popen(
        command("run", "small.toml", "-o", "full"), cwd=finished.parent, env=environment(), stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    process.stderr.close()
    assert process.wait(timeout=60) == 0


def test_no_color_and_no_escapes_off_a_terminal(finished: Path) -> None:
    done = call("post", "profile", finished, cwd=finished.parent)
    assert "\x1b" not in done.stdout + done.stderr


def test_doctor_describes_the_installation() -> None:
    done = runner.invoke(app, ["doctor", "--json"])
    assert done.exit_code == 0
    data = json.loads(done.stdout)
    assert data.keys() >= {"multicor", "python", "numpy", "numba", "h5py", "hdf5", "threading layer", "kernel cache", "cores"}
    assert data.keys() >= {each.name for each in LIBRARIES.values()}


@pytest.mark.parametrize(
    ("variables", "said"),
    [
        (
            {"NUMBA_THREADING_LAYER": "abacus"},
            "none: NUMBA_THREADING_LAYER=abacus: Numba has no such threading layer here; unset it",
        ),
        ({"NUMBA_THREADING_LAYER_PRIORITY": "abacus"}, "none: NUMBA_THREADING_LAYER_PRIORITY=abacus: Numba has no such"),
        ({"NUMBA_DISABLE_JIT": "1"}, "none: nothing is compiled, as NUMBA_DISABLE_JIT is set"),
        ({"NUMBA_THREADING_LAYER": "workqueue"}, "workqueue, "),
        ({"NUMBA_NUM_THREADS": "3"}, ", 3 threads"),
    ],
)
def test_doctor_says_in_a_sentence_why_there_is_no_threading_layer(variables: dict[str, str], said: str, tmp_path: Path) -> None:
    done = call("doctor", cwd=tmp_path, **variables)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("threading layer")]
    assert said in line
    assert all(re.match(r"\S+( \S+)?  +\S", each) for each in done.stdout.splitlines())  # nothing but names and values
