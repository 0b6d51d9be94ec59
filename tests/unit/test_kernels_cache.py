"""The directory of compiled kernels: never stale, always writable, never growing."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_run import ROOT, environment

from multicor_cli.kernels import cache


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache directory of the user; Numba looks as if it had not been imported."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.delenv("MULTICOR_NO_CACHE", raising=False)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    return tmp_path / "xdg" / "multicor"


def test_cache_lies_in_the_users_directory(home: Path) -> None:
    found = cache.configure_cache()
    assert found == home / cache.cache_name()
    assert os.environ["NUMBA_CACHE_DIR"] == str(found)
    assert cache.configure_cache() == found  # what we have set ourselves leads to the same place
    assert not cache.is_compiled()
    (found / "sub").mkdir()
    (found / "sub" / "kernel.nbi").touch()
    assert cache.is_compiled()


def test_directory_given_by_the_user_is_respected(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "mine"))
    assert cache.configure_cache() == tmp_path / "mine" / cache.cache_name()
    assert not home.exists()


def test_edited_source_gets_another_directory(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stale machine code that Numba would use is in the directory of the sources that it was made of."""
    package = tmp_path / "package"
    for name in cache.PACKAGES:
        (package / name).mkdir(parents=True)
        (package / name / "module.py").write_text("value = 1")
    monkeypatch.setattr(cache, "__file__", str(package / "kernels" / "cache.py"))
    names = [cache.cache_name()]
    for name in cache.PACKAGES:
        (package / name / "module.py").write_text("value = 2")
        names.append(cache.cache_name())
    (package / "physics" / "module.py").rename(package / "physics" / "other.py")
    names.append(cache.cache_name())
    assert len(set(names)) == len(cache.PACKAGES) + 2
    (package / "cli.py").write_text("no kernel is made of this")
    assert cache.cache_name() == names[-1]


def test_unwritable_or_full_home_falls_back(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    home.parent.write_text("a file, not a directory")
    found = cache.configure_cache()
    assert found is not None
    assert found.parent == tmp_path / "tmp" / f"multicor-{os.getuid()}"
    monkeypatch.setattr(cache, "SPACE", 1 << 62)
    assert cache.configure_cache() is None
    assert Path(os.environ["NUMBA_CACHE_DIR"]).is_dir()


def test_directory_that_others_can_write_to_is_not_trusted(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    home.mkdir(parents=True)
    home.chmod(0o777)
    found = cache.configure_cache()
    assert found is not None
    assert tmp_path / "tmp" in found.parents


def test_no_cache_leaves_nothing_behind(tmp_path: Path) -> None:
    script = (
        "from multicor_cli.kernels.cache import configure_cache; import os; print(configure_cache(), os.environ['NUMBA_CACHE_DIR'])"
    )
    extra = {"MULTICOR_NO_CACHE": "1", "XDG_CACHE_HOME": str(tmp_path), "NUMBA_CACHE_DIR": ""}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(**extra), capture_output=True, text=True, check=True, timeout=60
    )
    result, directory = done.stdout.split()
    assert result == "None"
    assert not Path(directory).exists()
    assert list(tmp_path.iterdir()) == []


def test_old_caches_go_and_young_ones_stay(home: Path) -> None:
    home.mkdir(parents=True)
    tail = cache.cache_name()[len("kernels-") + 16 :]
    for k in range(6):
        directory = home / f"kernels-{k:016x}{tail}"
        directory.mkdir()
        age = cache.MIN_AGE * (k - 0.5)  # number 0 and the current one are young
        os.utime(directory, (time.time() - age, time.time() - age))
    (home / "thesis").mkdir()
    current = cache.configure_cache()
    assert current is not None
    left = sorted(path.name[:24] for path in home.iterdir() if path != current)
    assert left == [f"kernels-{0:016x}", f"kernels-{1:016x}", "thesis"]


def imports_of(path: Path) -> set[str]:
    """Packages of ours that a module imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
        found |= {name.split(".")[1] for name in names if name.startswith("multicor_cli.")}
    return found


@pytest.mark.parametrize("package", cache.PACKAGES)
def test_kernels_are_made_of_what_the_digest_covers(package: str) -> None:
    for path in (ROOT / "multicor_cli" / package).rglob("*.py"):
        assert imports_of(path) <= set(cache.PACKAGES), path


def test_cached_functions_are_only_where_the_digest_looks_or_call_nothing_else() -> None:
    """Numba notices an edit of the file that a cached function is in, but not of what it calls: that must be covered."""
    for path in (ROOT / "multicor_cli").rglob("*.py"):
        tree = ast.parse(path.read_text())
        uses_numba = any(isinstance(node, ast.Attribute) and node.attr in ("njit", "jit") for node in ast.walk(tree))
        if uses_numba:
            assert path.parent.name in cache.PACKAGES, path
