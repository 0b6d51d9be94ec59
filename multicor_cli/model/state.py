"""The time-varying part of a run. It is exactly what a checkpoint holds: whatever changes the future is in here."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Ints, Model, Thermal

BOOK_NAMES = (
    "kinetic",  # kinetic energy now (free degrees of freedom) [J]
    "kinetic_start",  # kinetic energy at the start of the run [J]
    "gravity_work",  # ΣF·Δq of gravity on unwrapped displacements, position correction included [J]
    "wall_work",  # work done on the grains by prescribed velocities [J]
    "load_work",  # ΣF·Δq of the loads on driven walls, position correction included [J]
    "friction_loss",  # −Σ p_t ½(u_t⁻+u_t⁺), signed [J]
    "impact_loss",  # −Σ p_n ½(u_n⁻+u_n⁺), signed [J]
    "damping_loss",  # Σ c v̄² Δt of damped loads [J]
    "correction_work",  # ΣF·δq of the position projection (gravity and loads) [J]
    "friction_sliding",  # Σ μ|u_t⁺| p_n, the end-of-step rule of the paper [J]
    "negative_loss",  # the negative share of friction_loss + impact_loss (contacts that gained energy) [J]
    "terms",  # cumulative Σ|terms| of the balance [J]
    "imbalance",  # kinetic − kinetic_start − (works − losses − correction) now [J]
    "closure",  # largest |imbalance| / terms over the run
)
"""Names of the energy books, in the order of `State.books`."""


TALLY_NAMES = (
    "sweeps",  # sweep-equivalents of the contact solver, summed over steps
    "unconverged_steps",  # steps that hit the cap on sweeps
    "residual_rms_max",  # largest rms velocity correction of a step over u_ref
    "residual_max_max",  # largest velocity correction of a step over u_ref
    "max_overlap",  # largest overlap over the smaller radius at the end of a step
    "corrected_steps",  # steps after which positions were projected
    "max_impulse_rate",  # largest normal impulse over dt: the largest mean contact force of a step [N]
)
"""Names of the counters of a run, in the order of `State.tallies`."""

WINDOW_NAMES = (
    "duration",  # length of the window [s]
    "steps",  # steps in the window
    "sweeps",  # sweep-equivalents
    "unconverged",  # steps that hit the cap on sweeps
    "residual_rms",  # largest rms velocity correction over u_ref
    "residual_max",  # largest velocity correction over u_ref
    "residual_energy",  # largest energy residual G
    "contacts",  # number of loaded contacts, summed over steps
    "virial_xx",  # Σ p_x ℓ_x over grain–grain contacts (ℓ from j to i) [J s]
    "virial_xy",  # Σ p_x ℓ_y [J s]
    "virial_yx",  # Σ p_y ℓ_x [J s]
    "virial_yy",  # Σ p_y ℓ_y [J s]
)
"""Names of the sums kept between two rows of the time series, in the order of `State.window`."""

HEAT_BOOK_NAMES = (
    "stored",  # ΣQ_i, the heat content of the grains since the start [J]
    "friction",  # heat of friction at the contacts, by the rule in use [J]
    "impact",  # heat of impacts at the contacts [J]
    "to_walls",  # share of friction and impact that went into the walls [J]
    "from_walls",  # from the walls into the grains: conduction, gas, radiation; signed [J]
    "from_ambient",  # by convection from the ambient fluid; signed [J]
    "from_surroundings",  # by radiation from the surroundings; signed [J]
    "exchanged",  # Σ|terms| of the exchange with the outside, step by step [J]
    "undelivered",  # heat that walls of prescribed flow could not pass on because nothing touched them [J]
    "imbalance",  # stored − (friction + impact − to_walls + from_walls + from_ambient + from_surroundings) now [J]
    "closure",  # largest |imbalance| / (exchanged + Σ C_i|T_i − T_i0|) over the run
    "sub_steps",  # sub-steps of the heat integrator so far
    "max_biot",  # largest Biot number of a contact so far
    "solid_gas_min",  # smallest λ_s s/(λ_f a) of a contact in the last step; 0 without gas
    "solid_gas_max",  # largest λ_s s/(λ_f a) of a contact in the last step; 0 without gas
)
"""Names of the heat books, in the order of `State.heat_books`."""


def _empty(*shape: int) -> Floats:
    return np.zeros(shape)


@dataclass
class State:
    """State of a run between two steps. ``n`` grains, ``w`` walls, ``c`` contacts of the last step.

    Attributes:
        position: Grains: x, y [m] (x wrapped into the period) and angle [rad], shape ``(n, 3)``.
        image: Grains: how many periods x has been wrapped, shape ``(n,)``.
        velocity: Grains: velocity [m/s] and spin ω [rad/s], shape ``(n, 3)``.
        wall_position: Walls: reference point x, y [m] and angle [rad] of the frame, shape ``(w, 3)``.
        wall_velocity: Walls: velocity [m/s] and spin [rad/s] at the end of the last step, shape ``(w, 3)``.
        contact_i: First shape (a grain) of each contact that carried an impulse, ascending, shape ``(c,)``.
        contact_j: Second shape, ascending within equal ``contact_i``, shape ``(c,)``.
        contact_impulse: Normal and tangential impulse p_n, p_t [N s] of the last step (warm start), shape ``(c, 2)``.
        books: Energy books in the order of `BOOK_NAMES`, shape ``(len(BOOK_NAMES),)``.
        tallies: Counters of the run: see `TALLY_NAMES`, shape ``(len(TALLY_NAMES),)``.
        window: Sums since the last row of the time series: see `WINDOW_NAMES`, shape ``(len(WINDOW_NAMES),)``.
        window_wall_impulse: Walls: impulse and angular impulse exerted by the grains since the last row [N s, N m s],
            shape ``(w, 3)``.
        step: Number of steps done since the start of the run.
        frozen_steps: How many of them were steps of frozen stages, in which nothing moved.
        stage: Index of the current loading stage.
        stage_step: Steps done in this stage.
        stage_start: Time at which this stage began [s].
        stage_peak: Largest kinetic energy in this stage [J].
        stage_strain: Shear strain accumulated in this stage.
        time: Time since the start of the run [s].
        last_dt: Time step of the last step [s]; scales the warm start.
        heat: Grains: heat content since the start Q [J], shape ``(n,)``; this and what follows is empty without heat.
        generated: Grains: heat of friction and impacts received since the start [J], shape ``(n,)``.
        wear: Grains: volume worn off since the start [m³], shape ``(n,)``.
        wall_heat: Walls: heat given to the grains, and heat of friction and impacts received, since the start [J], shape
            ``(w, 2)``.
        wall_wear: Walls: volume worn off since the start [m³], shape ``(w,)``.
        wall_temperature: Walls: temperature at the end of the last step [K]; nan where none is prescribed, shape ``(w,)``.
        heat_books: Heat books in the order of `HEAT_BOOK_NAMES`.
        mean_i: First shape of each contact with a running average of the force, ascending, shape ``(a,)``.
        mean_j: Second shape, ascending within equal ``mean_i``, shape ``(a,)``.
        mean_force: Running average of the normal force, from zero at its start [N], shape ``(a,)``.
        mean_age: Time since the start of the averages [s].
        heat_dt: Sub-step that the heat integrator tries first [s]; 0: the whole step.
    """

    position: Floats
    image: NDArray[np.int64]
    velocity: Floats
    wall_position: Floats
    wall_velocity: Floats
    contact_i: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    contact_j: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    contact_impulse: Floats = field(default_factory=lambda: _empty(0, 2))
    books: Floats = field(default_factory=lambda: _empty(len(BOOK_NAMES)))
    tallies: Floats = field(default_factory=lambda: _empty(len(TALLY_NAMES)))
    window: Floats = field(default_factory=lambda: _empty(len(WINDOW_NAMES)))
    window_wall_impulse: Floats = field(default_factory=lambda: _empty(0, 3))
    step: int = 0
    frozen_steps: int = 0
    stage: int = 0
    stage_step: int = 0
    stage_start: float = 0.0
    stage_peak: float = 0.0
    stage_strain: float = 0.0
    time: float = 0.0
    last_dt: float = 0.0
    heat: Floats = field(default_factory=lambda: _empty(0))
    generated: Floats = field(default_factory=lambda: _empty(0))
    wear: Floats = field(default_factory=lambda: _empty(0))
    wall_heat: Floats = field(default_factory=lambda: _empty(0, 2))
    wall_wear: Floats = field(default_factory=lambda: _empty(0))
    wall_temperature: Floats = field(default_factory=lambda: _empty(0))
    heat_books: Floats = field(default_factory=lambda: _empty(0))
    mean_i: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    mean_j: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    mean_force: Floats = field(default_factory=lambda: _empty(0))
    mean_age: float = 0.0
    heat_dt: float = 0.0

    @classmethod
    def at_rest(cls, model: Model, position: Floats) -> State:
        """A state in which everything is at rest; ``position`` has shape ``(n, 2)`` or ``(n, 3)``."""
        n, w = model.grain_count, model.wall_count
        full = _empty(n, 3)
        full[:, : position.shape[1]] = position
        state = cls(full, np.zeros(n, np.int64), _empty(n, 3), _empty(w, 3), _empty(w, 3))
        state.window_wall_impulse = _empty(w, 3)
        if model.thermal is not None:
            state.heat, state.generated, state.wear = _empty(n), _empty(n), _empty(n)
            state.wall_heat, state.wall_wear = _empty(w, 2), _empty(w)
            state.wall_temperature = np.full(w, np.nan)
            state.heat_books = _empty(len(HEAT_BOOK_NAMES))
        return state

    def temperature(self, thermal: Thermal) -> Floats:
        """Temperatures of the grains T = T₀ + Q/C [K], shape ``(n,)``."""
        return thermal.start + self.heat / thermal.capacity

    def as_dict(self) -> dict[str, NDArray[np.generic]]:
        """All fields as arrays (numbers become 0-d arrays), in declaration order: what a checkpoint stores."""
        return {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def from_dict(cls, data: dict[str, NDArray[np.generic]]) -> State:
        """The inverse of `as_dict`; raises `KeyError` if a field is missing."""
        values = {}
        for f in fields(cls):
            value = np.asarray(data[f.name])
            if value.ndim:
                values[f.name] = np.ascontiguousarray(value)
            else:
                values[f.name] = value.item()
        return cls(**values)  # type: ignore[arg-type]

    def digest(self) -> str:
        """BLAKE2 digest over the raw bytes of every field, in declaration order (little-endian)."""
        sum_ = hashlib.blake2b(digest_size=16)
        for name, value in self.as_dict().items():
            sum_.update(name.encode())
            sum_.update(str(value.shape).encode())
            sum_.update(np.ascontiguousarray(value).tobytes())
        return sum_.hexdigest()
