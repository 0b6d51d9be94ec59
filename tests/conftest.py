"""Runs that tests look at, and the order of the tests."""

import gc
import os
import shlex
import shutil
from contextlib import ExitStack
from pathlib import Path

import pytest
from command_line import call
from cut_runs import CELL
from heat_run import write_heated_run
from report_run import write_evil_run
from scenes import write_small
from shaped_run import write_shaped_run

import multicor_cli as multicor

PLACES = {
    "digests": -3, "unit/project/test_types.py": -2, "unit/project/test_solver_comparison.py": 1,
    "unit/project/test_uniqueness.py": 1, "unit/project/test_peers.py": 1,
    "unit/project/test_shape_peers.py": 1, "unit/project": -1, "browser": -1, "unit/scenario": -1,
    "unit/plots": -1, "unit/report": -1, "unit": 1, "verification": 2,
}  # fmt: skip
"""Folders and files that come before others, or after: one process compiles the kernels with the
first, for all, while another does without kernels what comes next. Folders of many short tests are
last, so that no process is left with a long one at the end."""

MEMORY = Path("/dev/shm")
"""Where files of tests lie if there is room, and programs may be: they outlive no power cut, and
``fsync`` costs nothing. Another place is chosen with ``PYTEST_DEBUG_TEMPROOT``."""

if (
    MEMORY.is_dir()
    and shutil.disk_usage(MEMORY).free > 4 << 30
    and not os.statvfs(MEMORY).f_flag & os.ST_NOEXEC
):
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))

# Processes of tests share the cores: threads that wait leave theirs to the others. Where all cores
# were busy, a run on two threads took eight times as long, most of it in waiting for each other.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")


def _place(item):
    path = item.path.relative_to(Path(__file__).parent)
    folders = map(Path.as_posix, (path, *path.parents))
    return next((PLACES[folder] for folder in folders if folder in PLACES), 0)


def pytest_collection_modifyitems(items):
    items.sort(key=_place)


def pytest_collection_finish():
    """Garbage is seldom looked for: that took a twelfth of the time in which figures are drawn or
    kernels compiled, among thousands of tests and what was loaded for them."""
    gc.freeze()
    gc.set_threshold(50_000)


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """Directory of an uninterrupted run of the small scenario."""
    directory = tmp_path_factory.mktemp("finished")
    write_small(directory)
    done = call("run", "small.toml", "-o", "full", cwd=directory)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "finished: step" in done.stderr
    return directory / "full"


@pytest.fixture(scope="session")
def sheared(tmp_path_factory):
    """Directory of a run whose cell has been deformed."""
    folder = tmp_path_factory.mktemp("sheared")
    (folder / "cell.toml").write_text(CELL)
    return multicor.run(folder / "cell.toml", folder / "run", threads=1).directory


@pytest.fixture(scope="session")
def evil(tmp_path_factory):
    """Directory of a run with heat whose texts are those of an attacker (`report_run`)."""
    path = tmp_path_factory.mktemp("evil") / "run"
    write_evil_run(path)
    return path


@pytest.fixture
def run(tmp_path):
    """``run(scenario, name)`` carries a scenario out in this process, and opens its directory until
    the test is over."""
    with ExitStack() as opened:

        def run_and_open(scenario, name="run", **options):
            multicor.run(scenario, tmp_path / name, **{"threads": 1, **options})
            return opened.enter_context(multicor.open_run(tmp_path / name))

        yield run_and_open


@pytest.fixture(scope="session")
def heated(tmp_path_factory):
    """Directory of a run with known temperatures (`heat_run`)."""
    path = tmp_path_factory.mktemp("heated") / "run"
    write_heated_run(path)
    return path


@pytest.fixture(scope="session")
def column(heated):
    """That run: ten grains on top of each other; each frame is read anew."""
    return multicor.open_run(heated)


@pytest.fixture(scope="session")
def silent(tmp_path_factory):
    """The same without contacts."""
    path = tmp_path_factory.mktemp("silent") / "run"
    write_heated_run(path, contacts=False)
    return multicor.open_run(path)


@pytest.fixture(scope="session")
def shaped(tmp_path_factory):
    """Directory of a run with heat of grains of all kinds of shapes (`shaped_run`)."""
    path = tmp_path_factory.mktemp("shaped") / "run"
    write_shaped_run(path, heat=True)
    return path


@pytest.fixture
def typed(request, tmp_path):
    """``typed("post map RUN")`` is a command as typed in an empty folder, which ends with ``code``.

    RUN, HEATED and SHAPED are the runs of the fixtures `finished`, `heated` and `shaped`, SMALL is
    the scenario of the first.
    """
    places = {
        "RUN": ("finished", ""), "HEATED": ("heated", ""), "SHAPED": ("shaped", ""),
        "SMALL": ("finished", "../small.toml"),
    }  # fmt: skip

    def typed(line, code=0):
        for word, (fixture, below) in places.items():
            if word in line:
                line = line.replace(word, str((request.getfixturevalue(fixture) / below).resolve()))
        done = call(*shlex.split(line), cwd=tmp_path)
        assert done.returncode == code, f"{line}: {done.stderr}"
        return done

    return typed
