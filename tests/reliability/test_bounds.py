"""Kernels read and write within their arrays, and machine code does what its source says."""

import h5py
import numpy as np
import pytest
from command_line import call_outside, read_info
from places import ROOT
from scenes import SMALL, WARM

FEW = (
    "particles.0.count=40", "loading.0.duration=0.003", "loading.2.duration=0.001",
    "loading.3.duration=0.001",
)  # fmt: skip
"""Makes the warm scenario short enough to be interpreted."""

SCENARIOS = {"small": SMALL, "warm": WARM}


def run(directory, scenario, name, *options, **variables):
    done = call_outside("run", scenario, "-o", name, "-q", *options, cwd=directory, **variables)
    assert done.returncode in (0, 75), done.stderr


def largest_difference(one, other):
    """Largest difference of two arrays, relative to the largest value in them; NaN stands for
    "none" in both."""
    first, second = (np.asarray(dataset[()], float) for dataset in (one, other))
    assert first.shape == second.shape
    assert np.array_equal(np.isnan(first), np.isnan(second))
    scale = np.nanmax(np.abs(first), initial=0.0)
    return float(np.nanmax(np.abs(first - second), initial=0.0) / scale) if scale else 0.0


def test_interpreted_kernels_agree_with_compiled_ones(tmp_path):
    """Python itself refuses an index beyond the end of an array; its elementary functions differ in
    the last bit."""
    (tmp_path / "warm.toml").write_text(WARM)
    options = [item for setting in FEW for item in ("--set", setting)]
    run(tmp_path, "warm.toml", "compiled", *options)
    run(tmp_path, "warm.toml", "interpreted", *options, NUMBA_DISABLE_JIT="1")
    compared = 0
    with (
        h5py.File(tmp_path / "compiled/results.h5") as one,
        h5py.File(tmp_path / "interpreted/results.h5") as other,
    ):
        for group in ("particles", "walls", "contacts"):
            for name, dataset in one[group].items():
                if dataset.dtype.kind in "fiu" and dataset.size:
                    assert largest_difference(dataset, other[group][name]) < 1e-9, f"{group}/{name}"
                    compared += 1
    assert compared > 20


@pytest.mark.reliability
@pytest.mark.timeout(3600)
def test_no_kernel_leaves_its_arrays(tmp_path):
    """With every index checked: the same bits, and the shipped scenarios run for a while."""
    checked = {"NUMBA_BOUNDSCHECK": "1", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    for name, text in SCENARIOS.items():
        (tmp_path / f"{name}.toml").write_text(text)
        run(tmp_path, f"{name}.toml", f"{name}-plain")
        run(tmp_path, f"{name}.toml", f"{name}-checked", **checked)
        plain, other = (read_info(tmp_path / f"{name}-{how}") for how in ("plain", "checked"))
        assert plain["data_digest"] == other["data_digest"]
    shipped = [path for path in sorted((ROOT / "configs").glob("*.toml")) if path.stem != "million"]
    for path in shipped:
        run(tmp_path, path, path.stem, "--max-hours", "0.02", "--threads", "2", **checked)
    print(f"{len(SCENARIOS)} scenarios with the same bits, {len(shipped)} shipped ones run so")
