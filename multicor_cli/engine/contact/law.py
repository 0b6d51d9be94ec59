"""Unilateral contact with Coulomb friction, one contact at a time.

Frame: n points from body j to body i, t is n turned by +90°; u is the velocity of i relative to j
and p the impulse of j on i. The law: ``ũ_n = u_n⁺ + b``, ``0 ≤ p_n ⟂ ũ_n ≥ 0``, ``|p_t| ≤ μ p_n``
with ``p_t`` opposing slip. Plain scalar functions: kernels compile them, tests call them.
"""

from __future__ import annotations

from math import sqrt

from multicor_cli.engine.geometry.scene import disc_disc
from multicor_cli.engine.jit.formulas import formula

GRAZE = 5e-4
"""Overlap over the smaller radius that is left alone: discs that go no deeper pass each other."""


@formula
def guard_plane(
    dx: float, dy: float, ux: float, uy: float, radii: float, graze: float, dt: float
) -> tuple[float, float, float, float]:
    """The plane that keeps two discs apart in a step: the first has to stay on its side of it.

    Centers are (dx, dy) apart at q_m [m] and go on with (ux, uy) [m/s]. The normal is that at q_m,
    unless the discs pass each other, going no deeper than ``graze`` [m]: then it is that of their
    closest approach on this way (theory §3). Returns the gap [m], what is left of it along the
    normal [m], and the normal.
    """
    gap, nx, ny = disc_disc(dx, dy, radii)
    along, square = dx * ux + dy * uy, ux * ux + uy * uy
    if not (gap > 0.0 and along < 0.0 and square > 0.0):
        return gap, gap, nx, ny
    when, least = -along / square, radii - graze
    if when >= dt:  # they still approach when the step ends
        when, least = dt, radii
    px, py = dx + when * ux, dy + when * uy
    distance = sqrt(px * px + py * py)
    if distance < least:
        return gap, gap, nx, ny
    nx, ny = px / distance, py / distance
    return gap, dx * nx + dy * ny - radii, nx, ny


@formula
def bias(gap: float, normal_velocity: float, restitution: float, dt: float) -> float:
    """The term b that is added to u_n⁺ in the contact law [m/s].

    With e > 0 a contact that closes within the step rebounds by Newton's law,
    ``b = e·min(u_n⁻, 0)``; any other may approach no further than its gap allows,
    ``b = max(gap, 0)/Δt`` (theory §3). Letting both act on one contact never converges with Δt.
    """
    # Conditional expressions compile to selections, the built-in min and max to branches.
    closing = normal_velocity if normal_velocity < 0.0 else 0.0
    if restitution > 0.0 and gap + dt * closing <= 0.0:
        return restitution * closing
    return (gap if gap > 0.0 else 0.0) / dt


@formula
def solve_exact(
    p_n: float, p_t: float, u_n: float, u_t: float, w_n_inverse: float, w_t_inverse: float,
    mu: float,
) -> tuple[float, float]:  # fmt: skip
    """Exact solution of one contact whose Delassus matrix is diagonal (discs, spheres).

    Takes impulses now [N s], ``u_n + b`` and u_t that go with them [m/s], 1/W_nn, 1/W_tt [kg] and
    μ. Returns the impulses (p_n, p_t) that satisfy the law with all other contacts held (theory §4:
    the normal impulse first, then the tangential one cut to the cone; W_nt = 0 decouples them).
    """
    # Selections, as in `bias`: branches cost twice the time here.
    new_n = p_n - u_n * w_n_inverse
    new_n = new_n if new_n > 0.0 else 0.0
    bound = mu * new_n
    new_t = p_t - u_t * w_t_inverse
    new_t = new_t if new_t < bound else bound
    new_t = new_t if new_t > -bound else -bound
    return new_n, new_t


