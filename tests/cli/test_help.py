"""Help is quick because nothing heavy is imported for it, and so is what only reads; help is as
wide as the terminal."""

import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
import scenes
from command_line import call, command, environment
from every_command import commands
from typer.main import get_command

from multicor_cli import __version__
from multicor_cli.cli.app import app

HEAVY = {"h5py", "matplotlib", "numba", "numpy", "pandas", "pydantic", "scipy", "simpleeval"}
COMMANDS = [
    "new", "validate", "run", "info", "verify", "post", "export", "report", "bench", "schema",
    "doctor", "study",
]  # fmt: skip

COMMAND = "sys.argv = ['multicor', *{!r}]; from multicor_cli.cli.app import main; main()"
SCRIPT = """
import sys
try:
    {code}
except SystemExit as ended:
    assert not ended.code, ended
print(*sorted(sys.modules), file=sys.stderr)
"""


def loaded_after(code, **options):
    """Modules, and the packages that they are in, that are loaded after ``code`` has run in a
    process of its own."""
    options |= {"env": environment(), "capture_output": True, "text": True, "timeout": 120}
    command = [sys.executable, "-c", SCRIPT.format(code=code)]
    names = subprocess.run(command, check=True, **options).stderr.splitlines()[-1].split()
    return {*names, *(name.split(".")[0] for name in names)}


@pytest.mark.parametrize(("arguments", "forbidden"), [
    ("--help", HEAVY),
    ("--version", HEAVY),
    # The command-line library itself looks for pydantic as soon as a command has options.
    ("run --help", HEAVY - {"pydantic"}),
    ("post energy --help", HEAVY - {"pydantic"}),
    # It names quantities, and compiles nothing.
    ("post map --help", HEAVY - {"pydantic", "numpy"}),
])  # fmt: skip
def test_help_imports_nothing_heavy(arguments, forbidden):
    modules = loaded_after(COMMAND.format(arguments.split()))
    assert "typer" in modules
    assert not modules & forbidden


COMPILERS = {"numba", "llvmlite"}
FIGURES = {"matplotlib", "PIL", "multicor_cli.plots"}
MANY_RUNS = {"scipy", "pandas", "dask", "distributed", "simpleeval", "multicor_cli.studies"}
KERNELS = {
    "multicor_cli.engine.jit.compile",
    "multicor_cli.engine.geometry.scene",
    "multicor_cli.engine.step",
}
SCENARIOS = {
    "multicor_cli.scenario.tables", "multicor_cli.running.plan", "multicor_cli.packing.assembly",
}  # fmt: skip
READING = COMPILERS | FIGURES | MANY_RUNS | KERNELS
ONLY_KERNELS = FIGURES | (MANY_RUNS - {"scipy"}) | {"scipy.linalg"}


@pytest.mark.parametrize(("arguments", "forbidden"), [
    ("info RUN", READING),
    ("verify RUN", READING | SCENARIOS),
    ("post energy RUN", READING | SCENARIOS),
    ("post profile RUN --of velocity --json", READING | SCENARIOS),
    ("post map RUN --of speed --csv", READING | SCENARIOS),
    ("post series RUN", READING | SCENARIOS),
    ("export csv RUN -o files", READING | SCENARIOS),
    ("new bed", READING | {"h5py"}),
    ("schema", READING | {"h5py"}),
    # Grains are placed by kernels; Numba asks for the version of scipy
    ("validate small.toml", ONLY_KERNELS | {"multicor_cli.engine.contact"}),
    ("run small.toml -o run", ONLY_KERNELS),
])  # fmt: skip
def test_a_command_loads_no_more_than_it_needs(arguments, forbidden, finished, tmp_path):
    (tmp_path / "small.toml").write_text(scenes.SMALL)
    modules = loaded_after(
        COMMAND.format(arguments.replace("RUN", str(finished)).split()), cwd=tmp_path
    )
    assert not modules & forbidden


def test_importing_the_package_imports_nothing_heavy():
    modules = loaded_after(
        "import multicor_cli, multicor_cli.running, multicor_cli.engine, multicor_cli.cli.app, "
        "multicor_cli.store; multicor_cli.run"
    )
    assert not modules & HEAVY


