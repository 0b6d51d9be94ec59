"""Whole scenarios of what a test says of them: everything else is filled in.

::

    scenario()  # twenty discs of 1 mm fall onto a floor for 0.1 s
    scenario(friction=0.0, gravity=[0, 0], grains=[[0.02, 0.01, 1e-3, 0.5, 0.0]])
    scenario(walls={"floor": plane(), "lid": {"geometry": plane(0.05, -1), "mass": 1e-3}})
    scenario(loading=[{"duration": 0.1}, {"frozen": True, "duration": 60.0, "dt": 1.0}], heat={})
    scenario(grains={"count": 50, "shape": "sphere"}, overrides=["solver.dt=1e-4"])
    scenario('''
        [[walls]]
        name = "ramp"
        geometry = { kind = "polyline", points = [[0, 0.02], [0.1, 0.01]] }
    ''', duration=0.05)  # in TOML, without the keys that are the same in every test

`document` gives the tables, `toml` their text, `write` a file; `engine` is ready for the first
step. The fixture ``run`` carries a scenario out in this process and opens the run:
``frame = run(scenario(friction=0.0)).frames[-1]``.
"""

import atexit
import hashlib
import shutil
import tempfile
import tomllib
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import tomli_w
from places import ROOT

from multicor_cli import run
from multicor_cli.model import Model
from multicor_cli.packing import build
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import Scenario, load_scenario, parse_scenario
from multicor_cli.store import run_info

_TABLES = tomllib.loads("""
scenario = { name = "scene", seed = 1 }
domain = { size = [0.1, 0.1] }
materials.glass = { density = 2500.0, young = 70e9, poisson = 0.22, conductivity = 1.0, heat_capacity = 800.0 }
contacts = [{}]
particles = [{ sizes = { kind = "list", radii = [1e-3] }, count = 20, packing = { kind = "random" } }]
walls = [{ name = "floor", geometry = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] } }]
loading = [{}]
solver = { dt = 5e-4 }
output = { frame_interval = 0.02 }
""")

_EACH = tomllib.loads("""
contacts = { pair = ["*", "*"], friction = 0.4 }
particles = { name = "grains", material = "glass", shape = "disc" }
walls = { material = "glass" }
loading = { duration = 0.1 }
""")
"""What each table of an array has that does not say otherwise."""

_TABLE_OF = {
    **dict.fromkeys(("name", "seed"), "scenario"),
    **dict.fromkeys(("size", "periodic", "gravity"), "domain"),
    **dict.fromkeys(("friction", "restitution", "rolling_friction", "adhesion"), "contacts"),
    **dict.fromkeys(("duration", "drives", "until"), "loading"),
    **dict.fromkeys(("dt", "max_sweeps", "tolerance_rms"), "solver"),
    **dict.fromkeys(("frame_interval", "series_interval"), "output"),
}
"""Keys that may be said without their table: of an array, the first one's."""


def plane(height: float = 0.0, facing: int = 1) -> dict[str, Any]:
    """A level plane [m] under the grains, or above them (``facing`` −1)."""
    return {"kind": "plane", "point": [0.0, height], "normal": [0.0, float(facing)]}


def rows_of(grains: Sequence[Sequence[float]]) -> dict[str, Any]:
    """A packing from rows of x, y, radius [m] and, if longer, v_x, v_y [m/s] and spin [rad/s]."""
    width = max(3, *map(len, grains))
    rows = [
        ",".join(repr(float(value)) for value in (*row, 0.0, 0.0, 0.0)[:width]) for row in grains
    ]
    text = "\n".join([",".join(("x", "y", "radius", "vx", "vy", "spin")[:width]), *rows, ""])
    path = _files() / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.csv"
    path.write_text(text)
    return {"packing": {"kind": "file", "path": str(path)}}


_kept: list[Path] = []


def _files() -> Path:
    """Where rows of grains lie until the tests are over."""
    if not _kept:
        _kept.append(Path(tempfile.mkdtemp(prefix="grains-")))
        atexit.register(shutil.rmtree, _kept[0], ignore_errors=True)
    return _kept[0]


def document(text: str = "", **said: Any) -> dict[str, Any]:
    """The tables of a scenario.

    Args:
        text: Some of them, in TOML.
        **said: Others: a table or an array of tables by its name, a key of `_TABLE_OF` by its own.
            ``walls`` may be geometries, or tables, by their names. ``grains`` is the only group:
            a number, what it has besides, or rows of x, y, radius (`rows_of`).
    """
    said = tomllib.loads(text) | said
    keys = {key: said.pop(key) for key in [*said] if key in _TABLE_OF}
    grains, walls = said.pop("grains", None), said.get("walls")
    if isinstance(walls, dict):
        said["walls"] = [
            {"name": name, **(wall if "geometry" in wall else {"geometry": wall})}
            for name, wall in walls.items()
        ]
    tables: dict[str, Any] = deepcopy(_TABLES)
    if grains is not None:
        default = tables["particles"][0]
        tables["particles"] = [
            {**default, "count": grains} if isinstance(grains, int)
            else (grains if "packing" in grains else {**default, **grains}) if isinstance(grains,
                dict)
            else rows_of(grains)
        ]  # fmt: skip
    for name, table in said.items():
        is_added = isinstance(table, dict) and name in tables
        tables[name] = {**tables[name], **table} if is_added else deepcopy(table)
    for key, value in keys.items():
        table = tables[_TABLE_OF[key]]
        (table[0] if isinstance(table, list) else table)[key] = value
    for name, each in _EACH.items():
        tables[name] = [{**each, **table} for table in tables[name]]
    for group in tables["particles"]:
        if group["shape"] != "sphere":
            group.setdefault("thickness", 1e-3)
    return tables


def toml(text: str = "", **said: Any) -> str:
    return tomli_w.dumps(document(text, **said))


def scenario(text: str = "", *, overrides: Sequence[str] = (), **said: Any) -> Scenario:
    return parse_scenario(toml(text, **said), "scene.toml", overrides)


def write(path: Path, text: str = "", **said: Any) -> Path:
    path.write_text(toml(text, **said))
    return path


def run_config(name: str, directory: Path, *overrides: str) -> Path:
    """Carry out a scenario of ``configs``; returns the directory."""
    run(load_scenario(ROOT / "configs" / f"{name}.toml", overrides=overrides), directory)
    return directory


def engine(given: Scenario, *, threads: int = 1) -> tuple[Any, Model]:
    """The engine of a run, ready for ``step(dt, t)`` in the first stage, and its model."""
    model, state = build(given)
    stepper = make_engine(given, model, state, threads)
    stepper.pass_grains()
    begin_stage(stepper, make_plan(given, model).stages[0], [0.0])
    return stepper, model


def digests(directory: Path) -> tuple[str, str]:
    """What two runs have in common whose ends, frames and series are the same to the bit."""
    info = run_info(directory)
    return info["state_digest"], info["data_digest"]
