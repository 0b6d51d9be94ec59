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

from multicor_cli.model.nudge import VARIABLE, nudge_seed

HERE = Path(__file__).parent
PYTHONPATH = str(HERE.parents[1])

pytestmark = pytest.mark.skipif(nudge_seed() is not None, reason=f"{VARIABLE} moves the positions whose bits are frozen")


KERNELS_OF_ITS_OWN = ("law-moving-walls", "sizes-lognormal-mass")
"""Cases for a processor that has to compile its own kernels; `machines.py` takes all of them."""


def test_every_case_is_frozen():
    assert list(frozen()) == list(CASES)


def test_frozen_digests_hold_here(tmp_path):
    """The shipped scenarios are run with the tests of ``configs/``."""
    names = [name for name in CASES if name not in SHIPPED]
    assert differences(run_cases(names, tmp_path, threads=2)) == []


def call(*arguments: str, **environment: str) -> str:
    """Run Python elsewhere; what it prints."""
    everything = {**os.environ, **environment, "PYTHONPATH": PYTHONPATH}
    done = subprocess.run([sys.executable, *arguments], env=everything, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_frozen_digests_hold_on_another_machine(tmp_path):
    """No optional instruction in NumPy, the C library and OpenBLAS; four threads."""
    elsewhere = {name: value for name, value in another_machine().items() if name != "NUMBA_CPU_NAME"}
    names = [name for name in CASES if name not in SHIPPED]
    call(str(HERE), "--threads", "4", "--json", str(tmp_path / "digests.json"), *names, **elsewhere)
    assert json.loads((tmp_path / "digests.json").read_text()) == {name: frozen()[name] for name in names}


def test_frozen_digests_hold_with_other_kernels(tmp_path):
    """No optional instruction in the kernels either."""
    call(str(HERE), "--json", str(tmp_path / "digests.json"), *KERNELS_OF_ITS_OWN, **another_machine())
    assert json.loads((tmp_path / "digests.json").read_text()) == {name: frozen()[name] for name in KERNELS_OF_ITS_OWN}


def test_another_machine_is_another_one():
    features = json.loads(
        call(
            "-c",
            "import json; from numpy._core import _multiarray_umath as n; print(json.dumps(n.__cpu_features__))",
            **another_machine(),
        )
    )
    optional = another_machine()["NPY_DISABLE_CPU_FEATURES"].split()
    assert optional
    assert not any(features[name] for name in optional)


def test_a_changed_bit_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "1")
    assert differences(run_cases(["lattice14"], tmp_path, threads=1)) != []
