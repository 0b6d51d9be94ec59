"""What post-processing needs of a run, and which of its frames it looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.store.errors import NoFrame, frame_number

if TYPE_CHECKING:
    from multicor_cli.store.frames import Contacts, NamedColumn


class PostError(Exception):
    """What was asked for cannot be computed from this run: one message for the user."""

    exit_code = 2


class GrainFrame(Protocol):
    """The grains and walls at one time; what belongs to heat is None in a run without."""

    @property
    def position(self) -> NDArray[Any]:
        """Centers: x and y come first [m], shape ``(n, 2)`` or more columns."""

    @property
    def velocity(self) -> NDArray[Any]:
        """Velocities: x and y come first [m/s], shape ``(n, 2)`` or more columns."""

    @property
    def spin(self) -> NDArray[Any]:
        """Spins of the grains [rad/s], shape ``(n,)``."""

    @property
    def temperature(self) -> NDArray[Any] | None:
        """Temperatures of the grains [K], shape ``(n,)``."""

    @property
    def generated(self) -> NDArray[Any] | None:
        """Heat of friction and impacts received since the start [J], shape ``(n,)``."""

    @property
    def wall_temperature(self) -> NDArray[Any] | None:
        """Temperatures of the walls [K], nan where none is prescribed, shape ``(w,)``."""

    @property
    def dt(self) -> float:
        """Length of the last step [s]; 0 before the first."""

    @property
    def unwrapped(self) -> NDArray[Any]:
        """Centers with the periods added by which x was wrapped [m], shape ``(n, 2)``."""

    @property
    def angle(self) -> NDArray[Any]:
        """Rotations since the start of the run [rad], shape ``(n,)``."""

    @property
    def contacts(self) -> Contacts:
        """Contacts of the last step."""

    @property
    def wall_position(self) -> NDArray[Any]:
        """Walls: x, y [m] and angle [rad] of their frames, shape ``(w, 3)``."""

    @property
    def wall_velocity(self) -> NDArray[Any]:
        """Walls: velocity [m/s] and spin [rad/s], shape ``(w, 3)``."""


class FrameSequence(Protocol):
    """The frames of a run, read one by one."""

    @property
    def time(self) -> NDArray[Any]:
        """Times of the frames [s], shape ``(frames,)``."""

    @property
    def stage(self) -> NDArray[Any]:
        """Loading stage of each frame, shape ``(frames,)``."""

    def __getitem__(self, index: int) -> GrainFrame:
        """Read a frame."""


class FrameSource(Protocol):
    """What post-processing needs of a run; `multicor_cli.open_run` gives it."""

    @property
    def model(self) -> Model:
        """What does not change."""

    @property
    def frames(self) -> FrameSequence:
        """The frames."""


class SeriesSource(FrameSource, Protocol):
    """A run with its time series and its scenario; `multicor_cli.open_run` gives it."""

    @property
    def series(self) -> Mapping[str, NDArray[Any]]:
        """The time series by name."""

    @property
    def series_columns(self) -> list[NamedColumn]:
        """The time series as columns with names and units."""

    @property
    def scenario_resolved(self) -> str:
        """The scenario with all defaults."""


def model_of(source: FrameSource, frame: GrainFrame) -> Model:
    """The model of the grains that are there in a frame, where grains come and go."""
    return getattr(frame, "model", None) or source.model


def need_grains(source: FrameSource, chosen: NDArray[np.int64]) -> None:
    """Raises `PostError` if a frame of ``chosen`` has no grain: none is there yet, or any more."""
    for k in chosen.tolist():
        if not len(source.frames[k].position):
            raise PostError(
                f"no grain is there in frame {k}: choose frames with --frame, --frames, --from or "
                "--to"
            )


def need_same_grains(first: GrainFrame, second: GrainFrame) -> None:
    """Raises `PostError` unless two frames, to be compared grain by grain, have the same grains."""
    before, after = (getattr(frame, "number", None) for frame in (first, second))
    if before is not None and after is not None and not np.array_equal(before, after):
        raise PostError(
            "grains have come or gone between the frames, so that they cannot be compared grain "
            "by grain: choose frames between which none does, or a quantity of single frames"
        )


def need_heat(values: NDArray[Any] | None) -> Floats:
    """Values of a frame that only a run with heat has; raises `PostError` in a run without."""
    if values is None:
        raise PostError("the run has no heat: give its scenario a table [heat] and run it again")
    return np.asarray(values, np.float64)


def frame_index(frames: FrameSequence, frame: int) -> int:
    """A frame counted from the first one, of one that may count from the last.

    Args:
        frames: The frames.
        frame: Index; negative counts from the last one.

    Raises:
        PostError: If there is no such frame.
    """
    try:
        return frame_number(np.asarray(frames.time).size, frame)
    except NoFrame as error:
        raise PostError(str(error)) from None


_ROUNDING = 1e-9  # times are sums of steps, and a frame at 0.06 s may say 0.060000000000000005


def within(times: Floats, start: float | None, end: float | None) -> NDArray[np.int64]:
    """Indices of times from ``start`` to ``end`` [s], both included despite rounding."""
    slack = _ROUNDING * float(np.abs(times).max(initial=0.0))
    first, last = -np.inf if start is None else start, np.inf if end is None else end
    return np.flatnonzero((times >= first - slack) & (times <= last + slack))


@dataclass(frozen=True)
class Selection:
    """Which frames to look at.

    By default those of the last stage in the later half of the time that its frames span.

    Attributes:
        start: Earliest time [s]; a frame at this time is included.
        end: Latest time [s]; likewise.
        frames: A slice of the frames, as in Python.
    """

    start: float | None = None
    end: float | None = None
    frames: slice | None = None

    def indices(self, frames: FrameSequence) -> NDArray[np.int64]:
        """Indices of the selected frames, ascending.

        Raises:
            PostError: If the run has no frames, or none of them is selected.
        """
        times = np.asarray(frames.time)
        if not times.size:
            raise PostError("the run has no frames yet")
        chosen = self._choose(times, np.asarray(frames.stage))
        if not chosen.size:
            raise PostError(
                f"no frame is selected: the run has {times.size} frames from t = {times[0]:g} s "
                f"to {times[-1]:g} s"
            )
        return chosen

    def _choose(self, times: Floats, stages: NDArray[np.integer]) -> NDArray[np.int64]:
        everything = np.arange(times.size)
        if self.frames is not None:
            return np.sort(everything[self.frames])
        if self.start is None and self.end is None:
            last = everything[stages == stages[-1]]
            return np.asarray(last[times[last] >= 0.5 * (times[last[0]] + times[-1])])
        return within(times, self.start, self.end)
