"""Event-driven hard discs in a smooth or rough box: every pair looked at, nothing shared with
multicor but the contact law (Newton's restitution, Coulomb's friction).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numba import njit


@njit
def next_event(place, velocity, radius, box, gravity, i, now):
    """When and with whom grain i meets next: another grain, or a side n, n+1 (x), n+2, n+3 (y)."""
    n = radius.size
    best, partner = inf, -1
    for j in range(n):
        if j == i:
            continue
        dx, dy = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1]
        u, v = velocity[i, 0] - velocity[j, 0], velocity[i, 1] - velocity[j, 1]
        along, reach = dx * u + dy * v, radius[i] + radius[j]
        if along >= 0.0:
            continue
        room = dx * dx + dy * dy - reach * reach
        square = along * along - (u * u + v * v) * max(room, 0.0)
        if square > 0.0 and max(room, 0.0) / (sqrt(square) - along) < best:
            best, partner = max(room, 0.0) / (sqrt(square) - along), j
    for side in range(4):
        d, sign = side // 2, 1.0 if side % 2 == 0 else -1.0
        gap = sign * place[i, d] - radius[i] if sign > 0.0 else box[d] - place[i, d] - radius[i]
        speed, pull = -sign * velocity[i, d], -sign * gravity[d]  # towards the side
        gap, time = max(gap, 0.0), inf
        if pull == 0.0:
            time = gap / speed if speed > 0.0 else inf
        elif pull > 0.0:
            root = sqrt(speed * speed + 2.0 * pull * gap)
            time = 2.0 * gap / (root + speed) if speed > 0.0 else (root - speed) / pull
        elif speed > 0.0 and speed * speed + 2.0 * pull * gap > 0.0:
            time = 2.0 * gap / (sqrt(speed * speed + 2.0 * pull * gap) + speed)
        if time < best:
            best, partner = time, n + side
    return now + best, partner


@njit
def strike(velocity, surface, mass, e, mu, beta, i, j, nx, ny, speed):
    """Newton's impact with Coulomb's friction on a normal (nx, ny), from j to i.

    ``surface`` are speeds a ω, ``beta`` m a²/I. From n on j is a wall, with a ``speed`` along y.
    """
    n = mass.size
    u, v, inverse, spin = velocity[i, 0], velocity[i, 1], 1.0 / mass[i], surface[i]
    if j < n:
        u, v = u - velocity[j, 0], v - velocity[j, 1]
        inverse, spin = inverse + 1.0 / mass[j], spin + surface[j]
    else:
        v -= speed
    u_n, u_t = u * nx + v * ny, v * nx - u * ny - spin
    p_n = max(0.0, -(1.0 + e) * u_n / inverse)
    p_t = min(max(-u_t / ((1.0 + beta) * inverse), -mu * p_n), mu * p_n)
    px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
    velocity[i, 0] += px / mass[i]
    velocity[i, 1] += py / mass[i]
    surface[i] -= beta * p_t / mass[i]
    if j < n:
        velocity[j, 0] -= px / mass[j]
        velocity[j, 1] -= py / mass[j]
        surface[j] -= beta * p_t / mass[j]


@njit
def collide(place, velocity, surface, radius, mass, e, mu, beta, i, j):
    """The impact of disc i on another, or on a side of the box."""
    n = radius.size
    if j < n:
        dx, dy = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1]
        distance = sqrt(dx * dx + dy * dy)
        nx, ny = dx / distance, dy / distance
    else:
        sign = 1.0 if (j - n) % 2 == 0 else -1.0
        nx, ny = (sign, 0.0) if j - n < 2 else (0.0, sign)
    strike(velocity, surface, mass, e, mu, beta, i, j, nx, ny, 0.0)


@njit
def simulate(place, velocity, surface, radius, mass, box, gravity, e, mu, beta, end):
    """Let discs fly until the ``end`` [s]; returns the number of impacts.

    Centers ``place`` [m] and ``velocity`` [m/s] have shape ``(n, 2)``, ``surface`` (a ω),
    ``radius`` and ``mass`` ``(n,)``; the first three are **modified**. ``box`` is the width and
    height of the box [m], ``e`` the restitution, ``mu`` the friction, ``beta`` m a²/I.
    """
    n, now, impacts = radius.size, 0.0, 0
    time, partner = np.empty(n), np.empty(n, np.int64)
    for i in range(n):
        time[i], partner[i] = next_event(place, velocity, radius, box, gravity, i, now)
    while True:
        i = np.argmin(time)
        step = min(time[i], end) - now
        for k in range(n):
            for d in range(2):
                place[k, d] += step * (velocity[k, d] + 0.5 * step * gravity[d])
                velocity[k, d] += step * gravity[d]
        now += step
        if time[i] >= end:
            return impacts
        j = partner[i]
        collide(place, velocity, surface, radius, mass, e, mu, beta, i, j)
        impacts += 1
        for k in range(n):
            if k in (i, j) or partner[k] == i or (j < n and partner[k] == j):
                time[k], partner[k] = next_event(place, velocity, radius, box, gravity, k, now)
                m = partner[k]
                if m < n and time[k] < time[m]:
                    time[m], partner[m] = time[k], k
