"""A disk that is full, breaks or turns read-only at any call: the run stops with exit code 5, loses
nothing, and goes on later."""

import errno
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import call, call_outside, read_info
from scenes import write_small
from store_support import continue_run, drive, ends_of, errors_of, make_model, make_run
from system_calls import hooked
from trials import thinned, trials

from multicor_cli.running.outcome import ExitCode, exit_code_of
from multicor_cli.store import DamagedRun, RunDirectory, StorageError, run_info

GROWING = (
    "pwrite", "write", "posix_fallocate", "mkdir", "replace", "rename", "link", "symlink", "fsync",
)  # fmt: skip
"""Calls that a full disk may refuse, besides the creation of files."""

UNHOOKED_PWRITE = os.pwrite


class Failing:
    """Lets the ``k``-th call below a directory that a fault can hit fail, and all later ones if the
    fault stays."""

    def __init__(self, root, number, k, *, stays):
        self.count = 0
        self._root, self._errno, self._k, self._stays = root, number, k, stays
        self._open = set()

    def hook(self, name, args, call):
        if self._is_ours(args) and self._can_fail(name, args):
            self.count += 1
            is_over = self._stays and self._k is not None and self.count > self._k
            if self.count == self._k or is_over:
                named = args[:1] if not isinstance(args[0], int) else ()
                raise OSError(self._errno, os.strerror(self._errno), *named)
        result = call()
        if name == "open" and self._is_ours(args):
            self._open.add(result)
        elif name == "close":
            self._open.discard(args[0])
        return result

    def _is_ours(self, args):
        if isinstance(args[0], int):
            return args[0] in self._open
        return Path(args[0]).absolute().is_relative_to(self._root)

    def _can_fail(self, name, args):
        if name == "close":
            return False
        if name == "open":
            return len(args) > 1 and bool(args[1] & os.O_CREAT)
        return self._errno != errno.ENOSPC or name in GROWING


