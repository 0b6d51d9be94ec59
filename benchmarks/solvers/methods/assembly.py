"""A system as sparse matrices, for the methods that factorize."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from multicor_cli.engine.contact.sweep import System
from multicor_cli.engine.contact.system import flatten
from multicor_cli.model.columns import BIAS, FIRST, MU, NORMAL, NX, NY, SECOND, SLIDE, TANGENTIAL
from multicor_cli.model.model import Floats


class Assembly(NamedTuple):
    """``u = Hᵀ v − (0, s)`` and ``v = v_free + M⁻¹ H p``, diagonal contacts first.

    Attributes:
        normal: Rows of Hᵀ that give u_n, shape ``(c, 3 b)``.
        tangent: Rows of Hᵀ that give u_t, shape ``(c, 3 b)``.
        inverse: Diagonal of M⁻¹, shape ``(3 b,)``.
        bias: b, shape ``(c,)`` [m/s].
        friction: μ, shape ``(c,)``.
        slide: s, by which surfaces of walls run ahead of them, shape ``(c,)`` [m/s]; 0 where a body
            of the system runs with it.
    """

    normal: Any
    tangent: Any
    inverse: Floats
    bias: Floats
    friction: Floats
    slide: Floats

    def push(self, impulse: Floats) -> Floats:
        """Change of the velocities by impulses, shape ``(b, 3)``."""
        forces = self.normal.T @ impulse[:, 0] + self.tangent.T @ impulse[:, 1]
        return np.asarray((self.inverse * forces).reshape(-1, 3))

    def relative(self, velocity: Floats) -> tuple[Floats, Floats]:
        """u_n + b and u_t that go with velocities of shape ``(b, 3)``."""
        flat = velocity.ravel()
        return np.asarray(self.normal @ flat + self.bias), np.asarray(
            self.tangent @ flat - self.slide
        )


def assemble(s: System) -> Assembly:
    """The matrices of a system."""
    diagonal, bodies = flatten(s), s.velocity.shape[0]
    diagonals, count = len(diagonal.pair), s.contacts
    pair = np.concatenate([diagonal.pair, s.general_pair]).astype(np.int64)
    nx, ny, bias, friction = (
        np.concatenate([diagonal.frame[:, column], s.general_frame[:, column]])
        for column in (NX, NY, BIAS, MU)
    )
    lever = np.zeros((count, 2, 2))
    lever[:diagonals, FIRST, TANGENTIAL], lever[:diagonals, SECOND, TANGENTIAL] = -1.0, 1.0
    lever[diagonals:] = s.general_lever
    matrices = []
    for direction, along_x, along_y in ((NORMAL, nx, ny), (TANGENTIAL, -ny, nx)):
        values = [
            along_x,
            along_y,
            lever[:, FIRST, direction],
            -along_x,
            -along_y,
            -lever[:, SECOND, direction],
        ]
        places = [3 * pair[:, side] + d for side in (0, 1) for d in range(3)]
        rows = np.tile(np.arange(count), 6)
        shape = (count, 3 * bodies)
        matrices.append(
            sparse.csr_matrix((np.concatenate(values), (rows, np.concatenate(places))), shape=shape)
        )
    slide = np.concatenate([np.zeros(diagonals), s.general_frame[:, SLIDE]])
    return Assembly(matrices[0], matrices[1], _inverse_masses(s).ravel(), bias, friction, slide)


def _inverse_masses(s: System) -> Floats:
    """Per degree of freedom, shape ``(b, 3)``: from the diagonal form for grains, from the general
    one for walls.
    """
    inverse = s.velocity[:, 3:4] * np.array([1.0, 1.0, s.spin_factor])
    bodies = s.inverse.shape[0]
    is_wall: NDArray[np.bool_] = (s.velocity[:bodies, 3] == 0.0) & s.inverse.any(axis=1)
    inverse[:bodies][is_wall] = s.inverse[is_wall]
    return np.asarray(inverse)
