"""Energy that impacts can make: brute force over directions, the engine, and the verdicts."""

import numpy as np
import pytest
from scenes import SMALL, changed, write_small
from shapes import rod, shaped_engine, shaped_model

from multicor_cli import check_scenario
from multicor_cli.checks import Verdict
from multicor_cli.checks.outlines import _matrices, largest_gain

NAME = "energy made in impacts"


def outcomes(W, u, e, mu):
    """Velocities after an impact at a single point by Newton's and Coulomb's laws."""
    stick = np.linalg.solve(W, [-(1 + e) * u[0], -u[1]])
    if stick[0] >= 0 and abs(stick[1]) <= mu * stick[0]:
        yield u + W @ stick
    for sign in (1, -1):
        along = np.array([1.0, -sign * mu])
        if W[0] @ along > 0:
            after = u + W @ along * (-(1 + e) * u[0] / (W[0] @ along))
            if sign * after[1] >= 0:
                yield after


@pytest.mark.parametrize(
    ("e", "mu"), [(1.0, 0.3), (0.9, 1.2), (0.8, 0.5), (0.6, 2.0), (0.95, 0.05)]
)
def test_the_largest_gain_is_that_of_the_worst_direction(e, mu):
    rng, gained = np.random.default_rng(7), 0
    for _ in range(6):
        a, b = rng.uniform(0.3, 2.0, 2)
        W = np.array([[1 + a * a, -a * b], [-a * b, 1 + b * b]])
        M, worst = np.linalg.inv(W), -1.0
        for t in np.linspace(-6, 6, 3001):
            u = np.array([-1.0, t])
            energy = u @ M @ u
            worst = max([worst, *((v @ M @ v - energy) / energy for v in outcomes(W, u, e, mu))])
        found = largest_gain(*np.array([[W[0, 0]], [W[0, 1]], [W[1, 1]]]), e, mu)
        if worst > 0 or found > 0:
            assert found == pytest.approx(worst, abs=2e-3)
            gained += 1
        if W[0, 1] ** 2 <= (1 - e * e) * W[0, 0] * W[1, 1]:
            assert found <= 0.0
    assert gained == 0 if e == 0.6 else gained > 0


@pytest.mark.parametrize(("e", "mu"), [(1.0, 0.5), (0.9, 0.5), (0.9, 0.05), (0.5, 3.0)])
def test_rods_of_the_engine_gain_where_it_is_said_and_no_more(e, mu):
    count, rng = 400, np.random.default_rng(3)
    half, radius = 0.4, 0.1
    model = shaped_model(
        [[(rod(2 * half), radius)]] * count, restitution=e, friction=mu, gravity=(0.0, 0.0)
    )
    angle = rng.uniform(0.05, np.pi - 0.05, count)
    place = np.column_stack([3.0 * np.arange(count), radius + half * np.sin(angle), angle])
    velocity = np.column_stack(
        [rng.uniform(-2, 2, count), -np.ones(count), rng.uniform(-1, 1, count)]
    )
    engine = shaped_engine(model, place, velocity)

    def energy():
        v = engine.state.velocity
        return 0.5 * (model.grains.mass * (v[:, 0] ** 2 + v[:, 1] ** 2) + model.grains.inertia * v[:, 2] ** 2)  # fmt: skip

    before = energy()
    engine.step(1e-4, 0.0)
    gain = ((energy() - before) / before).max()
    said = largest_gain(*_matrices(model, 0), e, mu)
    assert gain <= max(said, 1e-9)
    assert (gain > 1e-3) == (said > 0.0)


RODS = 'shape = { kind = "rod", aspect = 3.0 }'


def checks_of(directory, *changes):
    checks = check_scenario(write_small(directory, changed(SMALL, *changes)))
    return {check.name: check for check in checks}


def test_the_check_is_for_grains_that_rebound_and_are_no_discs(tmp_path):
    shaped = ('shape = "disc"', RODS)
    bounces, loses, rests = (("restitution = 0.3", f"restitution = {e}") for e in (0.95, 0.5, 0.0))
    assert NAME not in checks_of(tmp_path, bounces)
    assert NAME not in checks_of(tmp_path, shaped, rests)
    assert checks_of(tmp_path, shaped, loses)[NAME].verdict is Verdict.OK
    found = checks_of(tmp_path, shaped, bounces)[NAME]
    assert found.verdict is Verdict.WARNING
    assert "e = 0.95, μ = 0.4" in found.text
