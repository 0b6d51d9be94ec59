"""The directory of compiled kernels: never stale, always writable, never growing; and the threading
layer."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import call, environment
from places import ROOT

from multicor_cli.engine.jit import cache
from multicor_cli.engine.jit.cache import PRIORITY


@pytest.fixture
def home(tmp_path, monkeypatch):
    """An empty cache directory of the user; Numba looks as if it had not been imported."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.delenv("MULTICOR_NO_CACHE", raising=False)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    return tmp_path / "xdg" / "multicor"


def test_directory_given_by_the_user_is_respected(home, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "mine"))
    assert cache.configure_cache() == tmp_path / "mine" / cache.cache_name()
    assert not home.exists()
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    found = cache.configure_cache()
    assert found == home / cache.cache_name()
    assert os.environ["NUMBA_CACHE_DIR"] == str(found)
    assert cache.configure_cache() == found  # what we have set ourselves leads to the same place
    assert not cache.is_compiled()
    (found / "sub").mkdir()
    (found / "sub" / "relaxation._descend-238.py311.nbi").touch()  # placing grains alone
    assert not cache.is_compiled()
    (found / "sub" / "acceleration.iterate-9.py311.nbi").touch()
    assert cache.is_compiled()
    assert not cache.is_compiled(has_shapes=True)
    (found / "sub" / "face_sweep.relax_faces-9.py311.nbi").touch()
    assert cache.is_compiled(has_shapes=True)


@pytest.mark.parametrize("why", ["of somebody else", "open to all", "full"])
def test_nothing_is_left_in_a_directory_that_is_passed_over(why, home, monkeypatch):
    """As ``/tmp/multicor-UID`` may be: made by somebody else, and open."""
    home.mkdir(parents=True)
    home.chmod(0o777)
    if why == "of somebody else":
        if os.getuid():
            pytest.skip("only root can give a directory to somebody else")
        os.chown(home, 54321, 54321)
        home.chmod(0o1777)
    elif why == "full":
        home.chmod(0o700)
        monkeypatch.setattr(cache, "SPACE", 1 << 62)
    cache.configure_cache()
    assert not Path(os.environ["NUMBA_CACHE_DIR"]).is_relative_to(home)
    assert list(home.iterdir()) == []


MODULES = {
    "__init__.py": "",
    "engine/jit/compile.py": "value = 1",
    "engine/jit/cache.py": "",
    "engine/laws.py": "from multicor_cli.engine import units",
    "engine/units.py": "value = 1",
    "packing/loops.py": (
        "from multicor_cli.engine.jit.compile import kernel\n"
        "from multicor_cli.engine.laws import (\n    law,\n)\n"
    ),
    "packing/hosts.py": "from multicor_cli.packing.loops import loop",
    "cli.py": "from multicor_cli.packing import hosts",
}
"""A package in which ``packing/loops.py`` has kernels."""

COUNT = {"engine/jit/compile.py", "engine/laws.py", "engine/units.py", "packing/loops.py"}
"""What its machine code is made of."""


def test_edited_source_gets_another_directory(home, tmp_path, monkeypatch):
    """The stale machine code that Numba would use is in the directory of the sources that it was
    made of."""
    package = tmp_path / "multicor_cli"
    for name, text in MODULES.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)
    monkeypatch.setattr(cache, "__file__", str(package / "engine" / "jit" / "cache.py"))
    names = [cache.cache_name()]
    for name, text in MODULES.items():
        (package / name).write_text(f"{text}\n# edited")
        names.append(cache.cache_name())
        assert (names[-1] != names[-2]) == (name in COUNT), name
    (package / "engine" / "units.py").rename(package / "engine" / "other.py")
    assert cache.cache_name() not in names


def test_unwritable_or_full_home_falls_back(home, tmp_path, monkeypatch):
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    home.parent.write_text("a file, not a directory")
    found = cache.configure_cache()
    assert found.parent == tmp_path / "tmp" / f"multicor-{os.getuid()}"
    monkeypatch.setattr(cache, "SPACE", 1 << 62)
    assert cache.configure_cache() is None
    assert Path(os.environ["NUMBA_CACHE_DIR"]).is_dir()


def test_directory_that_others_can_write_to_is_not_trusted(home, tmp_path, monkeypatch):
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    home.mkdir(parents=True)
    home.chmod(0o777)
    found = cache.configure_cache()
    assert tmp_path / "tmp" in found.parents


