"""Short runs end with their frozen digests: here, and on a machine that has as little in common
with this one as can be had."""

import json
from pathlib import Path

import pytest
from command_line import python
from digest_cases import CASES, SHIPPED
from digest_run import differences, frozen, run_cases
from machines import another_machine
from places import DATA

from multicor_cli.model.state import VARIABLE, nudge_seed

HERE = Path(__file__).parent

pytestmark = pytest.mark.skipif(
    nudge_seed() is not None, reason=f"{VARIABLE} moves the positions whose bits are frozen"
)


FOREIGN = (
    "packing-lattice-square", "packing-random-dense", "packing-compacted", "packing-tile-deposited",
    "sizes-lognormal-mass", "sizes-power-number", "sizes-uniform-mass",
    "law-rough-drum", "law-moving-walls", "law-friction-of-temperature",
    "law-heat-everything-implicit", "law-heat-of-impacts",
    "law-shapes",
)  # fmt: skip
"""Cases for the other machine: every elementary function and kind of law. `machines.py` takes all
cases."""

SOLVE = """
import hashlib, sys
import numpy as np
from multicor_cli.engine.jit import arrays
from multicor_cli.engine import ContactProblem, Settings, solve_contacts

values = np.linspace(1e-3, 1.0, 1001)
found = solve_contacts(ContactProblem.load(sys.argv[1]), Settings())
functions = (getattr(arrays, name) for name in ("exp", "log1p", "sin", "cos", "acos"))
results = [found.impulse, found.velocity, *(function(values) for function in functions)]
for result in results:
    digest = hashlib.blake2b(np.ascontiguousarray(result).tobytes(), digest_size=8)
    print(digest.hexdigest(), end=" ")
"""
"""Prints digests of a solved contact problem and of elementary functions of arrays."""


FEATURES = (
    "import json; from numpy._core import _multiarray_umath as n; "
    "print(json.dumps(n.__cpu_features__))"
)


def test_every_case_is_frozen():
    assert list(frozen()) == list(CASES)


def test_frozen_digests_hold_here(tmp_path):
    """The shipped scenarios are run with the tests of ``configs/``."""
    names = [name for name in CASES if name not in SHIPPED]
    assert differences(run_cases(names, tmp_path, threads=2)) == []


def call(*words, **environment):
    """Run Python elsewhere; what it prints."""
    done = python(*words, cwd=HERE, timeout=500, **environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_frozen_digests_hold_on_another_machine(tmp_path):
    """No optional instruction in NumPy, the C library and OpenBLAS; four threads."""
    elsewhere, file = another_machine(), tmp_path / "digests.json"
    del elsewhere["NUMBA_CPU_NAME"]
    call(HERE, "--threads", "4", "--json", file, *FOREIGN, **elsewhere)
    assert json.loads(file.read_text()) == {name: frozen()[name] for name in FOREIGN}


def test_kernels_of_another_machine_give_the_same_bits():
    """No optional instruction in the kernels either; few of them, as they have to be compiled for
    it."""
    words = "-c", SOLVE, DATA / "bed-1008.npz"
    assert call(*words, **another_machine()) == call(*words)


def test_another_machine_is_another_one():
    features = json.loads(call("-c", FEATURES, **another_machine()))
    optional = another_machine()["NPY_DISABLE_CPU_FEATURES"].split()
    assert optional
    assert not any(features[name] for name in optional)


def test_a_changed_bit_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "1")
    assert differences(run_cases(["lattice14"], tmp_path, threads=1)) != []
