"""info, verify, doctor and post: pure results on stdout in three forms, figures, and quiet when a
pipe closes."""

import csv
import json
import re
import shutil
import subprocess

import pytest
from command_line import call, command, environment
from heat_run import GRAINS, RATES, write_heated_run

from multicor_cli.optional import LIBRARIES
from multicor_cli.store import RunDirectory

HEADS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


@pytest.fixture
def read(typed):
    """What a command prints as JSON."""
    return lambda line: json.loads(typed(f"{line} --json").stdout)


@pytest.fixture
def outputs(typed, read, tmp_path):
    """JSON, rows of CSV and text of a command, which draws a figure too."""

    def outputs(line, suffix="png"):
        done = typed(f"{line} --plot figure.{suffix}")
        assert (tmp_path / f"figure.{suffix}").read_bytes().startswith(HEADS[suffix])
        return (
            read(line),
            list(csv.DictReader(typed(f"{line} --csv").stdout.splitlines())),
            done.stdout,
        )

    return outputs


def is_shown(value, table):
    """Whether a number is in a table, with as many decimals as its column has."""
    shown = [float(word) for word in re.findall(r"-?\d[\d.e+-]*", table)]
    return any(number == pytest.approx(value, rel=1e-3) for number in shown)


def column(rows, name):
    return [float(row[name]) for row in rows]


def test_info_json_holds_what_is_promised(read):
    data = read("info RUN")
    assert data.keys() >= {"frame_count", "step", "time", "state_digest", "heat_closure"}
    assert data["solver"].keys() >= {"sweeps_mean", "residual_rms_max", "unconverged_steps"}
    assert (data["status"], data["grain_count"]) == ("finished", 60)
    assert data["energy_closure"] <= 1e-10
    assert data["max_overlap"] <= 1e-3


def test_info_tells_a_run_and_its_heat(typed, read):
    done = typed("info RUN")
    assert done.stderr == ""
    for words in ("finished", "settle, shear, on", "Hertz"):
        assert words in done.stdout
    said = typed("info HEATED").stdout
    for words in ("heat closure", "1e-15", "313 K on average, 301 to 319 K"):
        assert words in said
    assert re.search(r"warning +largest Biot number +0.23 ", said)
    data = read("info HEATED")
    assert (data["heat_closure"], data["heat"]["max_biot"], data["heat"]["solid_gas_max"]) == (
        1e-15, 0.23, None,
    )  # fmt: skip


def test_verify_finds_damage(typed, finished, tmp_path):
    typed("verify RUN")
    shutil.copytree(finished, tmp_path / "run")
    file = tmp_path / "run" / "results.h5"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    assert "results.h5" in typed("verify run", 7).stdout
    assert json.loads(typed("verify run --json", 7).stdout)["whole"] is False


def test_profile(typed, outputs):
    data, rows, table = outputs("post profile RUN --of velocity --bins 4")
    assert [*rows[0]] == ["y [m]", "velocity [m/s]", "standard error [m/s]", "area [m2]"]
    assert (column(rows, "y [m]"), column(rows, "velocity [m/s]")) == (data["y"], data["value"])
    assert data["walls"] == ["bottom", "top"]
    assert is_shown(data["value"][2], table)
    assert "1 frame from t" in typed("post profile RUN --of velocity --bins 4").stderr


def test_profile_options(read):
    scaled = read("post profile RUN --normalized")
    assert scaled == read("post profile RUN --normalised")
    assert (scaled["unit"], scaled["y"][-1] < 1.0) == ("1", True)
    assert read("post profile RUN --frames -3:")["frame_count"] == 3
    assert read("post profile RUN --from 0 --to 0.002")["times"] == [0.0, 0.002]


def test_profiles_of_stress_and_heat(outputs, typed, read, tmp_path):
    data, rows, _ = outputs("post profile RUN --of stress --bin-width 2 --exclude-walls 1")
    assert column(rows, "y [m]") == data["y"]
    assert [float([*row.values()][7]) for row in rows] == data["fields"]["stress-yy"]["value"]
    assert data["y"][0] > data["bin_width"] / 2
    line = "post profile HEATED --frames 1: --bins 10 --exclude-walls 0"
    assert read(f"{line} --of heat")["value"] == pytest.approx((RATES / 0.4).tolist())
    temperature = read(f"{line} --of temperature --normalized")
    assert temperature["value"] == pytest.approx(temperature["y"])
    typed(f"{line} --of heat --plot heat.svg")
    assert "W/m²" in (tmp_path / "heat.svg").read_text()


