"""Near pairs in which a grain is no disc, as mechanisms see them: their gas, and their views."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.faces import rows_of_faces
from multicor_cli.engine.geometry.pieces import Pieces, turned
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.faces import Corners
from multicor_cli.engine.heat.films import Film, film_conductances
from multicor_cli.engine.heat.mechanism import HeatLaws, Rows
from multicor_cli.engine.heat.views import Hulls, gaps_of_outlines, views_of_outlines
from multicor_cli.model.model import Floats, Ints


class Outlined(NamedTuple):
    """What lasts with grains that are no discs; pieces are at angle 0."""

    pieces: Pieces
    corners: Corners
    hulls: Hulls


@dataclass(frozen=True)
class NearOutlines:
    """Pairs of outlines near each other.

    Attributes:
        rows: Which of all near pairs they are, ascending.
        scene: The scene.
        pieces: Of all bodies, as they lie there.
        corners: Of these pieces.
        hulls: Of all grains.
        normal: Normals at the nearest points of the rows, from j to i, shape ``(e, 2)``.
        of_sides: What sides that lie on each other conduct as a contact [W/K], shape ``(e,)``.
        is_rough: Whether sides are rough.
    """

    rows: Rows
    scene: Scene
    pieces: Pieces
    corners: Corners
    hulls: Hulls
    normal: Floats
    of_sides: Floats
    is_rough: bool

    @classmethod
    def of(
        cls, scene: Scene, known: Outlined, i: Ints, j: Ints, gap: Floats, of_sides: Floats, *,
        is_rough: bool,
    ) -> NearOutlines:  # fmt: skip
        """Those among near pairs; **modifies** their gaps [m], shape ``(e,)``: to the true ones."""
        pieces = turned(known.pieces, scene)
        rows: Rows = np.flatnonzero(rows_of_faces(pieces.is_face, i, j))
        normal = np.zeros((i.size, 2))
        gaps_of_outlines(scene, pieces, known.hulls, rows, i, j, gap, normal)
        return cls(rows, scene, pieces, known.corners, known.hulls, normal, of_sides, is_rough)

    def is_of_discs(self) -> NDArray[np.bool_]:
        """Which near pairs are not among these, shape ``(e,)``."""
        found = np.ones(self.of_sides.size, np.bool_)
        found[self.rows] = False
        return found

    def add_films(
        self, laws: HeatLaws, gas: float, reach: float, i: Ints, j: Ints, spot: Floats,
        conductance: Floats,
    ) -> None:  # fmt: skip
        """Add what a gas of conductivity λ_f [W/(m K)] conducts to ``conductance`` [W/K], ``(e,)``.

        It crosses gaps up to ``reach`` times the smaller radius; radii of spots are in [m].
        """
        film_conductances(
            self.scene, self.pieces, self.corners, laws, Film(gas, reach), self.is_rough, self.rows,
            i, j, spot, self.of_sides, conductance,
        )  # fmt: skip

    def put_views(self, laws: HeatLaws, i: Ints, j: Ints, gap: Floats, area: Floats) -> None:
        """Put area factors of radiation into ``area`` [m²]; gaps [m]; shape ``(e,)``."""
        views_of_outlines(
            self.scene, self.hulls, laws, self.corners.thickness, self.rows, i, j, gap, self.normal,
            area,
        )  # fmt: skip
