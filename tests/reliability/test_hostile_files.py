"""Files made to mislead the program: refused by name, nothing outside the run is touched, nothing
hangs."""

import json
import os
import shutil
import signal
import subprocess

import h5py
import numpy as np
import pytest
from command_line import call, command, environment
from trials import thinned

from multicor_cli.text import printable

READERS = ("info {}", "verify {}", "export csv {} -o out", "export fclib {} -o out.h5")
"""Commands that read a run, and how they are called."""

KNOWN = {0, 3, 5, 6, 7}
"""Exit codes without an internal error."""


@pytest.fixture
def copy(tmp_path, finished):
    shutil.copytree(finished, tmp_path / "run", symlinks=True)
    for path in (tmp_path / "run").rglob("*"):
        if path.is_file():
            path.chmod(0o644)
    return tmp_path / "run"


def test_links_are_not_followed_where_something_is_written(copy, tmp_path):
    precious = tmp_path / "precious.txt"
    precious.write_text("precious")
    (copy / "lock").unlink()
    (copy / "lock").symlink_to(precious)
    done = call("run", copy / "scenario.toml", "-o", "run", cwd=tmp_path)
    assert done.returncode == 6
    assert "lock" in done.stderr
    assert precious.read_text() == "precious"


@pytest.mark.parametrize(
    "name",
    thinned(["run.json", "scenario.toml", "scenario.resolved.toml", "results.h5", "lock"], 3),
)
def test_pipes_are_not_waited_for(copy, tmp_path, name):
    (copy / name).unlink()
    os.mkfifo(copy / name)
    for words in ("info run", "verify run", "run run/scenario.resolved.toml -o run"):
        if not (name == "scenario.resolved.toml" and name in words):
            assert call(*words.split(), cwd=tmp_path).returncode in KNOWN  # fails after a minute


def spoil_attribute(name, value):
    return lambda file: file.attrs.modify(name, value)


def lose_a_grain(file):
    for name in ("radius", "mass", "inertia", "material", "group"):
        values, attributes = file[f"model/{name}"][:-1], dict(file[f"model/{name}"].attrs)
        del file[f"model/{name}"]
        file[f"model/{name}"] = values
        file[f"model/{name}"].attrs.update(attributes)


def change_stage(file):
    file["steps/stage"][-1] = 77


def change_digest(file):
    file["particles/position"].attrs["blake2b"] = np.arange(5)


SPOILED = {
    "summary is a number": spoil_attribute("summary", "3"),
    "summary of other things": spoil_attribute("summary", '{"solver": 3}'),
    "provenance is a list": spoil_attribute("provenance", "[]"),
    "a grain less": lose_a_grain,
    "a stage that does not exist": change_stage,
    "a digest that is an array": change_digest,
}


@pytest.mark.parametrize("spoil", thinned(SPOILED, 2))
def test_results_that_lie_are_refused_or_read_as_they_are(copy, tmp_path, spoil):
    with h5py.File(copy / "results.h5", "r+") as file:
        spoil(file)
    shutil.move(copy / "results.h5", tmp_path / "alone.h5")
    done = {reader: call(*reader.format("alone.h5").split(), cwd=tmp_path) for reader in READERS}
    assert not any("internal error" in each.stderr for each in done.values())
    assert {each.returncode for each in done.values()} <= KNOWN
    assert done["verify {}"].returncode == 7


def test_lock_of_nested_lists(copy, tmp_path):
    (copy / "lock").write_text("[" * 4000)
    assert call("run", copy / "scenario.toml", "-o", "run", cwd=tmp_path).returncode == 0


def test_names_do_not_command_the_terminal():
    assert printable("wall \x1b]0;x\x07 \x9b1m ok\nµ θ") == "wall \\x1b]0;x\\x07 \\x9b1m ok\nµ θ"
    assert json.loads(f'"{printable("é")}"') == "é"


@pytest.mark.parametrize(("stream", "code"), [(">&-", 0), (">/dev/full", 5)])
@pytest.mark.parametrize("arguments", ["--help", "schema", "info run"])
def test_output_that_cannot_be_written(copy, tmp_path, arguments, stream, code):
    line = ["sh", "-c", f"{' '.join(command())} {arguments} {stream}"]
    done = subprocess.run(
        line, cwd=tmp_path, env=environment(), stderr=subprocess.PIPE, text=True, check=False
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert code == 0 or "standard output: No space left" in done.stderr


def test_figures_do_not_replace_pipes(finished, tmp_path):
    os.mkfifo(tmp_path / "map.png")
    done = call("post", "map", finished, "--of", "velocity", "--plot", "map.png", cwd=tmp_path)
    assert done.returncode == 6
    assert "map.png: is not an ordinary file" in done.stderr
    assert [path.is_fifo() for path in tmp_path.iterdir()] == [True]


SLOW_EXPORT = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ["multicor", "export", "csv", sys.argv[1], "-o", "tables"]
from multicor_cli.store.frames import Frame
def hang(*a, **k):
    print("hanging", flush=True)
    while True: time.sleep(0.05)
Frame.column = hang
from multicor_cli.cli.app import main; main()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_exports_leave_nothing_half_written(finished, tmp_path, number):
    process = subprocess.Popen(
        [*command()[:1], "-c", SLOW_EXPORT, finished], cwd=tmp_path, env=environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout.readline() == "hanging\n"
    assert list(tmp_path.iterdir()) != []
    process.send_signal(number)
    process.communicate(timeout=10)
    assert process.returncode == 128 + number
    assert list(tmp_path.iterdir()) == []
