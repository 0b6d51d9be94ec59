"""Adhesion: contacts that touch bear tension up to a force F_a; its range is zero.

The law is that of Signorini and Coulomb for q_n = p_n + F_a Δt in place of p_n (theory §3.1). F_a is known before the step is
solved, so it is given to the free velocities, as an attraction of the two bodies, and the solver looks for q: no sweep knows of it.
A place has one F_a: pieces of walls that a grain touches in one place (`engine/geometry/places.py`) divide it among them.
In `StepContacts` ``impulse`` holds q and ``attraction`` F_a Δt; p, the impulse of one body on the other, is their difference.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.contact.detection import StepContacts, WarmStart
from multicor_cli.engine.geometry.places import find_places, met_before, totals_of_places
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import GAP, INVERSE_MASS, NORMAL, NX, NY, SPIN, SURFACE, X, Y
from multicor_cli.model.model import ContactLaws, Floats, Grains, Ints

TOUCHING = 1e-9
"""Largest gap, over the radius, of bodies that touch as far as rounded positions tell."""


@formula
def attraction_of(c: int, contacts: StepContacts) -> float:
    """F_a Δt of a contact [N s]; 0 if it is not adhesive in this step."""
    return contacts.attraction[c] if contacts.attraction.size else 0.0


@kernel
def attractions(scene: Scene, laws: ContactLaws, contacts: StepContacts, bodies: Floats, warm: WarmStart, dt: float) -> Floats:
    """F_a Δt of all contacts [N s], shape ``(c,)``; 0 where a contact is not adhesive in this step.

    Adhesive are contacts without a gap (but for rounding), and those whose place carried an impulse in the step before and that
    adhesion alone would close within this one, ``gap ≤ F_a Δt² W_nn`` (of the grains): contacts turn, which leaves a gap of second
    order.

    Args:
        scene: Shapes at q_m.
        laws: Contact laws.
        contacts: Contacts with their warm start; new adhesive ones start with p = 0. **Modified.**
        bodies: Body velocities with the inverse masses, shape ``(bodies, 4)``.
        warm: Impulses of the step before.
        dt: Time step [s].
    """
    count = scene.radius.size
    found = np.zeros(contacts.i.size)
    carried = met_before(scene, warm.row, warm.j, contacts.i, contacts.j)
    for c in range(found.size):
        i, j = contacts.i[c], contacts.j[c]
        force = laws.adhesion[scene.material[i], scene.material[j]]
        w = bodies[i, INVERSE_MASS] + (bodies[j, INVERSE_MASS] if j < count else 0.0)
        gap = contacts.frame[c, GAP]
        if gap <= TOUCHING * scene.radius[i] or (carried[c] and gap <= dt * dt * force * w):
            found[c] = dt * force
    place, _ = find_places(scene, contacts.i, contacts.j)
    sharing = totals_of_places(place, (found > 0.0).astype(np.float64))
    for c in range(found.size):
        if found[c] > 0.0:
            found[c] /= sharing[c]
            if contacts.impulse[c, NORMAL] == 0.0:
                contacts.impulse[c, NORMAL] = found[c]
    return found


def closing_distance(laws: ContactLaws, grains: Grains, dt: float) -> float:
    """No adhesive contact has a larger gap [m]; 0 if no pair of materials has adhesion. Arguments as `attractions`."""
    if not laws.adhesion.size:
        return 0.0
    fastest = dt * dt * 2.0 * float(laws.adhesion.max()) / float(grains.mass.min())
    return max(fastest, TOUCHING * float(grains.radius.max()))


def attract(scene: Scene, contacts: StepContacts, free: Floats, wall_inverse: Floats) -> Floats:
    """Free velocities after the attraction of adhesive contacts; ``free`` itself where there is none.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts of the step.
        free: Free velocities of grains and walls, shape ``(n + w, 4)``.
        wall_inverse: Inverse mass per degree of freedom of the walls, shape ``(w, 3)``.
    """
    if not contacts.attraction.any():
        return free
    attracted = free.copy()
    _attract(scene, contacts, wall_inverse, attracted)
    return attracted


@kernel
def _attract(scene: Scene, contacts: StepContacts, wall_inverse: Floats, velocity: Floats) -> None:
    count = scene.radius.size
    for c in range(contacts.attraction.size):
        i, j, d = contacts.i[c], contacts.j[c], contacts.attraction[c]
        px, py = d * contacts.frame[c, NX], d * contacts.frame[c, NY]
        velocity[i, X] -= velocity[i, INVERSE_MASS] * px
        velocity[i, Y] -= velocity[i, INVERSE_MASS] * py
        if j < count:
            velocity[j, X] += velocity[j, INVERSE_MASS] * px
            velocity[j, Y] += velocity[j, INVERSE_MASS] * py
        else:
            wall = scene.wall[j - count]
            velocity[count + wall, X] += wall_inverse[wall, X] * px
            velocity[count + wall, Y] += wall_inverse[wall, Y] * py
            torque = contacts.lever[c, X] * py - contacts.lever[c, Y] * px
            velocity[count + wall, SURFACE] += wall_inverse[wall, SPIN] * torque


def net_impulses(reaction: Floats, attraction: Floats) -> Floats:
    """p_n, p_t from q and F_a Δt, which may be of size 0 [N s], shape ``(c, 2)``."""
    if not attraction.size:
        return reaction
    net = reaction.copy()
    net[:, NORMAL] -= attraction
    return net


def resting_attraction(laws: ContactLaws, scene: Scene, i: Ints, j: Ints, dt: float) -> Floats:
    """F_a Δt of contacts that are known to touch [N s], shape ``(c,)``; of size 0 if no pair of materials has adhesion."""
    if not laws.adhesion.size:
        return np.empty(0)
    sharing = totals_of_places(find_places(scene, i, j)[0], np.ones(i.size))
    return dt * laws.adhesion[scene.material[i], scene.material[j]] / sharing
