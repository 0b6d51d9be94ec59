"""The sheared layer in YADE; YADE runs this script:
``yade -n -x -j CORES yade_worker.py IN.npz OUT.npz``.

IN is written by `yade_shear.write_layer`. OUT holds ``seconds`` of the measured steps, and
``position``, ``velocity`` and ``wall_force`` of the frames.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import numpy as np
from yade import (  # type: ignore[import-not-found]  # only YADE's own interpreter has it
    Bo1_Sphere_Aabb,
    ForceResetter,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_ViscElMat_ViscElMat_ViscElPhys,
    Law2_ScGeom_ViscElPhys_Basic,
    NewtonIntegrator,
    O,
    PyRunner,
    Vector3,
    ViscElMat,
    utils,
)

_FLOWING, _WALL, _NO_PAIR = 1, 3, 2  # bits: grains of walls do not touch each other
_COLUMNS = ("position", "velocity", "radius", "density")
_PAIRED = 2.0  # two springs in a row make a contact, so each is twice as stiff


def build(data: Any) -> None:
    """Grains, contacts and engines."""
    O.periodic = True
    top = float(data["position"][:, 1].max() + 20.0 * data["radius"].max())
    O.cell.setBox(float(data["period"]), top, 8.0 * float(data["radius"].max()))
    stiffness = {key: _PAIRED * float(data[key]) for key in ("kn", "ks", "cn", "cs")}
    angle = math.atan(float(data["friction"]))
    n, unit = int(data["flowing"]), float(data["radius"].max())
    materials = {}
    for k, (place, speed, radius, density) in enumerate(
        zip(*(data[key] for key in _COLUMNS), strict=True)
    ):
        if density not in materials:
            made = ViscElMat(density=float(density), frictionAngle=angle, **stiffness)
            materials[density] = O.materials.append(made)
        middle = (float(place[0]), float(place[1]) + 8.0 * unit, 4.0 * unit)
        mask = _FLOWING if k < n else _WALL
        body = utils.sphere(middle, float(radius), material=materials[density], mask=mask)
        body.state.blockedDOFs = "zXY" if k < n else "xyzXYZ"
        O.bodies.append(body)
        body.state.vel = (float(speed[0]), float(speed[1]), 0.0)
        body.state.angVel = (0.0, 0.0, float(speed[2]))
    O.engines = [
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb()], verletDist=float(data["skin"]), avoidSelfInteractionMask=_NO_PAIR
        ),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom()],
            [Ip2_ViscElMat_ViscElMat_ViscElPhys()],
            [Law2_ScGeom_ViscElPhys_Basic()],
        ),
        PyRunner(command="lid.move()", iterPeriod=1),
        NewtonIntegrator(damping=0.0, gravity=(0.0, 0.0, 0.0)),
    ]
    O.dt = float(data["dt"])


class Lid:
    """The upper wall: it moves as one, along y under its load."""

    def __init__(self, data: Any) -> None:
        """Take hold of its grains."""
        self.ids = range(int(data["flowing"]) + int(data["fixed"]), len(data["radius"]))
        self.states = [O.bodies[k].state for k in self.ids]
        self.mass, self.load, self.damping = (
            float(data[key]) for key in ("wall_mass", "load", "wall_damping")
        )
        self.speed, self.rise = float(data["speed"]), float(data["rise"])
        self.sum = Vector3(0.0, 0.0, 0.0)

    def move(self) -> None:
        """Between forces and motion of every step."""
        force = sum((O.forces.f(k) for k in self.ids), Vector3(0.0, 0.0, 0.0))
        self.sum += force
        self.rise += O.dt * (force[1] - self.load - self.damping * self.rise) / self.mass
        velocity = Vector3(self.speed, self.rise, 0.0)
        for state in self.states:
            state.vel = velocity


def check(data: Any) -> None:
    """The contacts are those asked for."""
    O.step()
    for contact in O.interactions:
        for key in ("kn", "ks", "cn", "cs"):
            got, wanted = getattr(contact.phys, key), float(data[key])
            if not math.isclose(got, wanted, rel_tol=1e-9):
                raise RuntimeError(f"{key} of a contact is {got}, not {wanted}")
        return
    raise RuntimeError("no grains touch")


data = np.load(sys.argv[1])
build(data)
lid = Lid(data)
check(data)
every, settle, frames, flowing = (
    int(data[key]) for key in ("every", "settle", "frames", "flowing")
)
if settle:
    O.run(settle, wait=True)
seconds, places, speeds, forces = 0.0, [], [], []
for _ in range(frames):
    lid.sum = Vector3(0.0, 0.0, 0.0)
    begin = time.perf_counter()
    O.run(every, wait=True)
    seconds += time.perf_counter() - begin
    places.append([(b.state.pos[0], b.state.pos[1]) for b in O.bodies])
    speeds.append([O.bodies[k].state.vel[0] for k in range(flowing)])
    forces.append((lid.sum[0] / every, lid.sum[1] / every))
np.savez(sys.argv[2], seconds=seconds, position=places, velocity=speeds, wall_force=forces)
