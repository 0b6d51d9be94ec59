"""Short runs end with their frozen digests: here, and on a machine that has as little in common with this one as can be had."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from digest_cases import CASES, SHIPPED
from digest_run import differences, frozen, run_cases
from machines import another_machine

from multicor_cli.state.nudge import VARIABLE, nudge_seed

HERE = Path(__file__).parent
PYTHONPATH = str(HERE.parents[1])

pytestmark = pytest.mark.skipif(nudge_seed() is not None, reason=f"{VARIABLE} moves the positions whose bits are frozen")


def test_every_case_is_frozen():
    assert list(frozen()) == list(CASES)


def test_frozen_digests_hold_here(tmp_path):
    """The shipped scenarios are run with the tests of ``configs/``."""
    names = [name for name in CASES if name not in SHIPPED]
    assert differences(run_cases(names, tmp_path, threads=2)) == []


def call(*arguments: str) -> str:
    """Run Python on the other machine; what it prints."""
    environment = {**os.environ, **another_machine(), "PYTHONPATH": PYTHONPATH}
    done = subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_frozen_digests_hold_on_another_machine(tmp_path):
    """No optional instruction in NumPy, the C library, OpenBLAS and the kernels; four threads."""
    call(str(HERE), "--threads", "4", "--json", str(tmp_path / "digests.json"))
    assert json.loads((tmp_path / "digests.json").read_text()) == frozen()


def test_another_machine_is_another_one():
    features = json.loads(
        call("-c", "import json; from numpy._core import _multiarray_umath as n; print(json.dumps(n.__cpu_features__))")
    )
    optional = another_machine()["NPY_DISABLE_CPU_FEATURES"].split()
    assert optional
    assert not any(features[name] for name in optional)


def test_a_changed_bit_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "1")
    assert differences(run_cases(["lattice14"], tmp_path, threads=1)) != []
