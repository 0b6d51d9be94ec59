"""A folder in which somebody has put modules runs none of them, whatever is started there: each
kind of child is."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import python
from places import ROOT
from pretended_slurm import pretend_slurm
from scenes import SMALL

NAMES = (
    "random", "json", "socket", "struct", "tempfile", "subprocess", "threading", "site",
    "sitecustomize", "usercustomize", "numba",
    "numpy", "llvmlite", "h5py", "pydantic", "lazy_loader", "yaml", "dask", "distributed",
    "tornado", "msgpack", "multicor_cli",
    "multicor_cli.running", "multicor_cli.studies", "multicor_cli.bench", "multicor_cli.engine",
)  # fmt: skip
PLANTED = """\
import os
open(os.path.join({marks!r}, {name!r}), "w").close()
raise SystemExit({name!r} + " was run in place of the library")
"""
COMMAND = "from multicor_cli.__main__ import main\n\nif __name__ == '__main__':\n    main()\n"
"""As the installed command: what stands first on its path is its own folder."""

STUDY = '[study]\nname = "s"\nscenario = "small.toml"\n\n[compute]\n'
JOBS = (
    'slurm = { queue = "debug", memory = "1GB", walltime = "00:10:00", scheduler_options = { host '
    '= "127.0.0.1" } }\n'
)

SECOND_PROCESS = """\
import time
from pathlib import Path
from multicor_cli.engine.jit.cache import configure_cache
cache = configure_cache()
from multicor_cli.running.machine import shared_compilation
with shared_compilation(2) as other:
    while other.poll() is None and not any(cache.rglob("*.nbi")):
        time.sleep(0.1)
assert any(cache.rglob("*.nbi")), "the second process has compiled nothing"
"""
APART = """\
from multicor_cli.bench.yardsticks import copy_bandwidth
from multicor_cli.bench.session import _apart
assert _apart(copy_bandwidth, 1) > 0.0
"""


def plant(folder, marks):
    """Modules in a folder that say that they were run."""
    marks.mkdir(exist_ok=True)
    for name in NAMES:
        path = folder / Path(*name.split("."))
        if any(other.startswith(f"{name}.") for other in NAMES):
            path.mkdir(exist_ok=True)
            path = path / "__init__"
        path.with_suffix(".py").write_text(PLANTED.format(marks=str(marks), name=name))


def run_there(tmp_path, program, *arguments, compute="", **variables):
    """Run a program, whose file lies elsewhere, among planted modules, with a study to be carried
    out; none of them may run."""
    there, marks = tmp_path / "there", tmp_path / "marks"
    there.mkdir()
    (there / "small.toml").write_text(SMALL)
    (there / "s.toml").write_text(STUDY + compute)
    plant(there, marks)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "multicor").write_text(program)
    done = python(tmp_path / "bin" / "multicor", *arguments, cwd=there, timeout=500, **variables)
    assert not list(marks.iterdir()), (list(marks.iterdir()), done.stderr)
    assert done.returncode == 0, done.stderr
    return done


def test_such_a_module_is_run_if_nobody_minds(tmp_path):
    plant(tmp_path, tmp_path / "marks")
    words = [sys.executable, "-c", "import random"]
    subprocess.run(words, cwd=tmp_path, check=False, capture_output=True)
    assert (tmp_path / "marks" / "random").exists()


def test_the_diagnosis(tmp_path):
    assert "threads" in run_there(tmp_path, COMMAND, "doctor").stdout


def test_the_second_process_that_compiles(tmp_path):
    run_there(tmp_path, SECOND_PROCESS, NUMBA_CACHE_DIR=str(tmp_path / "cache"))


def test_a_measurement(tmp_path):
    run_there(tmp_path, APART)


def test_a_study_here(tmp_path):
    done = run_there(tmp_path, COMMAND, "study", "run", "s.toml", compute="workers = 1\n")
    assert "1 case: 1 finished" in done.stderr


@pytest.mark.parametrize("path", [str(ROOT), f"{os.pathsep}{ROOT}{os.pathsep}."])
def test_a_study_in_jobs(path, tmp_path):
    """Jobs begin in the working directory of who submits them. The client gets another path than
    they."""
    pytest.importorskip("dask_jobqueue")
    slurm = pretend_slurm(tmp_path / "slurm")
    sbatch = tmp_path / "slurm" / "sbatch"
    sbatch.write_text(sbatch.read_text().replace("\ncp", f"\nexport PYTHONPATH='{path}'\ncp"))
    done = run_there(tmp_path, COMMAND, "study", "run", "s.toml", compute=JOBS, **slurm)
    assert "1 case: 1 finished" in done.stderr


@pytest.mark.reliability
@pytest.mark.parametrize(
    "words",
    ["run small.toml -o run --threads 2", "bench bed --grains 100 --rounds 1 --compilation"],
)
def test_whole_commands_without_kernels(words, tmp_path):
    run_there(tmp_path, COMMAND, *words.split(), NUMBA_CACHE_DIR=str(tmp_path / "cache"))
