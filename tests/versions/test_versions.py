"""Every command, and the frozen digests, with the lowest and the newest libraries that
pyproject.toml admits.

Environments are made with uv, of a source distribution. ``MULTICOR_PYTHONS`` names interpreters,
separated by colons; without it there is the one that runs the tests.
"""

import os
import subprocess
import sys
import tarfile

import pytest
from places import ROOT

pytestmark = [pytest.mark.versions, pytest.mark.timeout(3600)]

PYTHONS = os.environ.get("MULTICOR_PYTHONS", sys.executable).split(":")


def call(*words, cwd, **variables):
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        words, cwd=cwd, env={**kept, **variables}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """An unpacked source distribution."""
    folder = tmp_path_factory.mktemp("source")
    call(sys.executable, "-m", "build", "--sdist", "--outdir", folder, ROOT, cwd=folder)
    (path,) = folder.iterdir()
    with tarfile.open(path) as file:
        file.extractall(folder, filter="data")
    return folder / path.name.removesuffix(".tar.gz")


@pytest.mark.parametrize("resolution", ["lowest-direct", "highest"])
@pytest.mark.parametrize("python", PYTHONS)
def test_every_command_and_every_digest(python, resolution, source, tmp_path):
    call("uv", "venv", "--python", python, tmp_path / "venv", cwd=tmp_path)
    there = tmp_path / "venv" / "bin" / "python"
    # The lowest for which there are wheels
    wheels = ("--only-binary", ":all:", "--no-binary", "multicor-cli")
    install = ("uv", "pip", "install", "--python", there, "--resolution", resolution)
    call(*install, *wheels, f"{source}[plots,gsd,shapes,study]", cwd=tmp_path)
    print(call("uv", "pip", "list", "--python", there, cwd=tmp_path))
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    print(call(there, source / "tests" / "support" / "every_command.py", cwd=tmp_path, **cache))
    print(call(there, source / "tests" / "digests", cwd=tmp_path, **cache))
    call(there.with_name("multicor"), "run", "configs/shear.toml", "--dry-run", cwd=source, **cache)
