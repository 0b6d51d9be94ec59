"""Which walls bound the grains: decided by what the walls look like, whatever their kind and the
sizes of their grains."""

import numpy as np
import pytest
from made_up_frames import frame_of, source_of
from scenarios import plane, scenario

from multicor_cli.packing import build
from multicor_cli.post.bins import find_extent

GRAINS = {
    "count": 60, "sizes": {"kind": "uniform", "min": 0.8e-3, "max": 1.2e-3},
    "packing": {"kind": "random"}, "region": {"min": [0.0, 0.015], "max": [0.06, 0.045]},
}  # fmt: skip
LID = {"kind": "rough", "from": [0, 0.055], "to": [0.06, 0.055], "side": "right"}

LEVELS = {
    "wedge": ("polygon", [[0.003, 0], [0.057, 0], [0.057, 0.006], [0.003, 0.010]], 0.008),
    "bevelled": (
        "polygon", [[0.01, 0], [0.05, 0], [0.055, 0.004], [0.05, 0.008], [0.01, 0.008]],
        (0.04 * 0.008 + 0.005 * 0.006) / 0.045,
    ),
    "tray": ("polyline", [[0.004, 0.012], [0.004, 0.006], [0.056, 0.006], [0.056, 0.012]], 0.006),
    "bent": (
        "polyline", [[0, 0.004], [0.04, 0.004], [0.06, 0.010]], (0.04 * 0.004 + 0.02 * 0.007) / 0.06
    ),
}  # fmt: skip
"""Floors that are not level, or thick, and the mean height of what faces the grains [m]."""

ROUGH = {
    "equal": {"kind": "list", "radii": [0.5e-3]},
    "unequal": {"kind": "uniform", "min": 0.3e-3, "max": 0.6e-3},
}


def extent_of(**walls):
    """A frame of grains and these walls, its extent, and the walls below and above."""
    scene = scenario(size=[0.06, 0.08], periodic=True, grains=GRAINS, walls=walls)
    model, state = build(scene)
    frame = frame_of(state.position, wall_position=state.wall_position)
    extent = find_extent(source_of(model, [frame]), np.array([0]))
    names = [None if w is None else model.walls.names[w] for w in (extent.lower, extent.upper)]
    return frame, extent, tuple(names)


@pytest.mark.parametrize("name", LEVELS)
def test_heights_count_from_what_faces_the_grains(name):
    """Of a floor, and of the same wall turned over, as a lid."""
    kind, points, level = LEVELS[name]
    more = {"kind": kind, **({"grains": "outside"} if kind == "polygon" else {})}
    frame, extent, _ = extent_of(floor={**more, "points": points}, lid=LID)
    assert (extent.origin(frame), extent.span(frame)) == pytest.approx((level, 0.055 - level))
    turned = [[x, 0.06 - y] for x, y in points]
    frame, extent, _ = extent_of(plane=plane(0.001), ceiling={**more, "points": turned})
    expected = (0.001, 0.06 - level - 0.001)
    assert (extent.origin(frame), extent.span(frame)) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("rough", "radius"),
    [*((rough, r) for rough in ROUGH for r in (1.3e-3, 2e-3, 5e-3)),
     *((rough, r) for rough in (None, "cluster") for r in (0.7e-3, 1.2e-3, 5e-3))],
)  # fmt: skip
def test_a_disc_bounds_none_whatever_its_size(rough, radius):
    disc = {"kind": "disc", "center": [0.03, 0.005], "radius": radius}
    if rough == "cluster":
        disc = {"kind": "cluster", "discs": [[0.03, 0.005, radius]]}
    elif rough:
        disc["rough"] = ROUGH[rough]
    assert extent_of(body=disc, lid=LID)[2] == (None, "lid")
