"""Contact problems for the tests of the solver."""

import numpy as np
from scene_parts import advance, make_engine, make_model

from multicor_cli.engine import ContactProblem, Settings
from multicor_cli.model import ShapeKind


def column_problem(count, weight=9.81e-3):
    """A column of equal discs on a floor, at rest, under gravity; ``weight`` is g Δt [m/s]."""
    inverse = np.zeros((count + 1, 3))
    inverse[:count] = [1.0, 1.0, 8.0]
    velocity = np.zeros((count + 1, 3))
    velocity[:count, 1] = -weight
    pair = np.array([[k, k - 1 if k else count] for k in range(count)], np.int32)
    lever = np.zeros((count, 2, 2))
    lever[:, 0, 1], lever[:, 1, 1] = -0.5, 0.5
    normal = np.tile([0.0, 1.0], (count, 1))
    return ContactProblem(
        inverse, velocity, pair, normal, lever, np.zeros(count), np.full(count, 0.5)
    )


def heap_problem(seed=0, columns=6, rows=5, friction=0.5, restitution=0.0):
    """The next step of a small heap of unequal discs collapsing between two side walls."""
    rng = np.random.default_rng(seed)
    n = columns * rows
    radius = rng.uniform(0.4, 0.6, n)
    k = np.arange(n)
    positions = np.column_stack(
        [0.7 + (k % columns) * 1.21 + 0.05 * rng.random(n), 0.7 + (k // columns) * 1.21]
    )
    shapes = [
        (ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0)),
        (ShapeKind.PLANE, 0, (0.0, 0.0, 1.0, 0.0)),
        (ShapeKind.PLANE, 0, (columns * 1.25, 0.0, -1.0, 0.0)),
    ]
    model = make_model(radius, shapes, friction=friction, restitution=restitution)
    engine = make_engine(model, positions, settings=Settings(tolerance_rms=1e-4))
    dt = 5e-3
    advance(engine, dt, 250)
    return engine.next_start(dt, 250 * dt)[0]


def tilted(problem):
    """The problem with inverse masses a little unequal in x and y: solved in the general form."""
    inverse = problem.inverse_mass * np.array([1.0, 1.0 + 1e-9, 1.0])
    return ContactProblem(
        inverse, problem.velocity, problem.pair, problem.normal, problem.lever, problem.bias,
        problem.friction,
    )  # fmt: skip


def dense_delassus(problem):
    """W (2c, 2c) and q (2c,), components n, t contact by contact: u + b n = W p + q."""
    levers = problem.levers()
    c, b = len(problem.pair), len(problem.velocity)
    h = np.zeros((2 * c, 3 * b))
    nx, ny = problem.normal.T
    for side, sign in ((0, 1.0), (1, -1.0)):
        body, k, lever = 3 * problem.pair[:, side], np.arange(c), sign * levers[:, side].T
        h[2 * k, body], h[2 * k, body + 1], h[2 * k, body + 2] = sign * nx, sign * ny, lever[0]
        h[2 * k + 1, body], h[2 * k + 1, body + 1] = -sign * ny, sign * nx
        h[2 * k + 1, body + 2] = lever[1]
    w = (h * problem.inverse_mass.ravel()) @ h.T
    q = h @ problem.velocity.ravel()
    q[::2] += problem.bias
    return w, q
