"""Which walls bound the grains: decided by what the walls look like, whatever their kind and the sizes of their grains."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from made_up_frames import source_of
from packing_support import scenario, wall

from multicor_cli.packing import build
from multicor_cli.post.extent import find_extent

SEEDS = range(6)
GROUND = ("domain.periodic = true", "particles.0.count = 60", "particles.0.region = { min = [0.0, 0.015], max = [0.06, 0.045] }")
UNEQUAL = 'sizes = { kind = "uniform", min = 0.5e-3, max = 2e-3 }'
LARGE = 'sizes = { kind = "list", radii = [10e-3, 15e-3] }'

LAYERS = {
    "plane": ('kind = "plane", point = [0, 0.005], normal = [0, 1]', 'kind = "plane", point = [0, 0.055], normal = [0, -1]'),
    "rough": (
        'kind = "rough", from = [0, 0.005], to = [0.06, 0.005], side = "left"',
        'kind = "rough", from = [0, 0.055], to = [0.06, 0.055], side = "right"',
    ),
    "rough, unequal": (
        f'kind = "rough", from = [0, 0.005], to = [0.06, 0.005], side = "left", {UNEQUAL}',
        f'kind = "rough", from = [0, 0.055], to = [0.06, 0.055], side = "right", {UNEQUAL}',
    ),
    "rough, of two or three grains": (
        f'kind = "rough", from = [0, 0.005], to = [0.06, 0.005], side = "left", {LARGE}',
        f'kind = "rough", from = [0, 0.055], to = [0.06, 0.055], side = "right", {LARGE}',
    ),
    "polyline": (
        'kind = "polyline", points = [[0, 0.005], [0.06, 0.005]]',
        'kind = "polyline", points = [[0, 0.055], [0.06, 0.055]]',
    ),
    "polygon": (
        'kind = "polygon", points = [[0.001, 0], [0.059, 0], [0.059, 0.005], [0.001, 0.005]], grains = "outside"',
        'kind = "polygon", points = [[0.001, 0.055], [0.059, 0.055], [0.059, 0.06], [0.001, 0.06]], grains = "outside"',
    ),
    "box": (
        'kind = "box", min = [0, 0.005], max = [0.06, 0.02], open = ["left", "right", "top"]',
        'kind = "box", min = [0, 0.04], max = [0.06, 0.055], open = ["left", "right", "bottom"]',
    ),
    "cluster": (
        f'kind = "cluster", discs = {[[2e-3 * k + 1e-3, 0.005, 1e-3] for k in range(29)]}',
        f'kind = "cluster", discs = {[[8e-3 * (k + 1), 0.055, 4e-3 * (1.0 - 0.01 * k)] for k in range(6)]}',
    ),
}
"""Geometries of a floor and of a lid."""

BODIES = {
    "disc": 'kind = "disc", center = [0.03, 0.005], radius = RADIUS',
    "rough disc": 'kind = "disc", center = [0.03, 0.005], radius = RADIUS, rough = { kind = "list", radii = [0.5e-3] }',
    "rough disc, unequal": 'kind = "disc", center = [0.03, 0.005], radius = RADIUS, '
    'rough = { kind = "uniform", min = 0.3e-3, max = 0.6e-3 }',
    "cluster of one": 'kind = "cluster", discs = [[0.03, 0.005, RADIUS]]',
}
"""Geometries of discs, which bound no layer."""


def bounds(seed: int, *walls: str) -> tuple[str | None, ...]:
    """Names of the walls below and above the grains of the scenario."""
    model, state = build(scenario(*GROUND, f"scenario.seed = {seed}", extra="".join(walls)))
    frame = SimpleNamespace(position=state.position, wall_position=state.wall_position)
    extent = find_extent(source_of(model, [frame]), np.array([0]))
    return tuple(None if w is None else model.walls.names[w] for w in (extent.lower, extent.upper))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", LAYERS)
def test_a_floor_and_a_lid_of_every_kind_bound_a_layer(kind: str, seed: int) -> None:
    below, above = LAYERS[kind]
    assert bounds(seed, wall("floor", below), wall("lid", above)) == ("floor", "lid")


@pytest.mark.parametrize("radius", ["0.7e-3", "1.2e-3", "5e-3"])
@pytest.mark.parametrize("kind", BODIES)
def test_a_disc_bounds_none_whatever_its_size(kind: str, radius: str) -> None:
    if "rough" in kind and radius != "5e-3":
        radius = {"0.7e-3": "1.3e-3", "1.2e-3": "2e-3"}[radius]
    assert bounds(1, wall("body", BODIES[kind].replace("RADIUS", radius)), wall("lid", LAYERS["rough"][1])) == (None, "lid")
