"""Which walls bound the grains: decided by what the walls look like, whatever their kind and the
sizes of their grains.
"""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_frames import source_of
from packing_support import scenario, wall

from multicor_cli.model import Model
from multicor_cli.packing import build
from multicor_cli.post.bins import Extent, find_extent

GROUND = (
    "domain.periodic = true",
    "particles.0.count = 60",
    "particles.0.region = { min = [0.0, 0.015], max = [0.06, 0.045] }",
)
LID = wall("lid", 'kind = "rough", from = [0, 0.055], to = [0.06, 0.055], side = "right"')

BODIES = {
    "disc": 'kind = "disc", center = [0.03, 0.005], radius = RADIUS',
    "rough disc": (
        'kind = "disc", center = [0.03, 0.005], radius = RADIUS, rough = { kind = "list", radii = '
        "[0.5e-3] }"
    ),
    "rough disc, unequal": 'kind = "disc", center = [0.03, 0.005], radius = RADIUS, '
    'rough = { kind = "uniform", min = 0.3e-3, max = 0.6e-3 }',
    "cluster of one": 'kind = "cluster", discs = [[0.03, 0.005, RADIUS]]',
}
"""Geometries of discs, which bound no layer."""


LEVELS = {
    "wedge": (
        ('kind = "polygon", points = [[0.003, 0.0], [0.057, 0.0], [0.057, 0.006], [0.003, '
            '0.010]], grains = "outside"'), 0.008),
    "bevelled": (
        ('kind = "polygon", grains = "outside", points = [[0.01, 0], [0.05, 0], [0.055, 0.004], '
            '[0.05, 0.008], [0.01, 0.008]]'),
        (0.04 * 0.008 + 0.005 * 0.006) / 0.045),
    "tray": (('kind = "polyline", points = [[0.004, 0.012], [0.004, 0.006], [0.056, 0.006], '
        '[0.056, 0.012]]'), 0.006),
    "bent": ('kind = "polyline", points = [[0, 0.004], [0.04, 0.004], [0.06, 0.010]]',
        (0.04 * 0.004 + 0.02 * 0.007) / 0.06),
}  # fmt: skip
"""Floors that are not level, or thick, and the mean height of what faces the grains [m]."""


def extent_of(seed: int, *walls: str) -> tuple[Model, SimpleNamespace, Extent]:
    """Model, frame and extent of the scenario with these walls."""
    model, state = build(scenario(*GROUND, f"scenario.seed = {seed}", extra="".join(walls)))
    frame = SimpleNamespace(position=state.position, wall_position=state.wall_position)
    return model, frame, find_extent(source_of(model, [frame]), np.array([0]))


def bounds(*walls: str) -> tuple[str | None, ...]:
    """Names of the walls below and above the grains of the scenario."""
    model, _, extent = extent_of(1, *walls)
    return tuple(None if w is None else model.walls.names[w] for w in (extent.lower, extent.upper))


@pytest.mark.parametrize("kind", LEVELS)
def test_heights_count_from_what_faces_the_grains(kind: str) -> None:
    """Of a floor, and of the same wall turned over, as a lid."""
    geometry, level = LEVELS[kind]
    _, frame, extent = extent_of(1, wall("floor", geometry), LID)
    assert (extent.origin(frame), extent.span(frame)) == pytest.approx((level, 0.055 - level))
    turned = re.sub(
        r"\[([0-9.]+), ([0-9.]+)\]",
        lambda found: f"[{found[1]}, {0.06 - float(found[2]):.4f}]",
        geometry,
    )
    plane = wall("plane", 'kind = "plane", point = [0, 0.001], normal = [0, 1]')
    _, frame, extent = extent_of(1, plane, wall("ceiling", turned))
    assert (extent.origin(frame), extent.span(frame)) == pytest.approx(
        (0.001, 0.06 - level - 0.001)
    )


@pytest.mark.parametrize("radius", ["0.7e-3", "1.2e-3", "5e-3"])
@pytest.mark.parametrize("kind", BODIES)
def test_a_disc_bounds_none_whatever_its_size(kind: str, radius: str) -> None:
    if "rough" in kind and radius != "5e-3":
        radius = {"0.7e-3": "1.3e-3", "1.2e-3": "2e-3"}[radius]
    assert bounds(wall("body", BODIES[kind].replace("RADIUS", radius)), LID) == (None, "lid")