def test_expressions_are_evaluated_only_where_there_are_any():
    def load(overrides):
        return loaded_after(
            f"sys.path.insert(0, {str(Path(scenes.__file__).parent)!r}); from scenes import SMALL; "
            "from multicor_cli.scenario import parse_scenario; "
            f"parse_scenario(SMALL, 'a.toml', {overrides})"
        )

    assert "simpleeval" not in load([])
    assert "simpleeval" not in load(["variables={}"])
    assert "simpleeval" in load(["solver.dt== 1 / 5e3"])


@pytest.mark.parametrize(("command", "words"), [
    ("", [f" {name} " for name in COMMANDS]), ("post animate", ["coordination"]),
    ("post profile", ["pressure"]), ("bench", ["heated-bed"]), ("new", ["hopper"]),
])  # fmt: skip
def test_help_names_what_there_is(command, words, typed):
    said = typed(f"{command} --help").stdout
    assert all(word in said for word in words)
    assert "--normalised" not in said


NAMES = {
    " ".join(path[:k]) for path, _ in commands(get_command(app)) for k in range(1, len(path) + 1)
}


@pytest.mark.parametrize("name", sorted(NAMES))
def test_every_command_has_help_as_wide_as_the_terminal(name, tmp_path):
    """Prose fills its lines: the first word of a line would not have fitted into the one before,
    unless a paragraph begins."""
    done = call(*name.split(), "--help", cwd=tmp_path, COLUMNS="80")
    assert done.returncode == 0, done.stderr
    assert "Usage" in done.stdout
    prose = [line.rstrip() for line in done.stdout.partition("╭")[0].splitlines()]
    assert max(map(len, prose)) <= 80
    for line, following in pairwise(prose):
        if line and following:
            assert len(line) + 1 + len(following.split()[0]) > 79, line


@pytest.mark.parametrize(("line", "offered", "not_offered"), [
    ("new x --template h", {"hopper", "heap"}, {"shear"}),
    ("new x -t ", {"shear", "biaxial"}, set()),
    ("post profile RUN --of v", {"velocity"}, {"spin"}),
    ("post profile RUN --of st", {"stress"}, set()),
    ("post map RUN --of co", {"coordination"}, {"velocity"}),
    ("post animate RUN --of ", {"velocity", "temperature"}, set()),
    ("post compare RUN RUN --of spin --of vel", {"velocity"}, {"spin"}),
    ("post fields RUN --of velocity", {"velocity-x", "velocity-y"}, {"velocity-r"}),
    ("post fields RUN --center 0,0 --of velocity", {"velocity-r", "velocity-t"}, {"velocity-x"}),
    ("post series RUN --of force", {"force_x", "force_y"}, {"kinetic"}),
    ("post series NONE --of force", set(), {"force_x"}),
    ("study plot s.toml f.png --of m", {"mu"}, {"steps"}),
    ("study plot none.toml f.png --of m", set(), {"mu"}),
    ("study plot s.toml f.png --fit ", {"line", "power", "mu-of-I"}, set()),
    ("bench hea", {"heated-bed"}, {"shear"}),
])  # fmt: skip
def test_the_shell_completes_values(line, offered, not_offered, finished, tmp_path):
    observed = "".join(
        f'[[observe]]\nname = "{name}"\ninfo = "{field}"\n'
        for name, field in (("mu", "time"), ("steps", "step"))
    )
    head = '[study]\nname = "s"\nscenario = "a.toml"\n'
    (tmp_path / "s.toml").write_text(head + observed)
    words = f"multicor {line}".replace("RUN", str(finished)).replace("NONE", str(tmp_path / "none"))
    asked = {
        "_MULTICOR_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    done = call(cwd=tmp_path, **asked)
    assert (done.returncode, done.stderr) == (0, "")
    found = set(done.stdout.split())
    assert offered <= found
    assert not found & not_offered


@pytest.mark.parametrize("arguments", [("--help",), ("schema",)])
def test_a_pipe_that_nobody_reads_is_no_failure(arguments, tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    pipes = {"stdout": writing, "stderr": subprocess.PIPE, "text": True, "env": environment()}
    done = subprocess.run(command(*arguments), cwd=tmp_path, check=False, **pipes)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_version(typed):
    assert typed("--version").stdout == f"multicor {__version__}\n"
