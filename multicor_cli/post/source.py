"""What tables read of a run: frames, grains of groups, places of walls, materials."""

from __future__ import annotations

import operator
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import TAIL, Outline, Tail, outlines
from multicor_cli.store.errors import NoFrame, frame_number
from multicor_cli.text import choices

if TYPE_CHECKING:
    from multicor_cli.store.frames import Frame as Frame
    from multicor_cli.store.frames import Frames as Frames
    from multicor_cli.store.reader import Run as Run
else:  # reading is loaded by whoever opens a run
    Frame = Frames = Run = Any

_KEPT = 3 << 20
"""So many numbers, allocated and freed once, have glibc keep as much memory at hand (mallopt(3):
M_MMAP_THRESHOLD is dynamic). Otherwise the arrays of each frame are given back to the system and
come anew, cleared page by page: a tenth of the time."""


class PostError(Exception):
    """What was asked for cannot be computed from this run: one message for the user."""

    exit_code = 2


BIN_LIMIT = 100_000
"""Largest number of bins; more is taken for a mistake."""


def bin_count(bins: int) -> int:
    """A number of bins; raises `PostError` if it is no whole one from 1 to `BIN_LIMIT`."""
    try:
        count = operator.index(bins)
    except TypeError:
        raise PostError(f"the number of bins must be a whole one, is {bins!r}") from None
    if not 1 <= count <= BIN_LIMIT:
        raise PostError(f"{count} bins: choose between 1 and {BIN_LIMIT}")
    return count


def frames_of(source: Run, chosen: NDArray[np.int64]) -> Iterator[Frame]:
    """The frames of these numbers, one after the other."""
    np.empty(_KEPT)
    return (source.frames[int(k)] for k in chosen)


def places_of(frame: Frame) -> Floats:
    """Centers of the grains [m], shape ``(n, 2)``."""
    return np.asarray(frame.position, np.float64)[:, :2]


def need_grains(source: Run, chosen: NDArray[np.int64]) -> None:
    """Raises `PostError` if a frame of ``chosen`` has no grain: none is there yet, or any more."""
    for k in chosen.tolist():
        if not len(source.frames[k].position):
            raise PostError(
                f"no grain is there in frame {k}: choose frames with --frame, --frames, --from or "
                "--to"
            )


def need_same_grains(first: Frame, second: Frame) -> None:
    """Raises `PostError` unless two frames, to be compared grain by grain, have the same grains."""
    if not np.array_equal(first.number, second.number):
        raise PostError(
            "grains have come or gone between the frames, so that they cannot be compared grain "
            "by grain: choose frames between which none does, or a quantity of single frames"
        )


def need_two(chosen: NDArray[np.int64], what: str, or_else: str = "") -> None:
    """Raises `PostError` if one frame alone is chosen: what needs two, and another remedy."""
    if chosen.size < 2:
        raise PostError(
            f"{what}; only one is selected: choose more with --from or --frames{or_else}"
        )


def refuse_cell(model: Model, what: str, remedy: str) -> None:
    """Raises `PostError` of a cell: what it lacks and why, and what to do."""
    if model.is_cell:
        raise PostError(f"in a cell that is periodic in x and y {what}: {remedy}")


def need_heat(values: NDArray[Any] | None) -> Floats:
    """Values of a frame that only a run with heat has; raises `PostError` in a run without."""
    if values is None:
        raise PostError("the run has no heat: give its scenario a table [heat] and run it again")
    return np.asarray(values, np.float64)


def wall_temperatures(source: Run, chosen: NDArray[np.int64]) -> Floats:
    """Temperatures of the walls in frames [K], shape ``(f, w)``; nan where none is prescribed.

    Before the first step walls have none yet: a frame of the start has those of the next one.
    """
    found = np.array([need_heat(frame.wall_temperature) for frame in frames_of(source, chosen)])
    if chosen.size > 1 and source.frames[int(chosen[0])].step == 0:
        found[0] = found[1]
    return found


def frame_index(frames: Frames, frame: int) -> int:
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


@dataclass(frozen=True)
class SeenFrame:
    """A frame of which something is seen otherwise; all else is as the frame has it."""

    frame: Frame

    def __getattr__(self, name: str) -> Any:
        return getattr(self.frame, name)


@dataclass(frozen=True)
class _SeenFrames:
    """The frames of a run, each as it is ``seen``, by its number; the times are as they are."""

    frames: Frames
    seen: Callable[[int], Any]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.frames, name)

    def __getitem__(self, index: int) -> Any:
        return self.seen(index)


def _seen(source: Run, seen: Callable[[int], Any]) -> Run:
    frames = _SeenFrames(source.frames, seen)
    return cast("Run", SimpleNamespace(model=source.model, frames=frames))


@dataclass(frozen=True)
class FrameSince(SeenFrame):
    """A frame of a run with one before it, for what happens between both."""

    run: Run
    before: Frame


