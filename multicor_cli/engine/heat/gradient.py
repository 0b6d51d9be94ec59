"""A mean gradient of temperature G in a cell that is periodic in both directions.

A grain at r is warmer than its T by G·r, and so are its images. All T, which the state holds, are
beside the gradient, as velocities are beside the mean flow: they belong to no image. Between two
grains of branch vector ℓ, from j to i, heat flows as if j were warmer by −G·ℓ. A grain that moves
by Δs beside the mean flow (with which the gradient moves) takes its heat along: T falls by G·Δs.
Where temperatures themselves count, as in radiation and friction, they are T: gradients are small.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.geometry.scene import Scene, shortest
from multicor_cli.engine.heat.mechanism import Indices
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats


@kernel
def look_ahead(
    scene: Scene, i: Indices, j: Indices, gradient: Floats
) -> tuple[Floats, Floats]:  # fmt: skip
    """Branch vectors of pairs [m], and how much warmer the gradient [K/m] makes the second [K].

    Shapes ``(e, 2)`` and ``(e,)``.
    """
    branch, ahead = np.empty((i.size, 2)), np.empty(i.size)
    for k in range(i.size):
        x, y = shortest(
            scene.position[i[k], X] - scene.position[j[k], X],
            scene.position[i[k], Y] - scene.position[j[k], Y],
            scene.period, scene.height, scene.tilt,
        )  # fmt: skip
        branch[k, X], branch[k, Y] = x, y
        ahead[k] = -(gradient[X] * x + gradient[Y] * y)
    return branch, ahead


@kernel
def take_along(capacity: Floats, strayed: Floats, gradient: Floats) -> Floats:
    """Heat that grains gain as they move along the gradient, −C G·Δs [J], shape ``(n,)``.

    ``strayed`` is how far they have moved beside the mean flow [m], shape ``(n, 2)``.
    """
    gained = np.empty(capacity.size)
    for i in range(capacity.size):
        gained[i] = -capacity[i] * (gradient[X] * strayed[i, X] + gradient[Y] * strayed[i, Y])
    return gained
