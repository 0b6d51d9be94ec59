"""Frames of a run as lazy numpy arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.store import schema
from multicor_cli.store.errors import DamagedRun, frame_number
from multicor_cli.store.parts import Parts

Array = NDArray[Any]

_SPECS = {spec.path: spec for spec in schema.FRAME_TABLE}


class Contacts:
    """The contacts of a frame, ordered by ``(i, j)``; ``c`` of them. Every array is read when it is first used."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame

    def __len__(self) -> int:
        return len(self.gap)

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self)

    @cached_property
    def recorded(self) -> bool:
        """Whether the contacts of this frame are in the file; if not, all arrays are empty."""
        return bool(self._frame.column("steps/contacts_recorded")[0])

    @cached_property
    def i(self) -> Array:
        """First shape, a grain, shape ``(c,)``; raises `DamagedRun` if there is no such grain."""
        return self._shapes("contacts/i", self._frame.facts.grain_count)

    @cached_property
    def j(self) -> Array:
        """Second shape: a grain if below the number of grains n, else wall shape ``j - n``, shape ``(c,)``; raises as `i`."""
        return self._shapes("contacts/j", self._frame.facts.shape_count)

    def _shapes(self, path: str, count: int) -> Array:
        """Numbers of shapes: files that come from elsewhere may hold anything."""
        found = self._frame.column(path)
        if found.size and not 0 <= found.min() <= found.max() < count:
            raise DamagedRun(f"frame {self._frame.index}: damaged ({path} names shapes that do not exist)")
        return found

    @cached_property
    def kind(self) -> Array:
        """0 grain–grain, 1 grain–wall, shape ``(c,)``."""
        return self._frame.column("contacts/kind")

    @cached_property
    def normal(self) -> Array:
        """Unit normal from j to i, shape ``(c, 2)``; the tangent is the normal turned by +90°."""
        return self._frame.column("contacts/normal")

    @cached_property
    def gap(self) -> Array:
        """Gap [m], negative where shapes overlap, shape ``(c,)``."""
        return self._frame.column("contacts/gap")

    @cached_property
    def impulse(self) -> Array:
        """Normal and tangential impulse on i in the last step [N s], shape ``(c, 2)``."""
        return self._frame.column("contacts/impulse")

    @property
    def force(self) -> Array:
        """Mean normal and tangential force on i over the last step [N], shape ``(c, 2)``; zero before the first step."""
        dt = self._frame.dt
        return self.impulse / dt if dt > 0.0 else np.zeros_like(self.impulse)

    @cached_property
    def slip(self) -> Array:
        """Tangential velocity of i relative to j after the step [m/s], shape ``(c,)``."""
        return self._frame.column("contacts/slip")

    @cached_property
    def sliding(self) -> NDArray[np.bool_]:
        """Whether the contact slides, shape ``(c,)``."""
        return self._frame.column("contacts/sliding").astype(np.bool_)

    @cached_property
    def heat(self) -> Array | None:
        """Heat generated in the contact in the last step [J], shape ``(c,)``; None in a run without heat."""
        return self._frame.heat_column("contacts/heat")

    @cached_property
    def conductance(self) -> Array | None:
        """Conductance of the contact in the last step [W/K], shape ``(c,)``; None in a run without heat."""
        return self._frame.heat_column("contacts/conductance")


