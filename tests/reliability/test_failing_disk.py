"""A disk that is full, breaks or turns read-only at any call: the run stops with exit code 5, loses
nothing, and goes on later.
"""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from command_line import call, call_outside, read_info
from scenes import write_small
from store_support import continue_run, drive, ends_of, errors_of, make_model, make_run
from system_calls import hooked
from trials import thinned, trials

from multicor_cli.running.outcome import ExitCode, exit_code_of
from multicor_cli.store import DamagedRun, RunDirectory, StorageError, run_info

GROWING = (
    "pwrite",
    "write",
    "posix_fallocate",
    "mkdir",
    "replace",
    "rename",
    "link",
    "symlink",
    "fsync",
)
"""Calls that a full disk may refuse, besides the creation of files."""


class Failing:
    """Lets the ``k``-th call below a directory that a fault can hit fail, and all later ones if the
    fault stays.
    """

    def __init__(self, root: Path, number: int, k: int | None, *, stays: bool) -> None:
        self.count = 0
        self._root, self._errno, self._k, self._stays = root, number, k, stays
        self._open: set[int] = set()

    def hook(self, name: str, args: tuple[Any, ...], call: Callable[[], Any]) -> Any:
        if self._is_ours(args) and self._can_fail(name, args):
            self.count += 1
            if self._k is not None and (
                self.count == self._k or (self._stays and self.count > self._k)
            ):
                raise OSError(
                    self._errno,
                    os.strerror(self._errno),
                    *(args[:1] if not isinstance(args[0], int) else ()),
                )
        result = call()
        if name == "open" and self._is_ours(args):
            self._open.add(result)
        elif name == "close":
            self._open.discard(args[0])
        return result

    def _is_ours(self, args: tuple[Any, ...]) -> bool:
        return (
            args[0] in self._open
            if isinstance(args[0], int)
            else Path(args[0]).absolute().is_relative_to(self._root)
        )

    def _can_fail(self, name: str, args: tuple[Any, ...]) -> bool:
        if name == "close":
            return False
        if name == "open":
            return len(args) > 1 and bool(args[1] & os.O_CREAT)
        return self._errno != errno.ENOSPC or name in GROWING