def test_no_cache_leaves_nothing_behind(tmp_path):
    script = (
        "from multicor_cli.engine.jit.cache import configure_cache; import os; "
        "print(configure_cache(), os.environ['NUMBA_CACHE_DIR'])"
    )
    extra = {"MULTICOR_NO_CACHE": "1", "XDG_CACHE_HOME": str(tmp_path), "NUMBA_CACHE_DIR": ""}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(**extra), capture_output=True, text=True,
        check=True, timeout=60,
    )  # fmt: skip
    result, directory = done.stdout.split()
    assert result == "None"
    assert not Path(directory).exists()
    assert list(tmp_path.iterdir()) == []


def test_old_caches_go_and_young_ones_stay(home):
    home.mkdir(parents=True)
    tail = cache.cache_name()[len("kernels-") + 16 :]
    for k in range(6):
        directory = home / f"kernels-{k:016x}{tail}"
        directory.mkdir()
        age = cache.MIN_AGE * (k - 0.5)  # number 0 and the current one are young
        os.utime(directory, (time.time() - age, time.time() - age))
    (home / "thesis").mkdir()
    current = cache.configure_cache()
    left = sorted(path.name[:24] for path in home.iterdir() if path != current)
    assert left == [f"kernels-{0:016x}", f"kernels-{1:016x}", "thesis"]


PACKAGE = ROOT / "multicor_cli"


def modules_of(path):
    """Files of the package that a module imports, found as Python would; names from a package are
    those of its modules."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, path
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            place = ROOT / name.replace(".", "/")
            found |= {
                file
                for file in (place.with_suffix(".py"), place / "__init__.py")
                if file.is_relative_to(PACKAGE)
            }
    return {file for file in found if file.exists()}


def test_the_digest_covers_whatever_kernels_are_made_of():
    """Numba notices an edit of the file that a cached function is in, but not of what it calls."""
    imports = {path: modules_of(path) for path in PACKAGE.rglob("*.py")}
    decorators = PACKAGE / "engine" / "jit" / "compile.py"
    made_of = {path for path, imported in imports.items() if decorators in imported}
    assert {
        PACKAGE / "packing" / "relaxation.py",
        PACKAGE / "engine" / "contact" / "sweep.py",
    } <= made_of
    while (more := made_of.union(*(imports[path] for path in made_of))) != made_of:
        made_of = more
    assert set(cache.kernel_sources(PACKAGE)) == made_of


def test_a_kernel_is_compiled_anew_for_another_step_of_the_engine_only_if_it_has_to_be():
    """Files without kernels that no kernel needs do not count: those who work on them need not
    wait."""
    counted = {path.relative_to(PACKAGE).as_posix() for path in cache.kernel_sources(PACKAGE)}
    assert not counted & {"engine/step.py", "running/session.py", "cli/app.py", "store/reader.py"}


def test_kernels_are_compiled_in_one_place():
    """Else neither the digest nor the promise of IEEE arithmetic would hold."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = (
                [node.attr]
                if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "numba"
                else []
            )
            if (
                isinstance(node, ast.ImportFrom)
                and (node.module or "").partition(".")[0] == "numba"
            ):
                names = [alias.name for alias in node.names]
            if set(names) & {
                "njit",
                "jit",
                "vectorize",
                "guvectorize",
                "stencil",
                "register_jitable",
                "overload",
            }:
                found.add(path.relative_to(PACKAGE).as_posix())
    assert found == {"engine/jit/compile.py"}


# ---- The threading layer: OpenMP where there is one, whatever else is installed; the user's choice
#      comes first

SHOW = """
import numba
{first}
from multicor_cli.engine.jit import compile as jit
print(numba.config.THREADING_LAYER_PRIORITY, numba.config.THREADING_LAYER)
"""


def shown(first="", **extra):
    env = {
        key: value for key, value in environment().items() if not key.startswith("NUMBA_THREADING")
    }
    done = subprocess.run(
        [sys.executable, "-c", SHOW.format(first=first)],
        env={**env, **extra},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_openmp_comes_first_even_if_numba_was_imported_before():
    assert shown() == f"{PRIORITY.split()} default"


@pytest.mark.parametrize("name", ["NUMBA_THREADING_LAYER_PRIORITY", "NUMBA_THREADING_LAYER"])
def test_the_users_choice_is_kept(name):
    value = "workqueue omp tbb" if name.endswith("PRIORITY") else "workqueue"
    assert "workqueue" in shown(**{name: value})
    assert shown(**{name: value}) != shown()


def test_a_layer_that_is_not_there_is_named():
    """Numba complains of it in the midst of a kernel."""
    arguments = ("run", ROOT / "configs" / "lattice14.toml", "--dry-run")
    done = call(*arguments, cwd=ROOT, NUMBA_THREADING_LAYER="abacus")
    assert done.returncode == 5
    assert done.stderr.startswith("multicor: NUMBA_THREADING_LAYER=abacus: ")
