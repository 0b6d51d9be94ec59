"""Grains that come and go before a step: which, where there is room, their books, who is present.

Who comes and goes is a function of the state alone. The step itself knows only grains that are
present: those that wait or have gone cost nothing, and no loop can meet one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.energy.account import book_exchange
from multicor_cli.engine.geometry.scene import gap_to_shape, minimum_image, scene_of
from multicor_cli.engine.heat.books import book_heat_out
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.orders import InflowRules, Outlet, PhysicsError, Release
from multicor_cli.model.books import EXCHANGE_NAMES, stored_fields
from multicor_cli.model.columns import RADIUS, SPIN, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import Presence, State

# ---- Where a grain finds room among the grains that are there and the walls


@kernel
def first_free(
    place: Floats, radius: float, disc: Floats, kind: Ints, world: Floats,
    is_met: NDArray[np.bool_], period: float,
) -> int:  # fmt: skip
    """The first place where a grain overlaps nothing; −1 if there is none.

    Centers to try [m] have shape ``(k, 2)``, ``disc``, x, y and radius of the grains around [m],
    ``(d, 3)``; ``kind``, ``world`` and ``is_met`` are of the wall shapes, as `Scene` has them.
    """
    for k in range(place.shape[0]):
        x, y = place[k, X], place[k, Y]
        is_free = True
        for d in range(disc.shape[0]):
            dx, dy = minimum_image(x - disc[d, X], period), y - disc[d, Y]
            near = radius + disc[d, RADIUS]
            if dx * dx + dy * dy < near * near:
                is_free = False
                break
        for shape in range(kind.size):
            if not is_free:
                break
            is_free = (
                not is_met[shape]
                or gap_to_shape(x, y, radius, shape, kind, world, period)[0] >= 0.0
            )
        if is_free:
            return k
    return -1


def find_room(
    release: Release, number: int, grain: int, model: Model, state: State
) -> tuple[float, float] | None:
    """Where a waiting grain can be released now [m], in release ``number``; None without room."""
    radius = float(model.grains.radius[grain])
    low, high = np.array(release.region.low), np.array(release.region.high)
    inset = np.array([0.0 if release.spans_period else radius, radius])
    place = low + inset + release.draw(number) * np.maximum(high - low - 2.0 * inset, 0.0)
    scene = scene_of(model, state.position, state.wall_position)
    shapes = np.arange(model.shape_count)
    is_met = model.is_met(np.full(shapes.size, grain), shapes)
    found = first_free(
        place, radius, _discs_near(low, high, model, state), scene.kind, scene.world, is_met,
        model.period,
    )  # fmt: skip
    return None if found < 0 else (float(place[found, X]), float(place[found, Y]))


def _discs_near(low: Floats, high: Floats, model: Model, state: State) -> Floats:
    """x, y and radius of the grains there that reach into a rectangle [m], shape ``(d, 3)``."""
    here = state.here
    radius = (state.radius if state.radius.size else model.grains.radius)[here]
    position = state.position[here]
    offset = np.abs(position[:, :2] - 0.5 * (low + high))
    if model.period > 0.0:
        offset[:, X] = np.minimum(offset[:, X], np.abs(model.period - offset[:, X]))
    near = (offset < 0.5 * (high - low) + radius[:, np.newaxis]).all(axis=1)
    return np.column_stack([position[near, :2], radius[near]])


# ---- Books of grains that come and go: numbers, masses, and the energy and heat they take along.
#
# A grain enters the energy books with the kinetic energy of its release, and leaves them with what
# it has then. Its heat content counts from the temperature with which it came, so that it brings
# none, and takes along what it has received.

_BOOK = {name: k for k, name in enumerate(EXCHANGE_NAMES)}


def book_in(state: State, model: Model, grains: NDArray[np.int64]) -> None:
    """Enter grains that have just been released, where they are and as they move."""
    kinetic, potential = _energies(state, model, grains)
    book_exchange(state, kinetic, 0.0)
    _add(state, "potential_in", potential)
    _count(state, model, grains, "released")


def book_out(state: State, model: Model, grains: NDArray[np.int64], what: str) -> None:
    """Enter grains that are about to go; ``what`` is ``"left"`` or ``"lost"``."""
    kinetic, potential = _energies(state, model, grains)
    book_exchange(state, 0.0, kinetic)
    _add(state, "potential_out", potential)
    _count(state, model, grains, what)
    if state.heat.size:
        book_heat_out(state, state.heat[grains])


def note_presence(state: State, model: Model, behind: int) -> None:
    """Count who is there and who waits, compare all masses; ``behind`` releases found no room."""
    books, mass = state.exchange, model.grains.mass
    for name, status in (("waiting", Presence.WAITS), ("present", Presence.THERE)):
        which = np.flatnonzero(state.presence == status)
        books[_BOOK[name]] = which.size
        books[_BOOK[f"mass_{name}"]] = total(mass[which])
    books[_BOOK["behind"]] = behind
    found = books[_BOOK["mass_waiting"]] + books[_BOOK["mass_present"]]
    found += books[_BOOK["mass_left"]] - books[_BOOK["mass_returned"]] + books[_BOOK["mass_lost"]]
    whole = total(mass)
    books[_BOOK["mass_closure"]] = max(books[_BOOK["mass_closure"]], abs(found - whole) / whole)


def _count(state: State, model: Model, grains: NDArray[np.int64], what: str) -> None:
    _add(state, what, float(grains.size))
    _add(state, f"mass_{what}", total(model.grains.mass[grains]))


def _add(state: State, name: str, value: float) -> None:
    state.exchange[_BOOK[name]] += value


def _energies(state: State, model: Model, grains: NDArray[np.int64]) -> tuple[float, float]:
    """Kinetic energy, and −m g·r in the gravity of the domain, x unwrapped, 0 at the origin [J]."""
    (u, v), spin = state.velocity[grains, :SPIN].T, state.velocity[grains, SPIN]
    mass, (gx, gy) = model.grains.mass[grains], model.gravity.tolist()
    inertia = model.grains.inertia[grains]
    if state.radius.size:
        ratio, left = state.radius / model.grains.radius, 1.0 - model.worn_share(state.wear)
        mass, inertia = mass * left[grains], inertia * (left * ratio * ratio)[grains]
    x = state.position[grains, X] + model.period * state.image[grains]
    kinetic = total(0.5 * mass * (u * u + v * v) + 0.5 * inertia * (spin * spin))
    return kinetic, -total(mass * (gx * x + gy * state.position[grains, Y]))


# ---- Who comes and who goes before a step

NAMED = 5
"""Grains that a message names."""

ROUNDING = 1e-9
"""Part of a grain by which a release may be early: times are sums of steps."""

_GRAINS, _MASS = 0, 1  # columns of State.released and State.outlet_flow


def pass_grains(
    rules: InflowRules, model: Model, state: State, keep: Callable[[], None]
) -> NDArray[np.int64] | None:
    """Let grains go, then let grains come.

    ``keep`` is called before the first change of ``state``, that of all grains between two steps,
    which is **modified**. Returns those that came; None if none went or came.

    Raises:
        PhysicsError: If a grain is lost and that is to end the run; nothing has been changed then.
    """
    before = state.presence.copy()
    _lose(rules, model, state, keep)
    for number, outlet in enumerate(rules.outlets):
        _let_out(rules, number, outlet, model, state, keep)
    stayed = (before == Presence.THERE) & (state.presence == Presence.THERE)
    behind = 0
    for release in rules.releases:
        behind += _let_in(release, model, state, keep)
    note_presence(state, model, behind)
    # A grain may leave and come back at once: it is there all the time, but elsewhere.
    came = np.flatnonzero((state.presence == Presence.THERE) & ~stayed)
    if not came.size and np.array_equal(stayed, before == Presence.THERE):
        return None
    _forget_contacts(state, stayed)
    return came


def _lose(rules: InflowRules, model: Model, state: State, keep: Callable[[], None]) -> None:
    if rules.limits is None:
        return
    here = np.flatnonzero(state.presence == Presence.THERE)
    lost = here[~rules.limits.contains(state.position[here])]
    if lost.size and rules.stops:
        raise PhysicsError(state.step, _describe_lost(lost, state))
    if lost.size:
        keep()
        book_out(state, model, lost, "lost")
        state.presence[lost] = Presence.LOST


def _describe_lost(lost: NDArray[np.int64], state: State) -> str:
    places = [
        f"grain {k} at ({state.position[k, X]:.4g}, {state.position[k, Y]:.4g}) m"
        for k in lost[:NAMED].tolist()
    ]
    more = f" and {lost.size - NAMED} more" if lost.size > NAMED else ""
    verb = "is" if lost.size == 1 else "are"
    remedy = 'close the walls, add an outlet, or let them go with [domain] lost = "remove"'
    return f"{', '.join(places)}{more} {verb} beyond the domain; {remedy}"


def _let_out(
    rules: InflowRules, number: int, outlet: Outlet, model: Model, state: State,
    keep: Callable[[], None],
) -> None:  # fmt: skip
    here = np.flatnonzero(state.presence == Presence.THERE)
    leaving = here[outlet.region.contains(state.position[here])]
    if not leaving.size:
        return
    keep()
    book_out(state, model, leaving, "left")
    state.outlet_flow[number] += float(leaving.size), total(model.grains.mass[leaving])
    state.presence[leaving] = Presence.LEFT
    groups = [release.group for release in rules.releases]
    returning = (
        leaving[np.isin(model.grains.group[leaving], groups)] if outlet.returns else leaving[:0]
    )
    if returning.size:
        _count(state, model, returning, "returned")
        state.presence[returning] = Presence.WAITS


def _let_in(release: Release, model: Model, state: State, keep: Callable[[], None]) -> int:
    """Release the grains of a group that are due; returns how many found no room."""
    group = release.group
    allowed, column = release.allowed(state.time), _MASS if release.is_mass else _GRAINS
    queue = np.flatnonzero(
        (state.presence == Presence.WAITS) & (model.grains.group == group)
    ).tolist()
    for number, grain in enumerate(queue):
        unit = float(model.grains.mass[grain]) if release.is_mass else 1.0
        owed = allowed - float(state.released[group, column])
        if owed < -ROUNDING * unit:
            return 0
        place = find_room(
            release, round(float(state.released[group, _GRAINS])), grain, model, state
        )
        if place is None:
            return min(int((owed + ROUNDING * unit) / unit) + 1, len(queue) - number)
        keep()
        _put(grain, place, release, model, state)
    return 0


def _put(
    grain: int, place: tuple[float, float], release: Release, model: Model, state: State
) -> None:
    x, y = place
    first = int(np.searchsorted(model.grains.group, release.group))
    angle = release.angles[grain - first] if release.angles.size else 0.0
    state.position[grain] = x - model.period if 0.0 < model.period <= x else x, y, angle
    state.image[grain] = 0
    state.velocity[grain] = release.velocity
    if state.heat.size:
        state.heat[grain] = 0.0
    if state.radius.size:
        state.radius[grain] = model.grains.radius[grain]
    if model.sheds:  # else what has worn off is only counted
        state.wear[grain] = 0.0
    state.presence[grain] = Presence.THERE
    state.released[release.group] += (1.0, float(model.grains.mass[grain]))
    book_in(state, model, np.array([grain]))


_OF_PAIRS = {
    "contact": ("contact_impulse", "contact_couple", "contact_point"),
    "near": ("near_points", "near_late"),
    "mean": ("mean_force",),
    "bridge": (),
}
"""Pairs in a state, by the names of their shapes without ``_i`` and ``_j``; and their values."""


def _forget_contacts(state: State, stayed: NDArray[np.bool_]) -> None:
    for name, values in _OF_PAIRS.items():
        first, second = f"{name}_i", f"{name}_j"
        kept = _among(getattr(state, first), getattr(state, second), stayed)
        for field in (first, second, *values):
            if getattr(state, field).size:
                setattr(state, field, getattr(state, field)[kept])


def _among(
    first: NDArray[np.int32], second: NDArray[np.int32], chosen: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which pairs are of chosen grains, or of one of them and a wall shape."""
    last = chosen.size - 1
    return np.asarray(chosen[first] & ((second > last) | chosen[np.minimum(second, last)]))


