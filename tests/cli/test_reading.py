"""info, verify, post profile, doctor: pure results on stdout, the right codes, quiet when a pipe closes."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from pathlib import Path

import pytest
from small_run import call, command, environment
from typer.testing import CliRunner

from multicor_cli.cli.app import app

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


@pytest.mark.parametrize("arguments", [["info"], ["verify"], ["post", "profile"]])
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
    assert f"{data['value'][2]:.5g}" in table.stdout
    assert "frames from t" in table.stderr


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
        ["--json", "--csv"], ["--of", "temperature"], ["--frames", "3"], ["--frames", "a:b"], ["--frames", "1:2", "--to", "3"],
        ["--from", "1e9"], ["--plot", "figure.gif"], ["--bins", "0"],
    ],
)  # fmt: skip
def test_profile_refuses_what_makes_no_sense(arguments: list[str], finished: Path) -> None:
    done = runner.invoke(app, ["post", "profile", str(finished), *arguments])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert "internal error" not in done.stderr


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_profile_draws(suffix: str, finished: Path, tmp_path: Path) -> None:
    figure = tmp_path / f"profile.{suffix}"
    done = runner.invoke(app, ["post", "profile", str(finished), "--plot", str(figure)])
    assert done.exit_code == 0, done.stderr
    head = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    assert figure.read_bytes().startswith(head)


def test_figure_that_cannot_be_written_is_code_5(finished: Path, tmp_path: Path) -> None:
    done = runner.invoke(app, ["post", "profile", str(finished), "--plot", str(tmp_path / "no" / "p.png")])
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
