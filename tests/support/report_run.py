"""Runs for tests of the report, and its packed numbers read as its scripts read them."""

import base64
import itertools
import json
import re
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from heat_run import GRAINS, heated_model, write_frames

from multicor_cli.model import Model, State
from multicor_cli.store import RunDirectory

EVIL = "</script><script>window.broken = 1</script><img src=x onerror='window.broken = 2'>&amp;"
"""What must arrive in the page as text and nothing else; JSON and TOML strings may hold it."""


def write_evil_run(
    path: Path, *, frames: int = 6, is_finished: bool = True, is_crossing: bool = True
) -> Model:
    """A run with heat, every text `EVIL`: a plane, a glued disc, a segment, a circle move."""
    model = heated_model()
    names = (f"bottom {EVIL}", "top")
    shapes = replace(
        model.shapes,
        kind=np.array([1, 1, 0, 2, 4], np.int32),
        wall=np.array([0, 1, 1, 1, 0], np.int32),
        geometry=np.array([[0, 0, 0, 1], [0, 1, 0, -1], [1, 1, 0.1, 0], [0.5, 0.2, 1, 0.4],
            [2, 0.5, 0.6, 0]], np.float64),
        material=np.zeros(5, np.int32),
    )  # fmt: skip
    model = replace(
        model, walls=replace(model.walls, names=names), shapes=shapes, groups=(EVIL, "other")
    )
    model = replace(
        model, grains=replace(model.grains, group=np.arange(GRAINS, dtype=np.int32) % 2)
    )
    source = f"# {EVIL}\n[scenario]\nname = '''{EVIL}'''\ndescription = '''{EVIL}'''\n"
    with RunDirectory.create(
        path, source, source, {"seed": 1, "command": EVIL}, stages=(EVIL,)
    ) as run:
        write_frames(run, model, lambda state: _advance(state, model, is_crossing), frames)
        if is_finished:
            run.finish("finished")
    return model


def _advance(state: State, model: Model, is_crossing: bool) -> None:
    """The grains go round the period, each with a speed, spin and heat of its own."""
    number = np.arange(GRAINS)
    state.step += 1
    state.time += 0.5
    state.last_dt = 0.1
    state.position[:, 0] = (2.0 + (0.4975 if is_crossing else 0.0) * state.step) % model.period
    state.velocity[:, 0], state.velocity[:, 2] = 0.1 * number, number - 5.0
    assert model.thermal is not None
    state.heat = model.thermal.capacity * (0.005 * number + 0.001 * state.step)
    state.generated = 1e-3 * number * state.time
    state.wall_position[1] = [0.05 * state.step, 0.02, 0.1 * state.step]
    state.window[:2] = 0.5, 5.0


def read_page(page: str) -> tuple[dict[str, Any], list[dict[str, np.ndarray]], np.ndarray]:
    """What a page's scripts find: the JSON, integers of each frame by name, and the radii."""
    meta = json.loads(_element(page, "meta"))
    frames = [
        _arrays(page, f"frame-{number}", about["arrays"])
        for number, about in enumerate(meta["frames"])
    ]
    planes = np.frombuffer(
        zlib.decompress(base64.b64decode(_element(page, "radii"))), np.uint8
    ).reshape(4, -1)
    return meta, frames, np.ascontiguousarray(planes.T).view("<f4")[:, 0]


def read_looks(page: str) -> list[list[np.ndarray]]:
    """The rings around each grain in its radii, shape ``(p, 2)``; none of discs."""
    meta = json.loads(_element(page, "meta"))
    arrays = _arrays(page, "looks", meta["looks"])
    points = np.column_stack([decode(meta, "look", arrays[axis]) for axis in "xy"])
    rings = np.split(points, np.cumsum(arrays["points"])[:-1])
    ends = np.cumsum(arrays["rings"]).tolist()
    looks = [[], *(rings[a:b] for a, b in itertools.pairwise([0, *ends]))]
    return [looks[number] for number in arrays["look"]]


def _arrays(page: str, element: str, layout: list[tuple[str, int, int]]) -> dict[str, np.ndarray]:
    """Integers of an element by name."""
    data, arrays = zlib.decompress(base64.b64decode(_element(page, element))), {}
    for name, width, count in layout:
        planes = np.frombuffer(data[: width * count], np.uint8).reshape(width, count)
        powers = 256 ** np.arange(width)[:, np.newaxis]
        arrays[name] = (planes.astype(np.int64) * powers).sum(axis=0)
        data = data[width * count :]
    assert not data
    return arrays


def _element(page: str, name: str) -> str:
    return re.search(f'<script type="[a-z/]*" id="{name}">(.*?)</script>', page, re.DOTALL).group(1)


def decode(meta: dict[str, Any], name: str, codes: np.ndarray) -> np.ndarray:
    """Numbers of integers, as ``data.js`` computes them."""
    code = meta["codes"][name]
    share = codes / code["largest"]
    place = {
        "even": share,
        "square": share**2,
        "signed": 0.5 + 0.5 * (2.0 * share - 1.0) * np.abs(2.0 * share - 1.0),
    }
    numbers = code["low"] + (code["high"] - code["low"]) * place[code["spacing"]]
    return np.where(codes > code["largest"], np.nan, numbers)