@formula
def project_on_cone(tau_n: float, tau_t: float, mu: float) -> tuple[float, float]:
    """Orthogonal projection on Coulomb's cone (de Saxcé & Feng; Fortin et al. 2005)."""
    size = abs(tau_t)
    if mu * size <= -tau_n:
        return 0.0, 0.0
    if size <= mu * tau_n:
        return tau_n, tau_t
    new_n = (tau_n + mu * size) / (1.0 + mu * mu)
    return new_n, mu * new_n * (1.0 if tau_t > 0.0 else -1.0)


@formula
def bipotential_parameter(w_n_inverse: float, w_t_inverse: float) -> float:
    """ρ = 1/√(W_nn W_tt) [kg], within 0 < ρ < 2/W_tt, as it must be (W_tt ≤ 3.5 W_nn)."""
    return sqrt(w_n_inverse * w_t_inverse)


@formula
def predict_and_correct(
    p_n: float, p_t: float, u_n: float, u_t: float, rho: float, mu: float
) -> tuple[float, float]:
    """Predictor ``τ = p − ρ (u + μ|u_t| n)`` and projection (Fortin, Millet & de Saxcé 2005)."""
    return project_on_cone(p_n - rho * (u_n + mu * abs(u_t)), p_t - rho * u_t, mu)


@formula
def solve_bipotential(
    p_n: float, p_t: float, u_n: float, u_t: float, w_n_inverse: float, w_t_inverse: float,
    mu: float,
) -> tuple[float, float]:  # fmt: skip
    """One predictor–corrector step of the bipotential method; arguments as `solve_exact`."""
    return predict_and_correct(
        p_n, p_t, u_n, u_t, bipotential_parameter(w_n_inverse, w_t_inverse), mu
    )


@formula
def solve_full(
    p_n: float, p_t: float, u_n: float, u_t: float, w_nn: float, w_nt: float, w_tt: float, mu: float
) -> tuple[float, float]:
    """Exact solution with a full 2×2 Delassus matrix, by enumeration of open, stick and both slips.

    Arguments as `solve_exact`, with the matrix itself [1/kg]. Of several solutions (possible only
    if ``W_nn < μ|W_nt|``) the one nearest to (p_n, p_t) in |W d|, so that each of them is a fixed
    point; if rounding leaves none, the sliding one with the larger impulse.
    """
    # Velocities if this contact carried nothing.
    free_n = u_n - w_nn * p_n - w_nt * p_t
    free_t = u_t - w_nt * p_n - w_tt * p_t
    if mu * abs(w_nt) > w_nn and free_n >= 0.0:
        return _nearest_solution(p_n, p_t, free_n, free_t, w_nn, w_nt, w_tt, mu)
    if free_n >= 0.0:
        return 0.0, 0.0
    det = w_nn * w_tt - w_nt * w_nt
    if det > 0.0:
        stick_n = (w_nt * free_t - w_tt * free_n) / det
        stick_t = (w_nt * free_n - w_nn * free_t) / det
        if stick_n >= 0.0 and abs(stick_t) <= mu * stick_n:
            return stick_n, stick_t
    best_n, best_t = 0.0, 0.0
    for sign in (1.0, -1.0):
        stiffness = w_nn + sign * mu * w_nt
        if stiffness <= 0.0:
            continue
        slip_n = -free_n / stiffness
        slip_t = sign * mu * slip_n
        if sign * (free_t + w_nt * slip_n + w_tt * slip_t) <= 0.0:
            return slip_n, slip_t
        if slip_n > best_n:
            best_n, best_t = slip_n, slip_t
    return best_n, best_t


