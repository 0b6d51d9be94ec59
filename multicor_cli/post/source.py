"""What all tables have in common: how they show themselves, what they need of a run, and which of its frames they look at."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.optional import library
from multicor_cli.store.errors import NoFrame, frame_number
from multicor_cli.text import with_unit_signs

if TYPE_CHECKING:
    from multicor_cli.store.frame_view import Contacts

# ---- What all tables of `post` can do, besides what they hold: show themselves, and become a DataFrame of pandas

_UNIT = re.compile(r"(.*) \[([^\]]*)\]")
_SHOWN = 60  # rows in a notebook


class Table:
    """A table with ``headings`` and ``rows`` (and, where it is made of more, ``detail_headings`` and ``detail_rows``)."""

    @property
    def headings(self) -> Sequence[str]:
        """Names of the columns of `rows`, with their units in brackets."""
        raise NotImplementedError

    @property
    def rows(self) -> Sequence[Sequence[Any]]:
        """The rows."""
        raise NotImplementedError

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        raise NotImplementedError

    def to_pandas(self, *, is_detailed: bool = False) -> Any:
        """The table as a DataFrame; units of the columns are in its ``attrs["units"]``, those of quantities in a column ``unit``.

        Args:
            is_detailed: Whether to take what the table was made of (over time, or of single grains or contacts), as ``--csv`` does.

        Raises:
            MissingLibrary: If pandas is not installed.
            ValueError: If there are no details.
        """
        pd = library("pandas")
        if is_detailed and not hasattr(self, "detail_rows"):
            message = f"{type(self).__name__} has no details: leave out is_detailed"
            raise ValueError(message)
        table: Any = self
        headings, rows = (table.detail_headings, table.detail_rows) if is_detailed else (self.headings, self.rows)
        parts = [split_unit(heading) for heading in headings]
        found = pd.DataFrame([tuple(row) for row in rows], columns=[name for name, _ in parts])
        if headings[0] == "quantity":
            labels = [split_unit(label) for label in found["quantity"]]
            found["quantity"] = [name.strip() for name, _ in labels]
            found.insert(1, "unit", [unit for _, unit in labels])
        found.attrs["units"] = {name: unit for name, unit in parts if unit}
        return found

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.rows)} rows of {', '.join(self.headings)}>"

    def _repr_html_(self) -> str:
        """The table for a notebook, five digits of each number; of long tables the beginning."""
        head = "".join(f"<th>{html.escape(with_unit_signs(heading))}</th>" for heading in self.headings)
        body = "".join(f"<tr>{''.join(f'<td>{_cell(v)}</td>' for v in row)}</tr>" for row in self.rows[:_SHOWN])
        more = len(self.rows) - _SHOWN
        rest = f"<p>… and {more} more rows</p>" if more > 0 else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}"


def split_unit(text: str) -> tuple[str, str]:
    """Name and unit of a heading ``name [unit]``; without brackets there is no unit."""
    found = _UNIT.fullmatch(text)
    return (found[1], found[2]) if found else (text, "")


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.5g}"
    return html.escape(with_unit_signs(str(value)))


# ---- What post-processing needs of a run, and which of its frames it looks at


class PostError(Exception):
    """What was asked for cannot be computed from this run: one message for the user."""

    exit_code = 2


def rows_of(columns: Iterable[NDArray[Any]]) -> list[tuple[Any, ...]]:
    """The rows of a table of these columns, as plain numbers."""
    return list(zip(*(column.tolist() for column in columns), strict=True))


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
        """Heat of friction and impacts that the grains have received since the start [J], shape ``(n,)``."""

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


def model_of(source: FrameSource, frame: GrainFrame) -> Model:
    """The model of the grains that a frame has: of those that are there, where grains come and go."""
    return getattr(frame, "model", None) or source.model


def need_grains(source: FrameSource, chosen: NDArray[np.int64]) -> None:
    """Raises `PostError` if a frame of ``chosen`` has no grain: none is there yet, or any more."""
    for k in chosen.tolist():
        if not len(source.frames[k].position):
            raise PostError(f"no grain is there in frame {k}: choose frames with --frame, --frames, --from or --to")


def need_same_grains(first: GrainFrame, second: GrainFrame) -> None:
    """Two frames whose grains are compared one by one have the same ones.

    Raises:
        PostError: If they do not.
    """
    before, after = (getattr(frame, "number", None) for frame in (first, second))
    if before is not None and after is not None and not np.array_equal(before, after):
        raise PostError(
            "grains have come or gone between the frames, so that they cannot be compared grain by grain: "
            "choose frames between which none does, or a quantity of single frames"
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
    """Indices of the times from ``start`` to ``end`` [s], both included, but for the rounding of times; None is no limit."""
    slack = _ROUNDING * float(np.abs(times).max(initial=0.0))
    first, last = -np.inf if start is None else start, np.inf if end is None else end
    return np.flatnonzero((times >= first - slack) & (times <= last + slack))


@dataclass(frozen=True)
class Selection:
    """Which frames to look at.

    Without any choice: those of the last stage in the later half of the time between its first and its last frame.

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
            raise PostError(f"no frame is selected: the run has {times.size} frames from t = {times[0]:g} s to {times[-1]:g} s")
        return chosen

    def _choose(self, times: Floats, stages: NDArray[np.integer]) -> NDArray[np.int64]:
        everything = np.arange(times.size)
        if self.frames is not None:
            return np.sort(everything[self.frames])
        if self.start is None and self.end is None:
            last = everything[stages == stages[-1]]
            return np.asarray(last[times[last] >= 0.5 * (times[last[0]] + times[-1])])
        return within(times, self.start, self.end)