@pytest.mark.parametrize("of", ["velocity", "fluctuation", "spin"])
def test_map(of, outputs):
    data, rows, said = outputs(f"post map RUN --of {of} --frame -2")
    assert [*rows[0]][:4] == ["x [m]", "y [m]", "radius [m]", f"{of} [{data['unit']}]"]
    assert column(rows, f"{of} [{data['unit']}]") == data["value"]
    assert len(data["value"]) == 60
    assert "largest" in said


def test_forces(outputs):
    data, rows, said = outputs("post forces RUN", "pdf")
    normal = column(rows, "normal force [N]")
    assert (len(rows), max(normal)) == (data["contacts"], data["normal_force_max"])
    assert data["normal_force_mean"] == pytest.approx(sum(normal) / len(normal))
    walls = sum(int(row["j"]) >= 60 for row in rows)
    assert (data["wall_contacts"], data["coordination"]) == (
        walls,
        pytest.approx((2 * len(rows) - walls) / 60),
    )
    assert "coordination number" in said


@pytest.mark.parametrize(
    ("option", "key", "more"), [("--distribution", "edges", -1), ("--angles", "angle", 0)]
)
def test_forces_distribution_and_angles(option, key, more, outputs, read):
    data, rows, _ = outputs(f"post forces RUN {option} --frames -5:", "pdf")
    assert (data["frame_count"], len(rows)) == (5, len(data[key]) + more)
    assert read(f"post forces RUN {option}")["frame_count"] == 1


def test_theta_eta(typed, outputs, read):
    """T = 300 + 20 y under a top wall at 320 K: θ = 1 − η."""
    line = "post theta-eta HEATED --wall top --bins 5"
    data, rows, _ = outputs(line, "svg")
    assert data["theta"] == pytest.approx([1.0 - eta for eta in data["eta"]])
    assert "grains" not in data
    grains = read(f"{line} --grains")["grains"]
    assert grains["theta"] == pytest.approx([1.0 - eta for eta in grains["eta"]])
    assert [*rows[0]] == [
        "eta [1]", "theta [1]", "standard deviation [1]", "min [1]", "max [1]", "count",
    ]  # fmt: skip
    assert len(rows) == 5
    assert len(typed(f"{line} --csv --grains").stdout.splitlines()) == GRAINS + 1
    assert "'top' at 320 K, T0 = 300 K, H = 1 m" in typed(line).stderr


def test_rheology_and_energy(outputs, typed):
    data, rows, table = outputs("post rheology RUN --from 0 --margin 1")
    assert column(rows, "time [s]") == data["time"]
    assert is_shown(data["mean"]["friction_walls"], table)
    assert data["mean"]["solid_fraction"] > 0.5
    data, rows, table = outputs("post energy RUN", "svg")
    assert float(rows[-1]["friction_loss [J]"]) == data["end"]["friction_loss"]
    assert "lost to friction" in table
    assert data["heat_closure"] is None
    assert "heat stored" in typed("post energy HEATED").stdout


def test_region(outputs):
    data, rows, table = outputs(
        "post region RUN --in '{ min = [0.0, 0.005], max = [0.01, 0.01] }' --from 0", "pdf"
    )
    assert [float(next(iter(row.values()))) for row in rows] == data["time"]
    assert data["area"] == pytest.approx(5e-5)
    assert is_shown(data["mean"]["solid_fraction"], table)


def test_compare(typed, outputs):
    data, rows, table = outputs("post compare RUN RUN --of velocity --of spin")
    assert data["scenario"] == []
    assert (
        set(data["profiles"]) == {next(iter(row.values())) for row in rows} == {"velocity", "spin"}
    )
    assert "work of the walls" in table
    assert "keys of the scenarios differ" in typed("post compare RUN HEATED").stderr


def test_every_command_works_while_the_run_goes_on(typed, tmp_path, monkeypatch):
    """Called where the run would end: its lock is held, its frames lie in segments."""
    lines = (
        "profile run", "profile run --of stress", "profile run --of heat",
        "theta-eta run --wall top", "map run",
        "map run --of stress", "forces run", "forces run --angles", "forces run --distribution",
        "rheology run --from 0", "diffusion run --from 0", "forces run --mobilization",
        "fabric run --from 0", "lifetimes run --from 0", "chains run", "clusters run",
        "energy run", "compare run run", "structure run --margin 0",
        "conductivity run --from 0", "conductivity run --network", "heat-network run",
        "wall-heat run --from 0", "map run --of heat-flux",
    )  # fmt: skip
    looked = []
    monkeypatch.setattr(
        RunDirectory,
        "finish",
        lambda *_, **__: looked.extend(typed(f"post {line}") for line in lines),
    )
    write_heated_run(tmp_path / "run")
    assert len(looked) == len(lines)


