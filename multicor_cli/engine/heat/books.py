"""Heat books: stored = friction + impact − to walls + ahead + from walls, fluid and surroundings.

Where grains come and go, what they take along is added to what is stored; in a cell with a mean
gradient of temperature, what motion along it gives comes in, too.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.heat.rates import OUTSIDE_BOOKS, Flow
from multicor_cli.engine.jit.arrays import column_totals, total_and_magnitude
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.books import EXCHANGE_NAMES, HEAT_BOOK_NAMES, WINDOW_NAMES
from multicor_cli.model.columns import GIVEN, RECEIVED
from multicor_cli.model.model import Floats
from multicor_cli.model.state import LARGEST, State

_BOOK = {name: k for k, name in enumerate(HEAT_BOOK_NAMES)}
_STEPS = WINDOW_NAMES.index("steps")
_HEAT_OUT = EXCHANGE_NAMES.index("heat_out")


def receive(state: State, source: Floats) -> Floats:
    """What grains receive of the heat that their contacts generated in a step [J], shape ``(n,)``.

    Losses of a step are exact together, not one by one: some are negative. No grain is cooled by
    them. It has always received the most that its contacts had lost at any time (theory §11.3).
    """
    received = np.empty(source.size)
    state.heat_books[_BOOK["ahead"]] += advance(source, state.heat_ahead, state.generated, received)
    return received


def receive_walls(state: State, to_walls: Floats, bodies: NDArray[np.int64]) -> None:
    """Likewise of what goes into the walls with a heat capacity [J], numbers ``bodies``.

    **Modifies** ``to_walls``, shape ``(w,)``, which becomes what they receive.
    """
    received = np.empty(bodies.size)
    ahead = state.wall_ahead[bodies] if state.wall_ahead.size else np.zeros(bodies.size)
    more = advance(to_walls[bodies], ahead, np.zeros(bodies.size), received)
    state.heat_books[_BOOK["ahead"]] += more
    to_walls[bodies] = received
    if ahead.any() and state.wall_ahead.size == 0:
        state.wall_ahead = np.zeros(to_walls.size)
    if state.wall_ahead.size:
        state.wall_ahead[bodies] = ahead


@kernel
def advance(source: Floats, ahead: Floats, generated: Floats, received: Floats) -> float:
    """The bodies of `receive`; returns how much more they have received than was generated [J].

    **Modifies** ``ahead`` and ``generated`` of the state, and ``received``.
    """
    more = np.empty((source.size, 1))
    for k in range(source.size):
        due = source[k] - ahead[k]
        received[k] = 0.0 if due <= 0.0 else due
        ahead[k] = received[k] - due
        generated[k] += received[k]
        more[k, 0] = received[k] - source[k]
    total: float = column_totals(more)[0]
    return total


@kernel
def warm(initial: Floats, heat: Floats, capacity: Floats, temperature: Floats) -> bool:
    """Temperatures of grains from their heat, into the first of ``temperature`` [K], **modified**.

    As `State.temperature`. Returns whether no heat is absurd.
    """
    is_sound = True
    for k in range(heat.size):
        temperature[k] = initial[k] + heat[k] / capacity[k]
        is_sound &= abs(heat[k]) <= LARGEST
    return is_sound


@kernel
def take_up(received: Floats, heat: Floats) -> tuple[float, float]:
    """Add what grains have received to their heat [J], **modified**; as `total_and_magnitude`."""
    for k in range(heat.size):
        heat[k] += received[k]
    return total_and_magnitude(heat)


def book_generated(state: State, friction: float, impact: float, to_walls: Floats) -> None:
    """Enter the heat generated in a step [J]; ``to_walls``, ``(w,)``, is what went into walls."""
    received, _ = total_and_magnitude(to_walls)
    _enter(state, {"friction": friction, "impact": impact, "to_walls": received})
    state.wall_heat[:, RECEIVED] += to_walls


def book_flow(state: State, flow: Flow, undelivered: float) -> None:
    """Enter the heat that has flowed, and ``undelivered`` [J] as `book_undelivered`."""
    outside = dict(zip(OUTSIDE_BOOKS, flow.outside.tolist(), strict=True))
    given, exchanged = total_and_magnitude(flow.walls)
    _enter(state, {"from_walls": given, **outside}, exchanged)
    state.wall_heat[:, GIVEN] += flow.walls
    book_undelivered(state, undelivered)
    state.heat_books[_BOOK["sub_steps"]] += flow.sub_steps
    state.heat_books[_BOOK["integration_error"]] = max(
        state.heat_books[_BOOK["integration_error"]], flow.error
    )


def _enter(state: State, entries: dict[str, float], walls: float | None = None) -> None:
    books = state.heat_books
    for name, value in entries.items():
        books[_BOOK[name]] += value
    exchanged = {name: abs(value) for name, value in entries.items()}
    if walls is not None:
        exchanged["from_walls"] = walls
    books[_BOOK["exchanged"]] += math.fsum(exchanged.values())


def book_undelivered(state: State, heat: float) -> None:
    """Enter what walls of prescribed flow that touch no grain could not give [J]."""
    state.heat_books[_BOOK["undelivered"]] += heat


def book_along(state: State, gained: float, passed: Floats) -> None:
    """Enter what motion along a mean gradient has given to the grains [J], and what has passed.

    The latter is per length of the plane [J/m], in the order of `GRADIENT_BOOKS`, any shape.
    """
    state.gradient_books[0] += gained
    state.gradient_books[1:] += passed.ravel()


def book_heat_out(state: State, contents: Floats) -> None:
    """Enter the heat contents that grains take along [J], one for each of them."""
    taken, exchanged = total_and_magnitude(contents)
    state.exchange[_HEAT_OUT] += taken
    state.heat_books[_BOOK["stored"]] -= taken
    state.heat_books[_BOOK["exchanged"]] += exchanged


def note_contacts(state: State, biot: float, gas_ratio: tuple[float, float]) -> None:
    """Keep the largest Biot number of a contact, and the last step's range of λ_s s/(λ_f a)."""
    books = state.heat_books
    books[_BOOK["max_biot"]] = max(books[_BOOK["max_biot"]], biot)
    books[_BOOK["solid_gas_min"]], books[_BOOK["solid_gas_max"]] = gas_ratio


