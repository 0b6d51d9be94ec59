"""What a run takes of the machine: processes that find no module in the working directory, and
memory that stays."""

import ast
import os
import subprocess
import sys

import pytest
from places import ROOT

import multicor_cli
from multicor_cli.running.machine import python_child

# ---- Python processes that this program starts find no module in the working directory, and
#      everything where it is installed

SHOW = (
    "import sys, os, multicor_cli; print(os.getcwd() in sys.path or '' in sys.path, "
    "multicor_cli.__file__)"
)


@pytest.mark.parametrize(
    "path",
    ["", os.pathsep, f"{os.pathsep}/opt", f"/opt{os.pathsep}", ".", f"./{os.pathsep}/opt", "x/.."],
)
def test_what_means_the_working_directory_goes(path, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.chdir(tmp_path)
    command, environment = python_child("-c", SHOW)
    said = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True
    ).stdout.split()
    assert said == ["False", multicor_cli.__file__]
    assert ("/opt" in environment["PYTHONPATH"].split(os.pathsep)) == ("/opt" in path)


def test_what_the_child_starts_has_no_working_directory_either(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "random.py").write_text("raise SystemExit('run')")
    grandchild = (
        "import subprocess, sys; sys.exit(subprocess.call([sys.executable, '-c', 'import random']))"
    )
    command, environment = python_child("-c", grandchild)
    assert (
        subprocess.run(command, env=environment, capture_output=True, check=False).returncode == 0
    )


def test_variables_and_packages_of_the_user_stay(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/opt/numpy")
    command, environment = python_child("-m", "x", NUMBA_CACHE_DIR="/c")
    assert command == [sys.executable, "-P", "-m", "x"]
    assert environment["PYTHONPATH"].split(os.pathsep)[0] == "/opt/numpy"
    assert environment["NUMBA_CACHE_DIR"] == "/c"
    assert environment["HOME"] == os.environ["HOME"]


def test_nothing_else_starts_an_interpreter():
    """Nor processes that start one by themselves, with the working directory first."""
    # The last two write its name down
    allowed = {"running/machine.py", "cli/reading_commands.py", "studies/clusters.py"}
    for path in sorted((ROOT / "multicor_cli").rglob("*.py")):
        name = path.relative_to(ROOT / "multicor_cli").as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.executable":
                assert name in allowed, f"{name} line {node.lineno}: use python_child"
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = (
                    [node.module or ""]
                    if isinstance(node, ast.ImportFrom)
                    else [alias.name for alias in node.names]
                )
                names = [alias.name for alias in node.names]
                assert not {module.split(".")[0] for module in modules} & {"multiprocessing"}, (
                    f"{name} line {node.lineno}"
                )
                assert "ProcessPoolExecutor" not in names, f"{name} line {node.lineno}"


# ---- Freed memory stays in the process

CODE = """
import resource, sys
import numpy as np
from multicor_cli.running.machine import keep_freed_memory
if sys.argv[1] == "keep" and not keep_freed_memory():
    print("unknown")
    sys.exit()
for _ in range(3):
    np.empty(1_000_000).fill(1.0)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    np.empty(1_000_000).fill(1.0)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(way):
    done = subprocess.run(
        [sys.executable, "-c", CODE, way], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_arrays_are_not_fetched_from_the_system_again_and_again():
    kept = faults("keep")
    if kept == "unknown":
        pytest.skip("the C library has no mallopt")
    assert int(kept) < 200  # twenty arrays of 2,000 pages
