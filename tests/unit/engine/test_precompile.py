"""What a second process compiles is what a run asks for."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scenarios import toml

from multicor_cli.engine.jit import cache
from multicor_cli.running.machine import shared_compilation

HARD = {
    "has_clusters", "choose_patch", "solve_patch", "begin_again", "is_converged", "hold", "release",
    "step_back", "keep_in_mind",
}  # fmt: skip
"""Kernels that only some steps need."""

OVERLAPPED = {"deep_pairs", "both_ways", "push_apart"}
"""Kernels that only steps with overlaps need."""

LATE = {"closing_soon", "contacts_with_walls", "make_rows", "merge_late", "place_late"}
"""Kernels that only steps need in which a pair comes late, as in a flow."""

LOADED = {"totals_of_places", "_conduct_sides"}
"""Short kernels that only sides need that carry a load and conduct."""

FIRST = {
    "neighbors", "affine", "scene", "placing", "overlap", "arrays", "moves", "drift",
    "compile", "contacts", "relaxation",
}  # fmt: skip
"""Modules whose kernels are needed before the other process comes to them."""

LIST = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher
{code}
found = {{}}
for one in gc.get_objects():
    if isinstance(one, Dispatcher) and one.stats.cache_hits:
        name = one.py_func.__module__ + "." + one.py_func.__qualname__
        found[name] = sorted(map(str, one.stats.cache_hits))
print(json.dumps(found))
"""
PRECOMPILE = (
    "from multicor_cli.engine.precompile import precompile\nprecompile(has_shapes={has_shapes})"
)
STEP = {
    False: "from multicor_cli.bench.driving import prepare\n"
    "from multicor_cli.bench.scenes import START\n"
    "scene = prepare(START, 100, threads=1)\nscene.take(START.steps)\nscene.engine.contacts()",
    True: "import multicor_cli, tempfile\nfrom multicor_cli.scenario import parse_scenario\n"
    "with tempfile.TemporaryDirectory() as folder:\n"
    "    scenario = parse_scenario({pentagons!r}, 'pentagons.toml')\n"
    "    multicor_cli.run(scenario, folder + '/run', threads=1)",
}
"""Steps of discs, and of grains of another shape, that fall on a floor and conduct heat."""

FLOW = (
    "from multicor_cli.bench.driving import prepare\nfrom multicor_cli.bench.scenes import SCENES\n"
    "prepare(SCENES['shear-dynamic'], 400, threads=1).take(40)"
)

PENTAGONS = toml(
    grains={"count": 20, "shape": {"kind": "polygon", "sides": 5}}, heat={"temperature": 300.0},
    duration=0.05, size=[0.02, 0.02], periodic=True, output={"frame_interval": 0.01},
)  # fmt: skip


def loaded(code):
    """Kernels that a process loads from the cache, and for which kinds of arguments; a first
    process has compiled them."""
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", LIST.format(code=code)], capture_output=True, text=True,
            check=True,
        )  # fmt: skip
    return json.loads(done.stdout)


@pytest.mark.parametrize("has_shapes", [False, True])
def test_precompilation_compiles_what_a_run_asks_for_and_nothing_else(has_shapes):
    rehearsed = loaded(PRECOMPILE.format(has_shapes=has_shapes))
    asked = loaded(STEP[has_shapes].format(pentagons=PENTAGONS))
    flow = {} if has_shapes else loaded(FLOW)
    for name, kinds in rehearsed.items():
        kernel = name.rpartition(".")[2]
        # The first steps have no overlaps
        if kernel not in HARD | OVERLAPPED:
            assert set(kinds) <= set((flow if kernel in LATE else asked)[name]), name
    for name in asked.keys() - rehearsed.keys():
        assert set(name.split(".")) & (FIRST | LOADED), name
    names = {name.rpartition(".")[2] for name in rehearsed}
    assert names >= HARD | {"iterate", "generate", "hertz_spots"}
    assert has_shapes == (names >= {"begin_faces", "account_faces", "points_up_to"})


def test_a_second_process_compiles_only_for_a_first_run_with_two_threads(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / cache.cache_name()))
    (tmp_path / cache.cache_name()).mkdir()
    with shared_compilation(2) as other:
        assert other.poll() is None
    assert other.poll() is not None
    with shared_compilation(1) as other:
        assert other is None
    with monkeypatch.context() as broken:
        broken.setattr(sys, "executable", str(tmp_path / "no-interpreter"))
        with shared_compilation(2) as other:
            assert other is None
    monkeypatch.setenv("MULTICOR_NO_CACHE", "1")
    with shared_compilation(2) as other:
        assert other is None
    monkeypatch.delenv("MULTICOR_NO_CACHE")
    (tmp_path / cache.cache_name() / "acceleration.iterate-9.py311.nbi").touch()
    with shared_compilation(2) as other:
        assert other is None
    with shared_compilation(2, has_shapes=True, has_heat=False) as other:
        assert {"shapes"} == {"shapes", "heat"} & set(other.args)


def test_the_second_process_ends_with_the_first(tmp_path):
    """However that ends: here it leaves without cleaning up."""
    code = (
        "import os\nfrom multicor_cli.running.machine import shared_compilation\n"
        "with shared_compilation(2) as other:\n    print(other.pid, flush=True)\n    os._exit(0)"
    )
    (tmp_path / cache.cache_name()).mkdir()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / cache.cache_name())}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    status = Path("/proc", done.stdout.strip(), "status")
    for _ in range(100):
        if not status.exists() or "State:\tZ" in status.read_text():
            return
        time.sleep(0.1)
    raise AssertionError("still running")
