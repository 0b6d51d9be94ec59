"""The types of the package are right. (A test, so that the check runs beside others.)"""

import subprocess
import sys

from places import ROOT


def test_types_are_right():
    done = subprocess.run(
        [sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