class Frame:
    """One frame; ``n`` grains, ``w`` walls. Every array is read when it is first used, and kept.

    Attributes:
        index: Number of the frame in the run.
        facts: What is known of the model.
    """

    def __init__(self, parts: Parts, index: int, facts: ModelFacts) -> None:
        self._parts, self.facts = parts, facts
        self.index = index

    def column(self, path: str) -> Array:
        """The rows of any dataset of ``schema.FRAME_TABLE`` that belong to this frame, as stored.

        Raises:
            KeyError: If there is no such dataset.
            DamagedRun: If the file is damaged, or the run has no such quantity.
            StorageError: If it cannot be read.
        """
        spec = _SPECS[path]
        rows = self._parts.frame_rows(spec, self.index)
        if spec.row == "particle_row" and len(rows) != self.facts.grain_count:
            raise DamagedRun(
                f"frame {self.index} has {len(rows)} grains and its run {self.facts.grain_count}; check it with multicor verify"
            )
        return rows

    def heat_column(self, path: str) -> Array | None:
        """As `column`, for what only runs with heat have: None in a run without."""
        return self.column(path) if self.has_heat else None

    @cached_property
    def has_heat(self) -> bool:
        """Whether the run has heat."""
        return "heat" in (self._parts.features or ())

    @cached_property
    def step(self) -> int:
        """Steps done since the start of the run."""
        return int(self.column("steps/step")[0])

    @cached_property
    def time(self) -> float:
        """Time [s]."""
        return float(self.column("steps/time")[0])

    @cached_property
    def dt(self) -> float:
        """Length of the last step [s]; 0 before the first."""
        return float(self.column("steps/dt")[0])

    @cached_property
    def stage(self) -> int:
        """Index of the loading stage."""
        return int(self.column("steps/stage")[0])

    @cached_property
    def position(self) -> Array:
        """Centers of the grains, x wrapped into the period [m], shape ``(n, 2)``."""
        return self.column("particles/position")[:, :2]

    @property
    def unwrapped(self) -> Array:
        """Centers of the grains with the periods added by which x was wrapped [m], shape ``(n, 2)``."""
        position = np.array(self.position, np.float64)
        position[:, 0] += self.image * self.facts.period
        return position

    @cached_property
    def angle(self) -> Array:
        """Rotation of the grains since the start [rad], shape ``(n,)``."""
        return self.column("particles/angle")

    @cached_property
    def image(self) -> Array:
        """Periods by which x was wrapped, shape ``(n,)``."""
        return self.column("particles/image")

    @cached_property
    def velocity(self) -> Array:
        """Velocities of the grains [m/s], shape ``(n, 2)``."""
        return self.column("particles/velocity")[:, :2]

    @cached_property
    def spin(self) -> Array:
        """Angular velocities of the grains [rad/s], shape ``(n,)``."""
        return self.column("particles/spin")

    @cached_property
    def wall_position(self) -> Array:
        """Displacement [m] and angle [rad] of the walls since the start, shape ``(w, 3)``."""
        return self.column("walls/position").reshape(-1, 3)

    @cached_property
    def wall_velocity(self) -> Array:
        """Velocity [m/s] and spin [rad/s] of the walls, shape ``(w, 3)``."""
        return self.column("walls/velocity").reshape(-1, 3)

    @cached_property
    def temperature(self) -> Array | None:
        """Temperatures of the grains [K], shape ``(n,)``; this and what follows is None in a run without heat."""
        return self.heat_column("particles/temperature")

    @cached_property
    def generated(self) -> Array | None:
        """Heat of friction and impacts that the grains have received since the start [J], shape ``(n,)``."""
        return self.heat_column("particles/generated")

    @cached_property
    def wear(self) -> Array | None:
        """Volume worn off the grains since the start [m³], shape ``(n,)``."""
        return self.heat_column("particles/wear")

    @cached_property
    def wall_temperature(self) -> Array | None:
        """Temperatures of the walls [K], nan where none is prescribed, shape ``(w,)``."""
        found = self.heat_column("walls/temperature")
        return None if found is None else found.reshape(-1)

    @cached_property
    def wall_heat(self) -> Array | None:
        """Walls: heat given to the grains, and heat of friction and impacts received, since the start [J], shape ``(w, 2)``."""
        found = self.heat_column("walls/heat")
        return None if found is None else found.reshape(-1, 2)

    @cached_property
    def wall_wear(self) -> Array | None:
        """Volume worn off the walls since the start [m³], shape ``(w,)``."""
        found = self.heat_column("walls/wear")
        return None if found is None else found.reshape(-1)

    @cached_property
    def contacts(self) -> Contacts:
        """Contacts of the last step."""
        # They read through a frame of their own: one that held itself would keep its arrays until the next garbage collection.
        return Contacts(Frame(self._parts, self.index, self.facts))


class ModelFacts:
    """What frames need to know of the model, which is read when that is first needed."""

    def __init__(self, model: Callable[[], Model]) -> None:
        self._model = model

    @cached_property
    def period(self) -> float:
        """Period in x [m]; 0 if the domain is not periodic."""
        return self._model().period

    @cached_property
    def grain_count(self) -> int:
        """Number of grains n."""
        return self._model().grain_count

    @cached_property
    def shape_count(self) -> int:
        """Number of grains and wall shapes n + m."""
        return self.grain_count + self._model().shape_count


class Frames(Sequence[Frame]):
    """All frames of a run: a sequence of `Frame`; a slice gives a list of lazy frames; `NoFrame` where there is none."""

    def __init__(self, parts: Parts, facts: ModelFacts) -> None:
        self._parts, self.facts = parts, facts

    def __len__(self) -> int:
        return self._parts.frame_count

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        return Frame(self._parts, frame_number(len(self), index), self.facts)

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(len(self)))

    @cached_property
    def step(self) -> Array:
        """Step of every frame, shape ``(K,)``."""
        return self._parts.column(_SPECS["steps/step"])

    @cached_property
    def time(self) -> Array:
        """Time of every frame [s], shape ``(K,)``."""
        return self._parts.column(_SPECS["steps/time"])

    @cached_property
    def stage(self) -> Array:
        """Loading stage of every frame, shape ``(K,)``."""
        return self._parts.column(_SPECS["steps/stage"])

    def column(self, path: str) -> Array:
        """A dataset of ``schema`` with one row per frame (``steps/*``, ``walls/*``), over the whole run."""
        return self._parts.column(_SPECS[path])
