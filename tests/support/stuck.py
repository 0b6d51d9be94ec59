"""Whether a step that a solve has given up has a solution at all: every mode of its contacts."""

import itertools

import numpy as np

from multicor_cli.engine import Settings
from multicor_cli.engine.contact import patches
from multicor_cli.engine.contact.solve import ResidualScale, ThreadChoice, solve_system

NO_SCALE = ResidualScale(1e-3, 1e-3, 1e-12)
"""With these residuals never pass."""

OPEN, STICK, SLIP, SLIP_BACK = range(4)


def least_violation(w, free, mu):
    """How far the best combination of modes misses the law of contacts, over the largest speed.

    ``w`` is the Delassus matrix of k contacts, ``free`` their velocities without impulses [m/s],
    both as u_n and u_t by turns. 0 means that there is a solution; all 4^k modes are tried.
    """
    speed, best = np.abs(free).max(), np.inf
    for modes in itertools.product(range(4), repeat=len(mu)):
        columns, rows = [], []
        for c, mode in enumerate(modes):
            if mode == OPEN:
                continue
            push = np.zeros(free.size)
            push[2 * c] = 1.0
            push[2 * c + 1] = {STICK: 0.0, SLIP: -mu[c], SLIP_BACK: mu[c]}[mode]
            columns.append(push)
            rows.append(2 * c)
            if mode == STICK:
                columns.append(np.eye(free.size)[2 * c + 1])
                rows.append(2 * c + 1)
        impulse = np.zeros(free.size)
        if rows:
            of = np.array(columns).T
            impulse = of @ np.linalg.lstsq((w @ of)[rows], -free[rows], rcond=1e-11)[0]
        p_n, p_t = impulse.reshape(-1, 2).T
        u_n, u_t = (free + w @ impulse).reshape(-1, 2).T / speed
        scale = max(np.abs(impulse).max(), 1e-300)
        worst = 0.0
        for c, mode in enumerate(modes):
            if mode == OPEN:
                worst = max(worst, -u_n[c])
                continue
            worst = max(worst, abs(u_n[c]), -p_n[c] / scale)
            if mode == STICK:
                worst = max(worst, abs(u_t[c]), (abs(p_t[c]) - mu[c] * p_n[c]) / scale)
            else:
                worst = max(worst, -u_t[c] if mode == SLIP else u_t[c])
        best = min(best, worst)
    return best


def strut(engine, dt, t, sweeps=3000):
    """W, free velocities and μ of the contacts that bear nearly all of the next step's impulses.

    As `least_violation` takes them, all other impulses as they are after so many sweeps.
    """
    system = engine.next_system(dt, t).system
    solve_system(system, NO_SCALE, Settings(max_sweeps=sweeps), ThreadChoice())
    everyone = patches._gather(np.flatnonzero(patches._measure(system)[0]), system)
    pushes = everyone.impulse[: everyone.contact.size]
    chosen = everyone.contact[pushes > 1e-3 * pushes.max()]
    patch, by_turns = patches._gather(chosen, system), np.arange(2 * chosen.size)
    by_turns = by_turns.reshape(2, -1).T.reshape(-1)
    w = patches._delassus(patch, system)[np.ix_(by_turns, by_turns)]
    free = patch.velocity[by_turns] - w @ patch.impulse[by_turns]
    return w, free, patch.friction[: chosen.size]
