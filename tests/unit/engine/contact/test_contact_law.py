"""The scalar contact law, without compilation: check values of theory §4 and properties of each solution."""

import itertools

import pytest

from multicor_cli.engine.contact import law as law


@pytest.mark.parametrize(
    ("tau_t", "tau_n", "expected"),
    [(0.1, 1.0, (0.1, 1.0)), (2.0, 1.0, (0.8, 1.6)), (0.5, -1.0, (0.0, 0.0)), (3.0, -0.5, (0.4, 0.8))],
)
def test_projection_on_the_cone(tau_t, tau_n, expected):
    n, t = law.project_on_cone(tau_n, tau_t, 0.5)
    assert (t, n) == pytest.approx(expected)


def test_projection_is_symmetric_in_the_tangent():
    n, t = law.project_on_cone(1.0, 2.0, 0.3)
    assert law.project_on_cone(1.0, -2.0, 0.3) == (n, -t)


def test_bipotential_iteration_finds_the_sliding_disc():
    """Disc on a plane, u_t = 1, u_n = −0.1, μ = 0.5, W_nn = 1, W_tt = 3: p = (0.1, −0.05)."""
    p_n, p_t = 0.0, 0.0
    for _ in range(200):
        p_n, p_t = law.solve_bipotential(p_n, p_t, -0.1 + p_n, 1.0 + 3.0 * p_t, 1.0, 1.0 / 3.0, 0.5)
    assert (p_n, p_t) == pytest.approx((0.1, -0.05), abs=1e-12)
    assert p_n * (-0.1 + p_n) + p_t * (1.0 + 3.0 * p_t) + 0.5 * p_n * abs(1.0 + 3.0 * p_t) == pytest.approx(0.0, abs=1e-12)


def test_bipotential_parameter_is_admissible():
    """ρ < 2/W_tt for discs (W_tt = 3 W_nn) and spheres (3.5 W_nn)."""
    for ratio in (3.0, 3.5):
        assert 0.0 < law.bipotential_parameter(1.0, 1.0 / ratio) < 2.0 / ratio


def _assert_law_holds(p_n, p_t, u_n, u_t, mu):
    assert p_n >= 0.0
    assert u_n >= -1e-12
    assert p_n * u_n == pytest.approx(0.0, abs=1e-12)
    assert abs(p_t) <= mu * p_n + 1e-12
    if abs(u_t) > 1e-9:
        assert p_t == pytest.approx(-mu * p_n * (1.0 if u_t > 0 else -1.0), abs=1e-9)


GRID = list(itertools.product((-1.0, -0.2, 0.3), (-2.0, -0.1, 0.0, 0.7), (0.0, 0.2, 0.9)))


@pytest.mark.parametrize(("q_n", "q_t", "mu"), GRID)
def test_exact_solution_satisfies_the_law_from_any_start(q_n, q_t, mu):
    w_n, w_t = 2.0, 6.0
    for start_n, start_t in ((0.0, 0.0), (0.4, -0.1)):
        p_n, p_t = law.solve_exact(start_n, start_t, q_n + w_n * start_n, q_t + w_t * start_t, 1 / w_n, 1 / w_t, mu)
        _assert_law_holds(p_n, p_t, q_n + w_n * p_n, q_t + w_t * p_t, mu)


@pytest.mark.parametrize(("q_n", "q_t", "mu"), GRID)
@pytest.mark.parametrize("w_nt", [0.0, 0.6, -0.8])
def test_full_solution_satisfies_the_law(q_n, q_t, mu, w_nt):
    w_nn, w_tt, start_n, start_t = 2.0, 3.0, 0.3, 0.05
    u_n, u_t = q_n + w_nn * start_n + w_nt * start_t, q_t + w_nt * start_n + w_tt * start_t
    p_n, p_t = law.solve_full(start_n, start_t, u_n, u_t, w_nn, w_nt, w_tt, mu)
    _assert_law_holds(p_n, p_t, q_n + w_nn * p_n + w_nt * p_t, q_t + w_nt * p_n + w_tt * p_t, mu)


def test_full_solution_equals_the_exact_one_for_a_diagonal_matrix():
    for q_n, q_t, mu in GRID:
        full = law.solve_full(0.0, 0.0, q_n, q_t, 2.0, 0.0, 6.0, mu)
        assert full == pytest.approx(law.solve_exact(0.0, 0.0, q_n, q_t, 0.5, 1.0 / 6.0, mu), abs=1e-14)


def test_bias():
    dt = 0.1
    assert law.bias(0.02, -1.0, 0.5, dt) == -0.5  # closes within the step: Newton's rebound alone
    assert law.bias(0.2, -1.0, 0.5, dt) == pytest.approx(2.0)  # does not: the gap may be used up
    assert law.bias(0.02, -1.0, 0.0, dt) == pytest.approx(0.2)  # no restitution: land exactly
    assert law.bias(-0.01, 1.0, 0.5, dt) == 0.0  # separating overlap: no push
