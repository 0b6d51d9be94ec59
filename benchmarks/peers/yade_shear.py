"""The sheared layer in YADE."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from case import TANGENTIAL_SHARE, FlowPlan, Frames, Layer, SoftContact, sphere_mass
from gran_shear import GranRun
from process import first_line, run_program

_SKIN = 0.2  # over the largest radius
_WORKER = Path(__file__).resolve().parent / "yade_worker.py"


def write_layer(
    path: Path, layer: Layer, contact: SoftContact, dt: float, every: int, settle: int, frames: int
) -> None:
    """Write the layer, its contacts and the numbers of steps for the worker.

    Args:
        path: The file.
        layer: The layer.
        contact: Its contacts.
        dt: Time step [s].
        every: Steps between two frames.
        settle: Steps before the measurement.
        frames: Number of frames.
    """
    n, fixed, top = len(layer.radius), len(layer.bottom.radius), len(layer.top.radius)
    velocity = np.zeros((n + fixed + top, 3))
    velocity[:n] = layer.velocity
    velocity[n + fixed :, 0], velocity[n + fixed :, 1] = layer.speed, layer.rise
    share = layer.wall_mass / top / sphere_mass(layer.top.radius, 1.0)
    effective = 0.5 * float(layer.mass.mean())
    np.savez(
        path, position=np.concatenate([layer.position, layer.bottom.position, layer.top.position]),
        velocity=velocity,
        radius=layer.all_radius, density=np.concatenate([np.full(n + fixed, layer.density), share]),
        flowing=n, fixed=fixed,
        period=layer.period, kn=contact.stiffness, ks=contact.tangential,
        cn=contact.damping * effective,
        cs=TANGENTIAL_SHARE * contact.damping * effective, friction=contact.friction,
        wall_mass=layer.wall_mass,
        load=layer.load, wall_damping=layer.wall_damping, speed=layer.speed, rise=layer.rise, dt=dt,
        every=every,
        settle=settle, frames=frames, skin=_SKIN * float(layer.radius.max()),
    )  # fmt: skip


@dataclass(frozen=True)
class YadePeer:
    """YADE, installed."""

    program: str
    cores: int
    substeps: float

    @property
    def name(self) -> str:
        """Its name."""
        return "yade"

    def version(self) -> str:
        """What it says about itself."""
        return first_line([self.program, "--version"])

    def prepare_shear(
        self, layer: Layer, contact: SoftContact, plan: FlowPlan, folder: Path
    ) -> tuple[Callable[[Layer], GranRun], str]:
        """What runs it from a start, and a word on its settings."""
        note = (
            f"ViscElPhys, skin {_SKIN:g} radii, Δt = 1/{self.substeps:g} of the shortest "
            "collision; its wall moves in Python"
        )
        return lambda start: self._flow(start, contact, plan, folder), note

    def _flow(self, layer: Layer, contact: SoftContact, plan: FlowPlan, folder: Path) -> GranRun:
        duration = layer.duration(plan.between)
        every = math.ceil(duration * self.substeps / contact.collision)
        dt = duration / every
        write_layer(
            folder / "layer.npz",
            layer,
            contact,
            dt,
            every,
            round(plan.settle / plan.between) * every,
            plan.frames,
        )
        run_program(
            [
                self.program,
                "-n",
                "-x",
                "-j",
                str(self.cores),
                str(_WORKER),
                "layer.npz",
                "flow.npz",
            ],
            folder,
        )
        with np.load(folder / "flow.npz") as found:
            frames = Frames(found["position"], found["velocity"], found["wall_force"])
            return GranRun(float(found["seconds"]), plan.frames * every, dt, frames)
