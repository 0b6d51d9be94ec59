"""Polygons in LMGC90, as long prisms that only move in their plane: the binding on PyPI has its
three-dimensional part alone. Runs under an interpreter that has compas_lmgc90 and numpy.

Usage: lmgc90_worker.py IN.npz OUT.npz. IN is written by `shape_peers.ShapePeer.run`, with ``alert``
(distance from which contacts are looked for [m]). OUT holds the arrays of `polygons.Seen`, with
velocities of the last step before each frame.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
from compas_lmgc90 import _lmgc90

_THICK = 10.0  # floor and sides [m]
_LONG = 4.0  # a prism is so many times longer than wide, so that its axis is one of its inertia
_GRAVITY = 9.81  # as the binding has it, along -z [m/s²]


def main(source: str, target: str) -> None:
    """Run it."""
    with np.load(source) as stored:
        data = dict(stored)
    along, down = data["gravity"] / _GRAVITY
    if abs(float(np.hypot(along, down)) - 1.0) > 1e-12:
        raise SystemExit(f"gravity is {_GRAVITY} m/s² in this code")
    lean = np.array([[-down, along], [-along, -down]])  # turns gravity to (0, -1)
    corners, places, grains = _bodies(data)
    corners, places = [one @ lean.T for one in corners], places @ lean.T
    # Turns are about the axes of inertia: which is that of the prism is known when it is built
    trial = _solver(data, corners, places, [()] * len(corners)).get_initial_state()
    axis = [int(np.abs(np.reshape(one, (3, 3))[:, 1]).argmax()) for one in trial.init_body_frames]
    held = [
        (2, *(4 + k for k in range(3) if k != own)) if i < grains else tuple(range(1, 7))
        for i, own in enumerate(axis)
    ]
    solver = _solver(data, corners, places, held)
    start = solver.get_initial_state()
    frames = np.reshape(start.init_body_frames, (-1, 3, 3))
    dt, every = float(data["dt"]), int(data["every"])
    last = np.column_stack([places @ lean, np.zeros(len(places))])
    seconds, positions, velocities = [], [], []
    for _ in range(int(data["frames"])):
        spent = 0.0
        for _ in range(every):
            begin = time.process_time()
            found = solver.compute_one_step()
            spent += time.process_time() - begin
            before, last = last, _look(found, frames, lean)
        seconds.append(spent)
        turn = np.remainder(last[:, 2] - before[:, 2] + np.pi, 2.0 * np.pi) - np.pi
        velocity = np.column_stack([last[:, :2] - before[:, :2], turn]) / dt
        positions.append(last[:grains])
        velocities.append(velocity[:grains])
    np.savez(target, position=positions, velocity=velocities, seconds=seconds)


def _bodies(data: dict[str, Any]) -> tuple[list[Any], Any, int]:
    """Corners of all around their centers, these [m], and how many of them move."""
    corners = np.split(data["corner"], np.cumsum(data["count"])[:-1])
    places, grains = list(data["place"]), len(corners)
    width, high = float(data["width"]), 2.0 * float(data["place"].max()) + _THICK
    wide = width + 2.0 * _THICK if width > 0.0 else 2.0 * high
    around = [(0.5 * width if width > 0.0 else 0.5 * high, -0.5 * _THICK, wide, _THICK)]
    if width > 0.0:
        around += [(x, 0.5 * high, _THICK, high) for x in (-0.5 * _THICK, width + 0.5 * _THICK)]
    for x, y, across, up in around:
        corners.append(0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [across, up])
        places.append(np.array([x, y]))
    return corners, np.array(places), grains


def _solver(data: dict[str, Any], corners: list[Any], places: Any, held: Any) -> Any:
    """LMGC90 with all bodies; ``held`` are the components of their motion that are zero."""
    solver = _lmgc90.LMGC90Solver()
    solver.initialize(float(data["dt"]), 0.5, False)
    solver.add_one_tact_behav("iqsc0", "IQS_CLB", [float(data["friction"])])
    solver.set_materials([1.0])
    solver.set_see_tables(float(data["alert"]))
    solver.set_nb_bodies(len(corners))
    for k, (outline, place, components) in enumerate(zip(corners, places, held, strict=True)):
        vertices, faces = _prism(outline)
        center = [float(place[0]), 0.0, float(place[1])]
        solver.set_one_polyr("s0001", center, faces, vertices, len(components), 0)
        for component in components:
            solver.set_drvdof(k + 1, component, [0.0] * 6, True, False)
    solver.close_before_computing()
    return solver


def _prism(outline: Any) -> tuple[list[float], list[int]]:
    """Vertices of a prism along y, and its triangles, outwards, numbered from 1 on."""
    n, half = len(outline), 0.5 * _LONG * float(np.ptp(outline, axis=0).max())
    vertices = [[x, y, z] for y in (-half, half) for x, z in outline.tolist()]
    triangles = [[0, k, k + 1] for k in range(1, n - 1)]
    triangles += [[n, n + k + 1, n + k] for k in range(1, n - 1)]
    for k in range(n):
        m = (k + 1) % n
        triangles += [[k, n + k, n + m], [k, n + m, m]]
    return np.ravel(vertices).tolist(), (np.ravel(triangles) + 1).tolist()


def _look(found: Any, frames: Any, lean: Any) -> Any:
    """Centers and angles of all bodies, as in `polygons.Seen`."""
    now = np.reshape(found.body_frames, (-1, 3, 3))
    turned = np.swapaxes(now, 1, 2) @ frames
    place = np.array(found.bodies)[:, [0, 2]] @ lean
    return np.column_stack([place, np.arctan2(turned[:, 2, 0], turned[:, 0, 0])])


if __name__ == "__main__":
    main(*sys.argv[1:])