class Lying:
    """Changes a bit of what is written into HDF5 files by the ``k``-th call, without a word."""

    def __init__(self, root, k):
        self.count = 0
        self._root, self._k = root, k
        self._open = {}

    def hook(self, name, args, call):
        is_hdf5 = self._open.get(args[0], "").endswith(".h5.tmp")
        if name == "pwrite" and is_hdf5 and len(args[1]) > 64:
            self.count += 1
            if self.count == self._k:
                wrong = bytearray(args[1])
                wrong[len(wrong) // 2] ^= 8
                return UNHOOKED_PWRITE(args[0], bytes(wrong), args[2])
        result = call()
        if name == "open" and Path(args[0]).absolute().is_relative_to(self._root):
            self._open[result] = str(args[0])
        elif name == "close":
            self._open.pop(args[0], None)
        return result


def begin_run(path):
    """The first half of what `continue_run` does: what is written is still needed."""
    with make_run(path) as run:
        drive(run, make_model(), steps=20, checkpoint_every=15, finish=False)


def each_call_fails(tmp_path, make_disk, session, count, is_right):
    """Carry a session out on disks that fail at ``count`` of all calls; after each the run is whole
    and goes on to its end. Gives how many failures were noticed (by what `is_right`), of how many.
    """
    continue_run(tmp_path / "whole")
    expected = ends_of(tmp_path / "whole")
    whole = make_disk(tmp_path / "counted", None)
    with hooked(whole.hook):
        session(tmp_path / "counted")
    noticed = 0
    for k in range(1, whole.count + 1, -(-whole.count // count)):
        path, failed = tmp_path / f"run-{k}", None
        with hooked(make_disk(path, k).hook):
            try:
                session(path)
            except Exception as error:
                failed = error
        where = f"call {k} of {whole.count}: {failed!r}"
        noticed += failed is not None
        assert failed is None or (is_right(failed) and str(path) in str(failed)), where
        if RunDirectory.is_run(path):
            assert errors_of(path) == [], where
        continue_run(path)
        assert ends_of(path) == expected, where
        shutil.rmtree(path)
    print(f"{noticed} of {whole.count} noticed")
    return noticed, whole.count


@pytest.mark.parametrize(
    ("number", "stays"),
    [(errno.ENOSPC, True), (errno.ENOSPC, False), (errno.EIO, False), (errno.EROFS, True)],
    ids=["full", "full for a moment", "broken once", "read-only"],
)
@trials(short=2, long=100_000)
def test_any_call_may_fail(tmp_path, number, stays, count):
    def make_disk(root, k):
        return Failing(root, number, k, stays=stays)

    def is_right(error):
        return exit_code_of(error) is ExitCode.ENVIRONMENT

    _, calls = each_call_fails(tmp_path, make_disk, continue_run, count, is_right)
    assert calls > 100


@pytest.mark.parametrize("session", [begin_run, continue_run])
@trials(short=2, long=100_000)
def test_a_disk_that_lies(tmp_path, session, count):
    """What is not read back as it was written is never committed; a bit that nobody reads may be
    wrong. It is noticed when it is compared, or already when HDF5 needs it again."""

    def is_right(error):
        return isinstance(error, DamagedRun | StorageError)

    noticed, _ = each_call_fails(tmp_path, Lying, session, count, is_right)
    assert noticed > 0


def test_a_text_that_is_not_as_written_is_not_committed(tmp_path):
    """What ``results.h5`` says of the run beside its numbers; the segments, from which it could be
    made again, go after it."""
    count = 0

    def hook(name, args, call):
        nonlocal count
        if name != "pwrite" or count or b'"energy_closure"' not in bytes(args[1]):
            return call()
        if Path(f"/proc/self/fd/{args[0]}").readlink().name != "results.h5.tmp":
            return call()
        count += 1
        wrong = bytes(args[1]).replace(b'"energy_closure"', b'"energy_closurf"')
        return UNHOOKED_PWRITE(args[0], wrong, args[2])

    begin_run(tmp_path / "run")
    with hooked(hook), pytest.raises(DamagedRun, match=r"results\.h5\.tmp"):
        continue_run(tmp_path / "run")
    assert count == 1
    assert errors_of(tmp_path / "run") == []
    continue_run(tmp_path / "run")
    assert run_info(tmp_path / "run")["status"] == "finished"


@pytest.fixture
def small_disk(tmp_path):
    """A file system of its own, whose size can be changed."""
    path = tmp_path / "disk"
    path.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", path]
    mounted = subprocess.run(mount, capture_output=True, text=True, check=False)
    if mounted.returncode:
        pytest.skip(f"no file system can be mounted here: {mounted.stderr.strip()}")
    yield path
    subprocess.run(["umount", path], check=True)


def resize(disk, size):
    subprocess.run(["mount", "-o", f"remount,size={size}", disk], check=True)


@trials(short=1, long=24)
def test_real_disk_of_any_size(tmp_path, small_disk, finished, count):
    """On a file system from one on which not even the scenario fits to one that has room for
    everything but ``results.h5``."""
    files = [path for path in finished.rglob("*") if path.is_file() and not path.is_symlink()]
    need = sum(path.stat().st_size for path in files)
    write_small(tmp_path)
    codes, run = [], small_disk / "run"
    for k in range(count):
        resize(small_disk, 16_384 + round(need * (k + 0.5) / count * 1.5))
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
    "report": "report RUN -o DISK/r.html",
    "png": "post map RUN --of velocity --plot DISK/m.png",
    "svg": "post map RUN --of velocity --plot DISK/m.svg",
    "pdf": "post map RUN --of velocity --plot DISK/m.pdf",
    "film": "post animate RUN --of velocity -o DISK/m.gif",
    "csv": "export csv RUN -o DISK/tables",
    "gsd": "export gsd RUN -o DISK/m.gsd",
    "fclib": "export fclib RUN -o DISK/m.h5",
    "scenario": "new DISK/mine",
}


@pytest.mark.parametrize("command", thinned(RESULTS, 3))
def test_full_disk_leaves_nothing_of_what_is_made_of_a_run(command, small_disk, finished):
    (small_disk / "data").write_bytes(bytes(56_000))
    words = command.replace("RUN", str(finished)).replace("DISK", str(small_disk)).split()
    done = call_outside(*words, cwd=finished.parent)
    assert done.returncode == 5, done.stderr
    assert "no space left" in done.stderr
    assert "continue" not in done.stderr  # nothing has begun: the same command begins anew
    assert str(small_disk) in done.stderr
    assert [path.name for path in small_disk.iterdir()] == ["data"]


def test_full_disk_keeps_the_scenario_that_was_to_be_replaced(small_disk, finished):
    (small_disk / "mine.toml").write_text("precious")
    (small_disk / "data").write_bytes(bytes(56_000))
    assert call("new", small_disk / "mine", "--overwrite", cwd=finished.parent).returncode == 5
    assert (small_disk / "mine.toml").read_text() == "precious"
