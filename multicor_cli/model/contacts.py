"""The contacts of one step: what is stored of them, and looked at."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.books import DType, Export, Shape, stored
from multicor_cli.model.model import Floats, Ints


def _column(
    unit: str,
    meaning: str,
    dtype: DType = "float",
    *,
    columns: tuple[str, ...] = (),
    exports: tuple[Export, ...] = ("vtk",),
    default: Any = MISSING,
    **more: Any,
) -> Any:
    dims: Shape = ("contact_row", len(columns)) if columns else ("contact_row",)
    about = {"columns": columns, "exports": exports, **more}
    return stored(default, dtype=dtype, dims=dims, unit=unit, meaning=meaning, **about)


def _heat(unit: str, meaning: str, exports: tuple[Export, ...] = ("vtk",)) -> Any:
    """What contacts have in runs with heat; None if no heat was computed."""
    return _column(unit, meaning, exports=exports, only_with="heat", default=None)


def are_impacts(gap: Floats) -> NDArray[np.bool_]:
    """Which contacts were impacts of grains in flight, and are over: their gap is −0."""
    return np.asarray((gap == 0.0) & np.signbit(gap))


@dataclass(frozen=True)
class ContactTable:
    """Contacts of one step, sorted by (i, j); every array has a row for each of the ``c`` contacts.

    Grains that are no discs touch at points: pairs that touch at several have a row for each.

    Each field says its unit and meaning, as docs/reference/formats/results.md lists them. Normals
    and gaps are those at mid-step, but of impacts in flight those of the touch, with a gap of −0.
    """

    i: Ints = _column("1", "first shape of the contact: a grain", "i4", exports=())
    j: Ints = _column("1", "second shape: a grain if < n, else wall shape j - n", "i4", exports=())
    normal: Floats = _column("1", "unit normal n from j to i; the tangent is n turned by +90 deg",
        columns=("normal_x", "normal_y"), exports=())  # fmt: skip
    gap: Floats = _column("m", "gap, negative where shapes overlap")
    impulse: Floats = _column("N s", "normal and tangential impulse on i in the last step",
        columns=("normal_impulse", "tangential_impulse"))  # fmt: skip
    slip: Floats = _column("m/s", "tangential velocity of i relative to j after the step")
    sliding: NDArray[np.bool_] = _column(
        "1", "1 if the contact slides, 0 if it sticks or carries nothing", "u1"
    )
    heat: Floats | None = _heat(
        "J", "heat generated in the contact in the last step", exports=("vtk", "gsd")
    )
    conductance: Floats | None = _heat("W/K", "conductance of the contact in the last step")
    arm: Floats | None = _column("m", "from the center of i to the point where it touches j",
        columns=("arm_x", "arm_y"), only_with="outlines", since=(1, 12), default=None)  # fmt: skip
    couple: Floats | None = _column("N m s",
        "impulse of the rolling resistance on i in the last step", only_with="rolling",
        since=(1, 1), default=None)  # fmt: skip

    def carrying(self) -> ContactTable:
        """The contacts that carry a force or heat, which frames hold; others were only near."""
        kept = self.impulse[:, 0] != 0.0  # tension is negative
        for values in (self.heat, self.conductance, self.couple):
            kept = kept if values is None else kept | (values != 0.0)
        if kept.all():
            return self
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(
            self, **{name: values[kept] for name, values in columns.items() if values is not None}
        )

    @classmethod
    def empty(cls) -> ContactTable:
        """No contacts."""
        none, nothing = np.zeros(0, np.int32), np.zeros(0)
        return cls(
            none, none, np.zeros((0, 2)), nothing, np.zeros((0, 2)), nothing, np.zeros(0, np.bool_)
        )
