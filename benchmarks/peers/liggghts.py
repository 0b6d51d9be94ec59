"""How LIGGGHTS says it."""

from __future__ import annotations

from case import TANGENTIAL_SHARE, SoftContact
from gran import Dialect


def _pair(style: str, c: SoftContact) -> list[str]:
    """Hooke's contact with tangential history."""
    values = {
        "kn": c.stiffness,
        "kt": c.tangential,
        "gamman": c.damping,
        "gammat": TANGENTIAL_SHARE * c.damping,
        "coefficientFriction": c.friction,
    }
    properties = [
        f"fix {name} all property/global {name} peratomtypepair 1 {value!r}"
        for name, value in values.items()
    ]
    return [*properties, f"pair_style gran model {style} tangential history", "pair_coeff * *"]


LIGGGHTS = Dialect(
    name="liggghts",
    package="liggghts",
    executables=("liggghts", "lmp_auto"),
    styles=("hooke/stiffness",),
    begin=("atom_style granular", "communicate single vel yes"),
    pair=_pair,
    floor=lambda contact: "model hooke/stiffness tangential history primitive type 1 yplane 0.0",
    dump_format=lambda columns: 'sort id format "%d ' + " ".join(["%.17g"] * columns) + '"',
)
"""LIGGGHTS."""
