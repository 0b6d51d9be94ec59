"""Tiny runs that are made once, and copies of them to do things to."""

import shutil
from pathlib import Path

import pytest
from store_support import make_model, run_whole


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    path = tmp_path_factory.mktemp("finished") / "run"
    run_whole(path)
    return path


@pytest.fixture(scope="session")
def unfinished(tmp_path_factory):
    """Its checkpoints at steps 30 and 40 are kept; there are three segments."""
    path = tmp_path_factory.mktemp("unfinished") / "run"
    run_whole(path, finish=False)
    return path


@pytest.fixture(scope="session")
def heated(tmp_path_factory):
    path = tmp_path_factory.mktemp("heated") / "run"
    run_whole(path, make_model(heat=True))
    return path


@pytest.fixture
def copy(tmp_path, finished):
    return Path(shutil.copytree(finished, tmp_path / "copy", symlinks=True))


@pytest.fixture
def open_copy(tmp_path, unfinished):
    return Path(shutil.copytree(unfinished, tmp_path / "copy", symlinks=True))
