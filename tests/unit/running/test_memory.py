"""Freed memory stays in the process."""

import subprocess
import sys

import pytest

CODE = """
import resource, sys
import numpy as np
from multicor_cli.running.memory import keep_freed_memory
if sys.argv[1] == "keep" and not keep_freed_memory():
    print("unknown")
    sys.exit()
for _ in range(3):
    np.empty(1_000_000).fill(1.0)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    np.empty(1_000_000).fill(1.0)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(way):
    done = subprocess.run([sys.executable, "-c", CODE, way], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_arrays_are_not_fetched_from_the_system_again_and_again():
    kept = faults("keep")
    if kept == "unknown":
        pytest.skip("the C library has no mallopt")
    assert int(kept) < 200  # twenty arrays of 2,000 pages
