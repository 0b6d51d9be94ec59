"""How LAMMPS says it (package GRANULAR)."""

from __future__ import annotations

from case import TANGENTIAL_SHARE as SHARE
from case import SoftContact
from gran import Dialect


def _pair(style: str, c: SoftContact) -> list[str]:
    """Hooke's contact with tangential history, in either of two styles."""
    if style == "granular":
        law = (
            f"hooke {c.stiffness!r} {c.damping!r} tangential linear_history {c.tangential!r} "
            f"{SHARE!r} {c.friction!r}"
        )
        return ["pair_style granular", f"pair_coeff * * {law} damping mass_velocity"]
    history = (
        f"{c.stiffness!r} {c.tangential!r} {c.damping!r} {SHARE * c.damping!r} {c.friction!r} 1"
    )
    return [f"pair_style gran/hooke/history {history}", "pair_coeff * *"]


def _floor(c: SoftContact) -> str:
    return (
        f"hooke/history {c.stiffness!r} {c.tangential!r} {c.damping!r} {SHARE * c.damping!r} "
        f"{c.friction!r} 1 yplane 0.0 NULL"
    )


LAMMPS = Dialect(
    name="lammps",
    package="lammps",
    executables=("lmp", "lmp_stable"),
    styles=("gran/hooke/history", "granular"),
    begin=("atom_style sphere", "comm_modify vel yes"),
    pair=_pair,
    floor=_floor,
    dump_format=lambda columns: "sort id format float %.17g",
)
"""LAMMPS."""
