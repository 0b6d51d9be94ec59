"""Heat of sliding friction and of impacts.

Formulas: the energy lost in a step, ``−p_t ½(u_t⁻ + u_t⁺)`` and ``−p_n ½(u_n⁻ + u_n⁺)``, or ``Q = μ F_n |u_t|`` (both derived: the
work of Coulomb's law).

Validity: the power is that of a contact that slides with the velocity u_t all through the step. Temperatures are those of grains;
the spot itself may be much hotter for an instant.
"""

from __future__ import annotations

from typing import Literal

from multicor_cli.engine.contact.detection import StepContacts, attraction_of, contact_after, rolled_loss, rolling_loss
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.wear import rubbing_of
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import FRICTION, IMPACT, MU, NORMAL, TANGENTIAL
from multicor_cli.model.model import Floats

FrictionRule = Literal["energy", "sliding", "none"]

NO_FRICTION, ENERGY, SLIDING = 0, 1, 2
"""Rules of the heat of friction."""


@formula
def sliding_power(mu: float, normal_force: float, slip_speed: float) -> float:
    """Power of sliding friction ``Q = μ F_n |u_t|`` [W]; F_n [N], u_t [m/s] of either sign."""
    return mu * abs(slip_speed) * normal_force


@parallel_kernel
def generated_heat(
    scene: Scene, contacts: StepContacts, after: Floats, rule: int, has_impact: bool, heat: Floats, rubbing: Floats
) -> None:
    """Heat generated in each contact of a step, and the product of force and slipped distance that wears.

    ``"energy"``: −p_t ½(u_t⁻+u_t⁺), exact and signed; ``"sliding"``: μ|u_t⁺| p_n (the paper's E_f); impacts: −p_n ½(u_n⁻+u_n⁺).
    Couples of rolling resistance add −p_r ½(u_r⁻+u_r⁺), or |p_r u_r⁺|, to friction. With adhesion q_n = p_n + F_a Δt takes the
    place of p_n in Coulomb's law.
    Rubbing is the work of friction over μ: p_n times the slipped distance where a contact slides, less where it sticks.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts with their impulses.
        after: Body velocities v⁺, shape ``(bodies, 4)``.
        rule: Rule of the heat of friction.
        has_impact: Whether the energy of impacts counts.
        heat: Heat of friction, heat of impacts [J], shape ``(c, 2)``. **Modified.**
        rubbing: Force times distance [N m], shape ``(c,)``. **Modified.**
    """
    count = contacts.i.size
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for c in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            heat[c, FRICTION], heat[c, IMPACT], rubbing[c] = 0.0, 0.0, 0.0
            q_n, p_t, attraction = contacts.impulse[c, NORMAL], contacts.impulse[c, TANGENTIAL], attraction_of(c, contacts)
            if q_n > 0.0 or attraction > 0.0:
                u_n, u_t = contact_after(c, scene, contacts, after)
                mu, slip = contacts.frame[c, MU], 0.5 * (contacts.before[c, TANGENTIAL] + u_t)
                work = -p_t * slip
                if rule == ENERGY:
                    heat[c, FRICTION] = work + rolling_loss(c, scene, contacts, after)
                elif rule == SLIDING:
                    heat[c, FRICTION] = sliding_power(mu, q_n, u_t) + rolled_loss(c, scene, contacts, after)
                if has_impact:
                    heat[c, IMPACT] = -(q_n - attraction) * 0.5 * (contacts.before[c, NORMAL] + u_n)
                rubbing[c] = rubbing_of(q_n, slip, work, mu)
