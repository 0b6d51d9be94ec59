"""Runs that earlier versions of the file format have left, kept in ``tests/data``: read, verified and continued.

Each archive holds a tiny scenario, a finished run of it, and one that was killed at step 8 of 20, after a checkpoint at step 7.
"""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np
import pytest
from small_run import call, read_info

from multicor_cli.store import open_run, verify
from multicor_cli.store.schema import FORMAT_VERSION

DATA = Path(__file__).parents[1] / "data"
VERSIONS = sorted(path.name.removeprefix("format-").removesuffix(".tar.xz") for path in DATA.glob("format-*.tar.xz"))


def test_there_is_data_of_the_version_of_now() -> None:
    assert ".".join(map(str, FORMAT_VERSION)) in VERSIONS


@pytest.fixture(params=VERSIONS)
def kept(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    with tarfile.open(DATA / f"format-{request.param}.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path


def test_finished_runs_are_read(kept: Path) -> None:
    assert verify(kept / "finished") == []
    info = read_info(kept / "finished")
    assert (info["status"], info["step"]) == ("finished", 20)
    with open_run(kept / "finished") as run:
        assert run.frames.step.tolist() == [0, 10, 20]
        height = [frame.position[:, 1].mean() for frame in run.frames]
        assert height[0] > height[1] > height[2]  # they fall
        assert run.model.grain_count == 12
        assert run.series["kinetic"][-1] > 0.0


def first_heap(tmp_path: Path) -> tuple[bytearray, int]:
    """Results in format 1.1, whose texts lie in heaps, and where the first heap begins."""
    with tarfile.open(DATA / "format-1.1.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    data = bytearray((tmp_path / "finished" / "results.h5").read_bytes())
    return data, data.index(b"GCOL")


def test_every_text_of_old_files_is_verified(tmp_path: Path) -> None:
    data, heap = first_heap(tmp_path)
    for index in range(1, 4):  # numbers of the first objects: who looks for one does not find it
        at = data.index(index.to_bytes(2, "little") + b"\0" * 6, heap + 16)
        damaged = bytearray(data)
        damaged[at] = 99
        (tmp_path / "results.h5").write_bytes(damaged)
        assert [finding.severity for finding in verify(tmp_path / "results.h5")] == ["error"]


@pytest.mark.parametrize("reserved", [0, 1], ids=["", "reserved byte"])
@pytest.mark.parametrize("fault", [0, 2**64 - 16, 1], ids=["no size", "a size that wraps around", "too short for its header"])
def test_texts_of_old_files_that_never_end_are_refused(tmp_path: Path, fault: int, reserved: int) -> None:
    """HDF5 looks for the next object of a heap behind this one, which has no size: in a process of its own, for it would hang."""
    data, heap = first_heap(tmp_path)
    is_free = fault != 2**64 - 16
    data[heap + 5] = reserved  # HDF5 does not look at it
    data[heap + 16 : heap + 32] = (0 if is_free else 1).to_bytes(8, "little") + fault.to_bytes(8, "little")
    alone = tmp_path / "results.h5"
    alone.write_bytes(data)
    for command in ("info", "verify"):
        done = call(command, alone, cwd=tmp_path)
        assert done.returncode == 7, done.stderr
        assert "no end" in done.stdout + done.stderr


def test_unfinished_runs_are_continued(kept: Path) -> None:
    """Another version of the program may end in other bits; the physics is the same."""
    assert verify(kept / "unfinished") == []
    done = call("run", "tiny.toml", "-o", "unfinished", cwd=kept)
    assert done.returncode == 0, done.stderr
    assert "continuing from step 7" in done.stderr
    assert verify(kept / "unfinished") == []
    with open_run(kept / "finished") as before, open_run(kept / "unfinished") as now:
        assert now.frames.step.tolist() == before.frames.step.tolist()
        for a, b in zip(before.frames, now.frames, strict=True):
            assert np.allclose(a.position, b.position, rtol=0.0, atol=1e-6)  # grains are a thousand times as large