def hottest_so_far(state: State) -> float:
    """Temperature of the hottest spot of the window before this step [K]; 0 in its first one."""
    is_first = state.window[_STEPS] <= 1.0
    return 0.0 if is_first else float(state.heat_books[_BOOK["hottest_spot"]])


def note_hottest(state: State, temperature: float) -> None:
    """Keep the temperature of the hottest spot in the window [K]."""
    state.heat_books[_BOOK["hottest_spot"]] = temperature


def strike_balance(state: State, received: Floats) -> None:
    """Let grains receive heat [J], and compare their content with what has come in.

    ``received`` are the grains, and what follows them does not count.
    """
    books = state.heat_books
    stored, content = take_up(received, state.heat)
    if state.heat_before.size:
        stored -= float(state.heat_before[0])
    books[_BOOK["stored"]] = stored
    come_in = books[_BOOK["friction"]] + books[_BOOK["impact"]] - books[_BOOK["to_walls"]]
    come_in += books[_BOOK["ahead"]]
    from_outside = books[_BOOK["from_walls"]]
    for name in OUTSIDE_BOOKS:
        from_outside += books[_BOOK[name]]
    come_in += from_outside
    if state.gradient_books.size:
        come_in += float(state.gradient_books[0])
    taken = float(state.exchange[_HEAT_OUT]) if state.exchange.size else 0.0
    books[_BOOK["imbalance"]] = stored + taken - come_in
    # Σ C_i |T_i − T_i0| = Σ |Q_i|.
    scale = books[_BOOK["exchanged"]] + content
    if scale > 0.0:
        books[_BOOK["closure"]] = max(
            books[_BOOK["closure"]], abs(books[_BOOK["imbalance"]]) / scale
        )