def with_frames_before(source: Run, chosen: NDArray[np.int64]) -> tuple[Run, NDArray[np.int64]]:
    """The run with all frames of ``chosen`` but the first as `FrameSince`, and which these are.

    Raises `PostError` if only one is chosen.
    """
    need_two(chosen, "what moves from frame to frame needs two frames")
    frames, before = source.frames, dict(zip(chosen[1:].tolist(), chosen.tolist(), strict=False))
    seen = _seen(source, lambda k: FrameSince(frames[k], source, frames[before[k]]))
    return seen, chosen[1:]


_ROUNDING = 1e-9  # times are sums of steps, and a frame at 0.06 s may say 0.060000000000000005


def times_of(source: Run, chosen: NDArray[np.int64]) -> Floats:
    """Times of frames [s], shape ``(f,)``."""
    return np.asarray(source.frames.time, np.float64)[chosen]


def frames_told(source: Run, chosen: NDArray[np.int64]) -> dict[str, Any]:
    """What JSON says of the frames that a table is about: their number, first and last time [s]."""
    times = times_of(source, chosen)
    return {"frame_count": int(chosen.size), "times": (float(times[0]), float(times[-1]))}


_SHORT = 0.5  # part of the interval before


def bounds_of_intervals(source: Run, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the frames ``chosen`` that bound intervals over which means are taken.

    The end of a stage has a frame whenever it comes. If the interval that it ends is shorter than
    half of that before, both are one: a mean over a step or two is noise.
    """
    times, stages = (np.asarray(getattr(source.frames, of))[chosen] for of in ("time", "stage"))
    lengths, is_kept = np.diff(times), np.ones(chosen.size, np.bool_)
    for k in range(2, chosen.size):
        is_last = k + 1 == chosen.size or stages[k + 1] != stages[k]
        if is_last and stages[k - 2] == stages[k]:
            is_kept[k - 1] = lengths[k - 1] >= _SHORT * lengths[k - 2]
    return chosen[is_kept]


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

    def indices(self, frames: Frames) -> NDArray[np.int64]:
        """Indices of the selected frames, ascending.

        Raises:
            PostError: If the run has no frames, or none of them is selected.
        """
        times, stages = np.asarray(frames.time), np.asarray(frames.stage)
        if not times.size:
            raise PostError("the run has no frames yet")
        if self.frames is not None:
            chosen = np.sort(np.arange(times.size)[self.frames])
        elif self.start is None and self.end is None:
            last = np.flatnonzero(stages == stages[-1])
            chosen = last[times[last] >= 0.5 * (times[last[0]] + times[-1])]
        else:
            chosen = within(times, self.start, self.end)
        if not chosen.size:
            raise PostError(
                f"no frame is selected: the run has {times.size} frames from t = {times[0]:g} s "
                f"to {times[-1]:g} s"
            )
        return chosen


def chosen_frames(source: Run, selection: Selection | None) -> NDArray[np.int64]:
    """Indices of the frames of a selection, by default of those that `Selection` has by default."""
    return (selection or Selection()).indices(source.frames)


# ---- A run as if it had only the grains of some of its groups

_OF_GRAINS = ("position", "velocity", "spin", "temperature", "generated", "unwrapped", "angle")


class FrameOfGroups:
    """A frame with the grains of some groups; walls, times and the like are those of the whole.

    Attributes:
        whole: The frame with all its grains.
        rows: Rows of these grains in it, shape ``(n,)``.
    """

    def __init__(self, whole: Frame, model: Model, groups: NDArray[np.int64]) -> None:
        self.whole, self._model = whole, model
        self.rows = np.flatnonzero(np.isin(model.grains.group, groups))

    @cached_property
    def model(self) -> Model:
        """The model of these grains."""
        return self._model.with_grains(self.rows)

    @property
    def number(self) -> NDArray[np.int64]:
        """Numbers of these grains among all of the run, shape ``(n,)``."""
        return np.asarray(self.whole.number)[self.rows]

    @property
    def contacts(self) -> Any:
        """Refused: a contact may be one with a grain of another group; see `parts`."""
        raise PostError(
            "contacts are not those of one group: leave out --group, or choose a quantity of grains"
        )

    def __getattr__(self, name: str) -> Any:
        values = getattr(self.whole, name)
        return values if name not in _OF_GRAINS or values is None else np.asarray(values)[self.rows]


def of_groups(source: Run, names: Sequence[str]) -> Run:
    """The run as if it had only grains of these groups; raises `PostError` if one is missing."""
    known = source.model.groups
    for name in names:
        if name not in known:
            raise PostError(f"there is no group '{name}'; {choices(name, known)}")
    groups = np.array([known.index(name) for name in names], np.int64)

    def seen(index: int) -> FrameOfGroups:
        frame = source.frames[index]
        return FrameOfGroups(frame, frame.model, groups)

    return _seen(source, seen)


# ---- A run turned by a right angle: what is measured from below upwards is from left to right


def turned(source: Run) -> Run:
    """The run, turned to the left: places, normals and walls; not its time series.

    What lies at (x, y) is at (−y, x) there: a wall on the left of the grains is below them. The
    domain must not be periodic.
    """
    return cast("Run", _TurnedRun(source))


def _turn(vectors: ArrayLike) -> Floats:
    """Vectors, or what begins with them, of shape ``(…, k)`` with k ≥ 2."""
    found = np.array(vectors, np.float64)
    found[..., 0], found[..., 1] = -found[..., 1].copy(), found[..., 0].copy()
    return found


def _turn_model(model: Model) -> Model:
    shapes, tail = model.shapes, TAIL[model.shapes.kind]
    moves = (tail == Tail.DIRECTION) | (tail == Tail.POINT)
    geometry = _turn(shapes.geometry)
    geometry[moves, 2:] = _turn(geometry[moves, 2:])
    return replace(model, shapes=replace(shapes, geometry=geometry))


@dataclass(frozen=True)
class _TurnedContacts:
    contacts: Any

    def __getattr__(self, name: str) -> Any:
        return getattr(self.contacts, name)

    @cached_property
    def normal(self) -> Floats:
        return _turn(self.contacts.normal)

    @cached_property
    def arm(self) -> Floats | None:
        arm = self.contacts.arm
        return None if arm is None else _turn(arm)


@dataclass(frozen=True)
class _TurnedFrame(SeenFrame):
    model: Model

    @cached_property
    def position(self) -> Floats:
        return _turn(self.frame.position)

    @cached_property
    def angle(self) -> Floats:
        return np.asarray(self.frame.angle, np.float64) + 0.5 * np.pi

    @cached_property
    def wall_position(self) -> Floats:
        return _turn(self.frame.wall_position)

    @cached_property
    def contacts(self) -> _TurnedContacts:
        return _TurnedContacts(self.frame.contacts)


@dataclass(frozen=True)
class _TurnedRun:
    source: Run

    def __getattr__(self, name: str) -> Any:
        return getattr(self.source, name)

    @cached_property
    def model(self) -> Model:
        return _turn_model(self.source.model)

    @cached_property
    def frames(self) -> _SeenFrames:
        return _SeenFrames(self.source.frames, self._turned_frame)

    def _turned_frame(self, index: int) -> _TurnedFrame:
        frame = self.source.frames[index]
        model = frame.model
        return _TurnedFrame(frame, self.model if model is self.source.model else _turn_model(model))


# ---- Where the walls of a frame are


def placed_walls(
    model: Model, pose: Floats, is_asked: NDArray[np.bool_] | None = None
) -> Iterator[tuple[NDArray[np.int64], Outline]]:
    """Which shapes of the walls asked for, with outlines at ``pose`` [m, rad], kind by kind."""
    shapes, asked = model.shapes, np.arange(model.shape_count)
    if is_asked is not None:
        asked = np.flatnonzero(is_asked[shapes.wall])
    for which, outline in outlines(shapes.kind[asked], shapes.geometry[asked]):
        own = pose[shapes.wall[asked[which]]]
        points = rotated(outline.points, own[:, np.newaxis, 2]) + own[:, np.newaxis, :2]
        normal = None if outline.normal is None else rotated(outline.normal, own[:, 2])
        yield asked[which], replace(outline, points=points, normal=normal)


def rotated(vectors: Floats, angle: Floats) -> Floats:
    """Vectors of shape ``(…, 2)``, turned by angles [rad] of a shape that broadcasts to ``(…)``."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


# ---- What the scenario of a run says of materials and of heat: models do not hold it


def properties(source: Run, key: str) -> Floats:
    """A property of each material of the model; nan where it is not given, shape ``(k,)``."""
    said = tomllib.loads(source.scenario_resolved).get("materials", {})
    return np.array([said.get(name, {}).get(key, np.nan) for name in source.model.materials], float)


def solid_conductivity(source: Run) -> float:
    """The conductivity of the grains [W/(m K)]; nan if they have none, or several."""
    found = np.unique(properties(source, "conductivity")[np.unique(source.model.grains.material)])
    return float(found[0]) if found.size == 1 else np.nan


def gas_conductivity(source: Run) -> float:
    """The conductivity of the gas, in the gaps or around the grains [W/(m K)]; nan without one."""
    heat = heat_table(source)
    said = heat.get("gas", {}).get("conductivity", heat.get("ambient", {}).get("conductivity"))
    return np.nan if said is None else float(said)


def heat_table(source: Run) -> dict[str, Any]:
    """The table ``[heat]`` of the scenario, with all defaults; empty in a run without heat."""
    found: dict[str, Any] = tomllib.loads(source.scenario_resolved).get("heat", {})
    return found


def left_out(source: Run) -> str:
    """What conducts beside the contacts, in the scenario of the run; empty if nothing does."""
    heat = heat_table(source)
    ways = []
    if "gas" in heat:
        ways.append("the gas in the gaps")
    if heat.get("radiation", {}).get("neighbors"):
        ways.append("radiation between neighbors")
    return " and ".join(ways)