# ---- The grains that are present, and their state, beside that of all grains


def _fields_of(*dims: str) -> tuple[str, ...]:
    return tuple(name for name, about in stored_fields(State).items() if about.dims[0] in dims)


_OF_GRAINS = _fields_of("grain", "heat_grain", "expansion_grain")
_SHAPES = tuple(f"{name}_{side}" for name in _OF_PAIRS for side in "ij")
_SHARED = tuple(
    name
    for name in stored_fields(State)
    if name not in (*_OF_GRAINS, *_SHAPES, *_fields_of("exchange_grain", "exchange_group"))
)
"""What the state of the grains that are present has in common with that of all grains."""


class Population:
    """Grains that come and go between steps, and the state of those that are present.

    Attributes:
        present_model: The model of the grains that are present.
        present: Their state; `gather` and `scatter` carry it from and to the state of all grains.
        newcomers: Which of them have come since the last step.
        number: Numbers of their shapes among all shapes, grains first.
    """

    def __init__(self, model: Model, state: State, rules: InflowRules) -> None:
        self._model, self._state, self._rules = model, state, rules
        self._came: NDArray[np.int64] = np.empty(0, np.int64)
        self._before: State | None = None
        self._books = state.exchange.copy()
        self._has_passed = False
        self._select()

    def pass_grains(self) -> bool:
        """Let grains go and come as `pass_grains`, once before each step; returns whether any."""
        if self._has_passed:
            return False
        self._books = self._state.exchange.copy()
        came = pass_grains(self._rules, self._model, self._state, self._keep)
        self._has_passed = True
        if came is not None:
            self._came = came
            self._select()
        return came is not None

    def gather(self) -> None:
        """Pass on what has changed in the state of all grains, but for the grains themselves."""
        _share(self._state, self.present)

    def scatter(self) -> None:
        """Enter what a step has made of the present grains into the state of all of them."""
        state, present = self._state, self.present
        _share(present, state)
        for name in _OF_GRAINS:
            values = getattr(state, name)
            if values.size:
                values[self.number[: present.position.shape[0]]] = getattr(present, name)
        for name in _SHAPES:
            setattr(state, name, self.number[getattr(present, name)])
        self._settle()

    def go_back(self) -> bool:
        """Undo `pass_grains` of a step that was interrupted; returns whether it had any effect."""
        before = self._before
        if before is not None:
            vars(self._state).update(vars(before))
        elif self._has_passed:
            self._state.exchange[:] = self._books
        self._settle()
        if before is not None:
            self._select()
        return before is not None

    def _settle(self) -> None:
        self._came, self._before, self._has_passed = self._came[:0], None, False

    def _keep(self) -> None:
        if self._before is None:
            self._before = State.from_dict(
                {name: value.copy() for name, value in self._state.as_dict().items()}
            )

    def _select(self) -> None:
        model, state = self._model, self._state
        here = np.flatnonzero(state.presence == Presence.THERE)
        shapes = np.arange(model.grain_count, model.grain_count + model.shape_count)
        self.number: NDArray[np.int32] = np.concatenate([here, shapes]).astype(np.int32)
        self.newcomers = np.searchsorted(here, self._came)
        self.present_model, self.present = model.with_grains(here), State()
        self.gather()
        for name in _OF_GRAINS:
            values = getattr(state, name)
            setattr(self.present, name, values[here] if values.size else values)
        place = np.full(model.grain_count + model.shape_count, -1, np.int32)
        place[self.number] = np.arange(self.number.size, dtype=np.int32)
        for name in _SHAPES:
            setattr(self.present, name, place[getattr(state, name)])


def _share(source: State, target: State) -> None:
    for name in _SHARED:
        setattr(target, name, getattr(source, name))