@formula
def _nearest_solution(
    p_n: float, p_t: float, free_n: float, free_t: float, w_nn: float, w_nt: float, w_tt: float,
    mu: float,
) -> tuple[float, float]:  # fmt: skip
    """Open, stick or slip against W_nt: whichever is a solution nearest to (p_n, p_t).

    For ``W_nn < μ|W_nt|`` and a contact that nothing closes: the other slip is none then.
    """
    found_n, found_t = 0.0, 0.0
    least = _squared_change(-p_n, -p_t, w_nn, w_nt, w_tt)
    sign = -1.0 if w_nt > 0.0 else 1.0
    slip_n = -free_n / (w_nn + sign * mu * w_nt)
    slip_t = sign * mu * slip_n
    change = _squared_change(slip_n - p_n, slip_t - p_t, w_nn, w_nt, w_tt)
    if sign * (free_t + w_nt * slip_n + w_tt * slip_t) <= 0.0 and change < least:
        least, found_n, found_t = change, slip_n, slip_t
    det = w_nn * w_tt - w_nt * w_nt
    if det > 0.0:
        stick_n = (w_nt * free_t - w_tt * free_n) / det
        stick_t = (w_nt * free_n - w_nn * free_t) / det
        change = _squared_change(stick_n - p_n, stick_t - p_t, w_nn, w_nt, w_tt)
        if stick_n >= 0.0 and abs(stick_t) <= mu * stick_n and change < least:
            found_n, found_t = stick_n, stick_t
    return found_n, found_t


@formula
def _squared_change(d_n: float, d_t: float, w_nn: float, w_nt: float, w_tt: float) -> float:
    """|W d|² [m²/s²]."""
    c_n, c_t = w_nn * d_n + w_nt * d_t, w_nt * d_n + w_tt * d_t
    return c_n * c_n + c_t * c_t


# ---- Friction that depends on temperature: `μ(T) = μ_0 [1 − c (T − T_r)]` (phenomenological).
#
# Validity: the linear law has no universal source: its rate is a fit to a material pair over the
# measured range, and T is the temperature of the grains, not that of the spot.


@formula
def softened_friction(
    mu: float, rate: float, temperature: float, start: float, lowest: float, highest: float
) -> float:
    """Coefficient of friction ``μ_0 [1 − c (T − T_r)]``, cut to [lowest, highest].

    ``mu`` is μ_0, ``rate`` c [1/K], negative if friction rises with temperature, ``start`` T_r [K].
    """
    value = mu * (1.0 - rate * (temperature - start))
    value = value if value > lowest else lowest
    return value if value < highest else highest


# ---- Friction that weakens by flash heating: `μ = f_w + (f_0 − f_w) V_w/V` above the speed V_w.
#
# Formulas: asperities of the diameter D, which bear the shear strength τ_c, slide for D/V before
# they part, and weaken when their flash temperature has reached T_w; f_w once they have:
# `V_w = (π α/D) [ρ c (T_w − T)/τ_c]²`, so `V_w(T) = V_w(T_r) [(T_w − T)/(T_w − T_r)]²`.
#
# Source: J. R. Rice, J. Geophys. Res. 111 (2006) B05311, eqs. 5 to 8; α = λ/(ρc).
#
# Validity: T is that of the surface beside the asperities, here the mean of the two bodies. Many
# asperities in a contact; each is new and cold when it meets the next.


@formula
def weakening_speed(speed: float, temperature: float, limit: float, reference: float) -> float:
    """``V_w(T) = V_w(T_r) [(T_w − T)/(T_w − T_r)]²`` [m/s], 0 from ``T_w`` on (Rice 2006, eq. 5).

    ``speed`` is V_w(T_r) [m/s], ``limit`` T_w, ``reference`` T_r [K].
    """
    if temperature >= limit:
        return 0.0
    share = (limit - temperature) / (limit - reference)
    return speed * (share * share)


@formula
def weakened_friction(mu: float, weakened: float, speed: float, slip: float) -> float:
    """``f_w + (f_0 − f_w) V_w/V`` above V_w, else ``mu``, which is f_0 (Rice 2006, eq. 8).

    ``weakened`` is f_w, ``speed`` V_w, ``slip`` V ≥ 0 [m/s].
    """
    return mu if slip <= speed else weakened + (mu - weakened) * (speed / slip)