def test_runs_without_contacts_say_so(typed, tmp_path):
    write_heated_run(tmp_path / "run", contacts=False)
    for line in (
        "profile run --of stress", "profile run --of coordination", "map run --of stress",
        "forces run --angles",
    ):  # fmt: skip
        done = typed(f"post {line}", 2)
        assert (done.stdout, done.stderr.count("\n")) == ("", 1)
        assert "contacts = true in [output]" in done.stderr


@pytest.mark.parametrize("suffix", HEADS)
def test_figures_in_new_directories(suffix, typed, tmp_path):
    typed(f"post profile RUN --plot new/p.{suffix}")
    assert (tmp_path / "new" / f"p.{suffix}").read_bytes().startswith(HEADS[suffix])


@pytest.mark.parametrize(
    "line",
    ["profile RUN", "map RUN --of velocity", "forces RUN", "rheology RUN", "diffusion RUN",
        "energy RUN",
        "theta-eta RUN", "compare RUN RUN",
     "region RUN --in '{ min = [0, 0], max = [1, 1] }'"],
)  # fmt: skip
def test_a_figure_that_is_there_is_kept(line, typed, tmp_path):
    figure = tmp_path / "figure.png"
    figure.write_text("mine")
    done = typed(f"post {line} --plot {figure}", 6)
    assert f"{figure}: exists; choose another name, or give --overwrite" in done.stderr
    assert figure.read_text() == "mine"
    if line == "energy RUN":
        typed(f"post {line} --plot {figure} --overwrite")
        assert figure.read_bytes().startswith(HEADS["png"])


@pytest.mark.parametrize(
    "line",
    [["schema"], ["info", "RUN", "--json"], ["post", "profile", "RUN", "--csv", "--bins", "5000"]],
)
def test_closed_pipe_is_quiet(line, finished):
    """As in ``multicor … | true``, with nobody reading from the start."""
    words = [str(finished) if word == "RUN" else word for word in line]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command(*words), env=environment(PYTHONUNBUFFERED="1"), **streams)
    process.stdout.close()
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (0, "")


def test_closed_stderr_does_not_stop_a_run(finished):
    words = command("run", "small.toml", "-o", "full")
    process = subprocess.Popen(
        words, cwd=finished.parent, env=environment(), stderr=subprocess.PIPE, text=True
    )
    process.stderr.close()
    assert process.wait(timeout=60) == 0


def test_no_color_and_no_escapes_off_a_terminal(typed):
    done = typed("post profile RUN")
    assert "\x1b" not in done.stdout + done.stderr


def test_doctor_describes_the_installation(read):
    data = read("doctor")
    assert data.keys() >= {
        "multicor", "python", "numpy", "numba", "h5py", "hdf5", "threading layer", "kernel cache",
        "cores",
    }  # fmt: skip
    assert data.keys() >= {each.name for each in LIBRARIES.values()}


@pytest.mark.parametrize(("variables", "said"), [
    ({"NUMBA_THREADING_LAYER": "abacus"},
        "none: NUMBA_THREADING_LAYER=abacus: Numba has no such threading layer here; unset it"),
    ({"NUMBA_THREADING_LAYER_PRIORITY": "abacus"},
        "none: NUMBA_THREADING_LAYER_PRIORITY=abacus: Numba has no such"),
    ({"NUMBA_DISABLE_JIT": "1"}, "none: nothing is compiled, as NUMBA_DISABLE_JIT is set"),
    ({"NUMBA_THREADING_LAYER": "workqueue"}, "workqueue, "),
    ({"NUMBA_NUM_THREADS": "3"}, ", 3 threads"),
])  # fmt: skip
def test_doctor_says_in_a_sentence_why_there_is_no_threading_layer(variables, said, tmp_path):
    done = call("doctor", cwd=tmp_path, **variables)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("threading layer")]
    assert said in line
    # Nothing but names and values
    assert all(re.match(r"\S+( \S+)?  +\S", each) for each in done.stdout.splitlines())
