"""Polygons in Box2D; runs under an interpreter that has pyb2d3 and numpy.

Usage: box2d_worker.py IN.npz OUT.npz. IN is written by `shape_peers.ShapePeer.run`, with
``substeps`` of a step, ``hertz`` (stiffness of contacts, which a quarter of the rate of substeps
limits) and ``unit`` (what Box2D takes for a meter [m], of which its slop is 0.005). OUT holds the
arrays of `polygons.Seen`.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
import pyb2d3 as b2

_THICK = 10.0  # floor and sides [m]
_DAMPING, _PUSH = 10.0, 3.0  # of contacts, as Box2D has them [–, m/s]


def main(source: str, target: str) -> None:
    """Run it."""
    with np.load(source) as stored:
        data = dict(stored)
    b2.set_length_units_per_meter(float(data["unit"]))
    world = b2.World(gravity=tuple(data["gravity"].tolist()))
    world.sleeping_enabled = False
    world.set_contact_tuning(float(data["hertz"]), _DAMPING, _PUSH * float(data["unit"]))
    friction = float(data["friction"])
    for corners in _surroundings(data):
        _fill(world.create_static_body(position=(0.0, 0.0)), corners, friction)
    bodies, ends = [], np.cumsum(data["count"])
    for place, end, count in zip(data["place"].tolist(), ends, data["count"], strict=True):
        body = world.create_dynamic_body(position=tuple(place))
        _fill(body, data["corner"][end - count : end], friction)
        bodies.append(body)
    seconds, places, velocities = [], [], []
    for _ in range(int(data["frames"])):
        begin = time.process_time()
        for _ in range(int(data["every"])):
            world.step(float(data["dt"]), int(data["substeps"]))
        seconds.append(time.process_time() - begin)
        places.append([(*body.position, body.angle) for body in bodies])
        velocities.append([(*body.linear_velocity, body.angular_velocity) for body in bodies])
    np.savez(target, position=places, velocity=velocities, seconds=seconds)


def _surroundings(data: dict[str, Any]) -> list[Any]:
    """Corners of the floor and of the sides [m]."""
    width, high = float(data["width"]), 2.0 * float(data["place"].max()) + _THICK
    wide = width if width > 0.0 else 20.0 * high
    found = [_box(-wide, -_THICK, 2.0 * wide, 0.0)]
    if width > 0.0:
        found += [_box(-_THICK, -_THICK, 0.0, high), _box(width, -_THICK, width + _THICK, high)]
    return found


def _box(left: float, low: float, right: float, high: float) -> Any:
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def _fill(body: Any, corners: Any, friction: float) -> None:
    material = b2.surface_material(friction=friction, restitution=0.0)
    polygon = b2.polygon(points=corners.astype(np.float32))
    body.create_shape(b2.shape_def(density=1.0, material=material), polygon)


if __name__ == "__main__":
    main(*sys.argv[1:])