@pytest.mark.parametrize(
    ("number", "stays"),
    [(errno.ENOSPC, True), (errno.ENOSPC, False), (errno.EIO, False), (errno.EROFS, True)],
    ids=["full", "full for a moment", "broken once", "read-only"],
)
@trials(short=2, long=100_000)
def test_any_call_may_fail(tmp_path: Path, number: int, stays: bool, count: int) -> None:
    continue_run(tmp_path / "whole")
    expected = ends_of(tmp_path / "whole")
    whole = Failing(tmp_path / "counted", number, None, stays=stays)
    with hooked(whole.hook):
        continue_run(tmp_path / "counted")
    assert whole.count > 100
    for k in range(1, whole.count + 1, -(-whole.count // count)):
        path = tmp_path / f"run-{k}"
        failing = Failing(path, number, k, stays=stays)
        failed = None
        with hooked(failing.hook):
            try:
                continue_run(path)
            except Exception as error:
                failed = error
        where = f"call {k} of {whole.count}: {failed!r}"
        assert failed is None or exit_code_of(failed) is ExitCode.ENVIRONMENT, where
        assert failed is None or str(path) in str(failed), where
        if RunDirectory.is_run(path):
            assert errors_of(path) == [], where
        continue_run(path)
        assert ends_of(path) == expected, where
        shutil.rmtree(path)
    print(
        f"{len(range(1, whole.count + 1, -(-whole.count // count)))} of {whole.count} calls failed"
    )


class Lying:
    """Changes a bit of what is written into HDF5 files by the ``k``-th call, without a word."""

    def __init__(self, root: Path, k: int | None) -> None:
        self.count = 0
        self._root, self._k = root, k
        self._open: dict[int, str] = {}

    def hook(self, name: str, args: tuple[Any, ...], call: Callable[[], Any]) -> Any:
        if (
            name == "pwrite"
            and self._open.get(args[0], "").endswith(".h5.tmp")
            and len(args[1]) > 64
        ):
            self.count += 1
            if self.count == self._k:
                wrong = bytearray(args[1])
                wrong[len(wrong) // 2] ^= 8
                return self._write(args[0], bytes(wrong), args[2])
        result = call()
        if name == "open" and Path(args[0]).absolute().is_relative_to(self._root):
            self._open[result] = str(args[0])
        elif name == "close":
            self._open.pop(args[0], None)
        return result

    def _write(self, descriptor: int, data: bytes, offset: int) -> int:
        return UNHOOKED_PWRITE(descriptor, data, offset)


UNHOOKED_PWRITE = os.pwrite


def begin_run(path: Path) -> None:
    """The first half of what `continue_run` does: what is written is still needed."""
    with make_run(path) as run:
        drive(run, make_model(), steps=20, checkpoint_every=15, finish=False)


@pytest.mark.parametrize("session", [begin_run, continue_run])
@trials(short=2, long=100_000)
def test_a_disk_that_lies(tmp_path: Path, session: Callable[[Path], None], count: int) -> None:
    """What is not read back as it was written is never committed; a bit that nobody reads may be
    wrong.
    """
    continue_run(tmp_path / "whole")
    expected = ends_of(tmp_path / "whole")
    whole = Lying(tmp_path / "counted", None)
    with hooked(whole.hook):
        session(tmp_path / "counted")
    noticed = 0
    for k in range(1, whole.count + 1, -(-whole.count // count)):
        path, failed = tmp_path / f"run-{k}", None
        with hooked(Lying(path, k).hook):
            try:
                session(path)
            # When it is compared, or already when HDF5 needs it again
            except (DamagedRun, StorageError) as error:
                failed = error
        noticed += failed is not None
        assert failed is None or str(path) in str(failed)
        assert errors_of(path) == [], f"call {k}: {failed}"
        continue_run(path)
        assert ends_of(path) == expected, f"call {k}"
        shutil.rmtree(path)
    print(f"{noticed} of {whole.count} noticed")
    assert noticed > 0


def test_a_text_that_is_not_as_written_is_not_committed(tmp_path: Path) -> None:
    """What ``results.h5`` says of the run beside its numbers; the segments, from which it could be
    made again, go after it.
    """
    count = 0

    def hook(name: str, args: tuple[Any, ...], call: Callable[[], Any]) -> Any:
        nonlocal count
        is_results = (
            name == "pwrite"
            and Path(f"/proc/self/fd/{args[0]}").readlink().name == "results.h5.tmp"
        )
        data = bytes(args[1]) if is_results else b""
        if b'"energy_closure"' not in data or count:
            return call()
        count += 1
        return UNHOOKED_PWRITE(
            args[0], data.replace(b'"energy_closure"', b'"energy_closurf"'), args[2]
        )

    begin_run(tmp_path / "run")
    with hooked(hook), pytest.raises(DamagedRun, match=r"results\.h5\.tmp"):
        continue_run(tmp_path / "run")
    assert count == 1
    assert errors_of(tmp_path / "run") == []
    continue_run(tmp_path / "run")
    assert run_info(tmp_path / "run")["status"] == "finished"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own, whose size can be changed."""
    path = tmp_path / "disk"
    path.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", path],
        capture_output=True,
        text=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"no file system can be mounted here: {mounted.stderr.strip()}")
    yield path
    subprocess.run(["umount", path], check=True)


@trials(short=1, long=24)
def test_real_disk_of_any_size(
    tmp_path: Path, small_disk: Path, finished: Path, count: int
) -> None:
    """On a file system from one on which not even the scenario fits to one that has room for
    everything but ``results.h5``.
    """
    need = sum(
        path.stat().st_size
        for path in finished.rglob("*")
        if path.is_file() and not path.is_symlink()
    )
    write_small(tmp_path)
    codes = []
    for k in range(count):
        resize(small_disk, 16_384 + round(need * (k + 0.5) / count * 1.5))
        run = small_disk / "run"
        done = call("run", "small.toml", "-o", run, cwd=tmp_path)
        codes.append(done.returncode)
        assert done.returncode in (0, 5), done.stderr
        assert "Traceback" not in done.stderr
        assert done.returncode == 0 or "space" in done.stderr
        resize(small_disk, 64 << 20)
        assert call("run", "small.toml", "-o", run, cwd=tmp_path).returncode == 0
        assert read_info(run)["data_digest"] == read_info(finished)["data_digest"]
        shutil.rmtree(run)
    assert 5 in codes


RESULTS = {
    "report": ("report", "RUN", "-o", "DISK/r.html"),
    "png": ("post", "map", "RUN", "--of", "velocity", "--plot", "DISK/m.png"),
    "svg": ("post", "map", "RUN", "--of", "velocity", "--plot", "DISK/m.svg"),
    "pdf": ("post", "map", "RUN", "--of", "velocity", "--plot", "DISK/m.pdf"),
    "film": ("post", "animate", "RUN", "--of", "velocity", "-o", "DISK/m.gif"),
    "csv": ("export", "csv", "RUN", "-o", "DISK/tables"),
    "gsd": ("export", "gsd", "RUN", "-o", "DISK/m.gsd"),
    "fclib": ("export", "fclib", "RUN", "-o", "DISK/m.h5"),
    "scenario": ("new", "DISK/mine"),
}


@pytest.mark.parametrize("command", thinned(RESULTS, 3))
def test_full_disk_leaves_nothing_of_what_is_made_of_a_run(
    command: tuple[str, ...], small_disk: Path, finished: Path
) -> None:
    (small_disk / "data").write_bytes(bytes(56_000))
    words = [
        word.replace("RUN", str(finished)).replace("DISK", str(small_disk)) for word in command
    ]
    done = call_outside(*words, cwd=finished.parent)
    assert done.returncode == 5, done.stderr
    assert "no space left" in done.stderr
    assert "continue" not in done.stderr  # nothing has begun: the same command begins anew
    assert str(small_disk) in done.stderr
    assert [path.name for path in small_disk.iterdir()] == ["data"]


def test_full_disk_keeps_the_scenario_that_was_to_be_replaced(
    small_disk: Path, finished: Path
) -> None:
    (small_disk / "mine.toml").write_text("precious")
    (small_disk / "data").write_bytes(bytes(56_000))
    assert call("new", small_disk / "mine", "--overwrite", cwd=finished.parent).returncode == 5
    assert (small_disk / "mine.toml").read_text() == "precious"


def resize(disk: Path, size: int) -> None:
    subprocess.run(["mount", "-o", f"remount,size={size}", disk], check=True)
