"""Mesh of one disc of radius 1 with six contact arcs, refined towards their ends, where the heat
flow is singular.

A twelfth of the disc, between a contact direction and 30° beside it, is refined and then mirrored
and turned, so that the mesh has exactly the symmetry of the lattice: the nodes of two arcs that
face each other coincide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from arrangement import Floats
from skfem import MeshTri, MeshTri2

_SECTOR = np.pi / 6.0
_SAME = 1e-9  # nodes closer than this are one


@dataclass(frozen=True)
class MeshChoice:
    """How fine a disc is resolved.

    Attributes:
        arc_level: The half-width of an arc is 60°/2^arc_level, so that arc ends are nodes at every
            refinement.
        grading: Largest edge of a triangle over its distance from the next arc end, before
            ``halvings``.
        finest: Edge at which refinement towards the arc end stops, over the half-width of the arc.
        halvings: Uniform refinements on top, each of which halves every edge.
    """

    arc_level: int = 4
    grading: float = 3.0
    finest: float = 0.5
    halvings: int = 0

    @property
    def half_width(self) -> float:
        """Half-width b of a contact arc, in radii."""
        return float(2.0 * _SECTOR / 2**self.arc_level)


def build_disc(choice: MeshChoice) -> MeshTri2:
    """Mesh of curved triangles (quadratic, with the edges of the rim on the circle) of a disc with
    six arcs.
    """
    sector = _refine_sector(choice)
    points, triangles = _mirror_and_turn(sector)
    return _bend_rim(MeshTri(points, triangles))


def _refine_sector(choice: MeshChoice) -> MeshTri:
    corner = [np.cos(_SECTOR), np.sin(_SECTOR)]
    mesh = MeshTri(
        np.array([[0.0, 1.0, corner[0]], [0.0, 0.0, corner[1]]]), np.array([[0], [1], [2]])
    )
    end = np.array([np.cos(choice.half_width), np.sin(choice.half_width)])
    while (coarse := _too_coarse(mesh, end, choice)).size:
        mesh = _onto_circle(mesh.refined(coarse))
    for _ in range(choice.halvings):
        mesh = _onto_circle(mesh.refined())
    return mesh


def _too_coarse(mesh: MeshTri, end: Floats, choice: MeshChoice) -> np.ndarray:
    """Indices of the triangles larger than their distance from the arc end allows, or with a rim
    edge across the arc end.
    """
    corners = mesh.p[:, mesh.t]  # (2, 3, triangles)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=0).max(axis=0)
    distance = np.linalg.norm(corners - end[:, None, None], axis=0).min(axis=0)
    allowed = np.maximum(choice.grading * distance, choice.finest * choice.half_width)
    beyond = np.arctan2(corners[1], corners[0]) - choice.half_width
    on_rim = np.linalg.norm(corners, axis=0) > 1.0 - _SAME
    straddles = (on_rim & (beyond < -_SAME)).any(axis=0) & (on_rim & (beyond > _SAME)).any(axis=0)
    return np.flatnonzero((edges > allowed) | straddles)


def _onto_circle(mesh: MeshTri) -> MeshTri:
    """Move the nodes of the rim, which refinement puts on chords, onto the circle."""
    points = mesh.p.copy()
    rim = np.unique(mesh.facets[:, _rim_facets(mesh)])
    points[:, rim] /= np.linalg.norm(points[:, rim], axis=0)
    return MeshTri(points, mesh.t)


def _rim_facets(mesh: MeshTri) -> np.ndarray:
    """Boundary edges of a sector that lie on neither of its two straight sides."""
    facets = mesh.boundary_facets()
    x, y = mesh.p[:, mesh.facets[:, facets]]
    off_low = np.abs(y).max(axis=0) > _SAME
    off_high = np.abs(y * np.cos(_SECTOR) - x * np.sin(_SECTOR)).max(axis=0) > _SAME
    return np.asarray(facets[off_low & off_high])


def _mirror_and_turn(sector: MeshTri) -> tuple[Floats, np.ndarray]:
    """Nodes and triangles of the whole disc; nodes that fall together become one."""
    whole = sector.p[0] + 1j * sector.p[1]
    halves = [(whole, sector.t), (whole.conj(), sector.t[[0, 2, 1]])]
    turns = np.exp(1j * np.pi / 3.0 * np.arange(6))
    points = np.concatenate([nodes * turn for turn in turns for nodes, _ in halves])
    count = len(whole)
    triangles = np.concatenate(
        [half[1] + count * (2 * k + side) for k in range(6) for side, half in enumerate(halves)],
        axis=1,
    )
    cells = np.round(np.stack([points.real, points.imag]) / _SAME).astype(np.int64)
    _, first, number = np.unique(cells, axis=1, return_index=True, return_inverse=True)
    return np.stack([points.real[first], points.imag[first]]), number.reshape(-1)[triangles]


def _bend_rim(mesh: MeshTri) -> MeshTri2:
    """The same triangles with the midpoints of the rim's edges on the circle."""
    curved = MeshTri2.from_mesh(mesh)
    nodes = curved.doflocs.copy()
    middle = mesh.nvertices + mesh.boundary_facets()
    nodes[:, middle] /= np.linalg.norm(nodes[:, middle], axis=0)
    return MeshTri2(nodes, curved.t)
