"""Plane shear: time per unit strain of each code, in rounds that alternate between them, and how
well each does it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

from case import FlowPlan, Frames, Layer, soft_contact
from measure import Accuracy, measure_flow
from ours import OurRun, Start, automatic_step, flow, loosened
from peers import SoftPeer
from scene import shear_scene
from table import draw, estimate, median, spread

RESTITUTION = 0.1
"""Restitution of the soft contacts: they need some damping short of critical; ours is 0."""

_STIFF = 3e5  # from this κ on a run is as short as --soft-strain says


@dataclass(frozen=True)
class Wanted:
    """What the comparison is about.

    Attributes:
        grains: Number of flowing grains.
        inertial: Nominal inertial number.
        kappas: Stiffnesses k_n/P.
        rounds: Number of rounds.
        plan: Strains of the codes.
        stiff_plan: Strains of the soft codes where the contacts are stiff and a strain costs much.
        dt_tau: Our time step over τ; None: the automatic one.
        tolerance: Our tolerance of the rms velocity correction; None: the default.
        cores: Threads and ranks.
        reference: Strain of our own run with a fine step and the default tolerances; 0: none.
        begin: Strain from the lattice to the first start.
        friction: μ.
        sizes: Sizes of the grains, a key of `scene.SIZES`.
    """

    grains: int
    inertial: float
    kappas: tuple[float, ...]
    rounds: int
    plan: FlowPlan
    stiff_plan: FlowPlan
    dt_tau: float | None
    tolerance: float | None
    cores: int
    reference: float
    begin: float
    friction: float
    sizes: str


class FlowRun(Protocol):
    """What every code gives back."""

    @property
    def seconds(self) -> float:
        """Time of the measured steps [s]."""

    @property
    def steps(self) -> int:
        """Number of measured steps."""

    @property
    def dt(self) -> float:
        """Time step [s]."""

    @property
    def frames(self) -> Frames:
        """What was seen."""


@dataclass
class Column:
    """One code with one setting, round after round.

    Attributes:
        name: What the table calls it.
        plan: Its strains.
        runs: Its runs, one per round.
    """

    name: str
    plan: FlowPlan
    runs: list[FlowRun] = field(default_factory=list)

    @property
    def per_strain(self) -> list[float]:
        """Time per unit strain of each round [s]."""
        return [run.seconds / (self.plan.frames * self.plan.between) for run in self.runs]


@dataclass(frozen=True)
class ShearResult:
    """What was found.

    Attributes:
        layer: The layer at the start of the first round.
        columns: Codes; ours is the first.
        accuracy: How each flowed.
        reference: Our own run with a fine step, if there was one.
        notes: What was tuned, what was left out.
    """

    layer: Layer
    columns: list[Column]
    accuracy: list[Accuracy]
    reference: Column | None
    notes: list[str]


def compare_shear(
    wanted: Wanted, peers: Sequence[SoftPeer], folder: Path, say: Callable[[str], None]
) -> ShearResult:
    """Run the comparison.

    Args:
        wanted: What it is about.
        peers: The other codes.
        folder: Where they work.
        say: Is told what is being done.
    """
    say("our run to steady flow")
    scene = shear_scene(wanted.inertial, wanted.begin, wanted.friction, wanted.sizes)
    start = Start(scene, wanted.grains, threads=wanted.cores)
    layer = start.layer()
    dt_tau = automatic_step(layer) if wanted.dt_tau is None else wanted.dt_tau
    settings = loosened(wanted.tolerance)
    # Compiles what is left
    flow(start, layer, settings, dt_tau, FlowPlan(0.0, wanted.plan.between, wanted.plan.between))
    ours = Column(f"multicor Δt = {dt_tau:.2g} τ, rms {settings.tolerance_rms:g}", wanted.plan)
    theirs, notes = _tuned(wanted, peers, layer, folder, say)
    for round_ in range(wanted.rounds):
        if round_:
            start.advance(layer.duration(0.5))
        now = start.layer()
        for column, run in [(ours, None), *theirs]:
            say(f"round {round_ + 1}: {column.name}")
            column.runs.append(
                flow(start, now, settings, dt_tau, wanted.plan) if run is None else run(now)
            )
    columns = [ours, *(column for column, _ in theirs)]
    reference = None
    if wanted.reference > 0.0:
        say("our reference: Δt = 0.05 τ, default tolerances")
        reference = Column(
            "multicor Δt = 0.05 τ, rms 0.001",
            FlowPlan(wanted.plan.settle, wanted.reference, wanted.plan.between),
        )
        reference.runs.append(flow(start, layer, loosened(1e-3), 0.05, reference.plan))
    return ShearResult(
        layer, columns, [_accuracy(layer, column) for column in columns], reference, notes
    )


def _tuned(
    wanted: Wanted,
    peers: Sequence[SoftPeer],
    layer: Layer,
    folder: Path,
    say: Callable[[str], None],
) -> tuple[list[tuple[Column, Callable[[Layer], FlowRun]]], list[str]]:
    """One column for each code and stiffness, with what runs it; and how each was tuned."""
    columns: list[tuple[Column, Callable[[Layer], FlowRun]]] = []
    notes = []
    for kappa in wanted.kappas:
        contact = soft_contact(kappa * layer.pressure, layer.friction, layer.mass, RESTITUTION)
        plan = wanted.stiff_plan if kappa > _STIFF else wanted.plan
        for peer in peers:
            say(f"tuning {peer.name} at κ = {kappa:g}")
            place = folder / f"{peer.name}-{kappa:g}"
            place.mkdir(parents=True, exist_ok=True)
            run, note = peer.prepare_shear(layer, contact, plan, place)
            columns.append((Column(f"{peer.name} κ = {kappa:.0e}".replace("e+0", "e"), plan), run))
            notes.append(f"{columns[-1][0].name}: {note}")
    return columns, notes


def _accuracy(layer: Layer, column: Column) -> Accuracy:
    return measure_flow(layer, [run.frames for run in column.runs])


def as_text(result: ShearResult) -> str:
    """The result as a table with notes."""
    layer, ours = result.layer, result.columns[0]
    rows = [
        _row(layer, ours, column, accuracy)
        for column, accuracy in zip(result.columns, result.accuracy, strict=True)
    ]
    if result.reference is not None:
        rows.append(
            _row(layer, ours, result.reference, _accuracy(layer, result.reference), is_timed=False)
        )
    headings = (
        "code", "s per strain", "ratio", "strain", "steps", "Δt/τ", "μ*", "ν", "I in the bulk",
        "max overlap", "mean overlap",
    )  # fmt: skip
    head = (
        f"{len(layer.radius)} grains, {layer.height / (2.0 * float(layer.radius.mean())):.1f} "
        f"diameters high, I = {layer.inertial:.4f} (walls), τ = {1e3 * layer.tau:.3f} ms"
    )
    return "\n".join([head, "", draw(headings, rows), "", *_our_notes(ours), *result.notes])


def _row(
    layer: Layer, ours: Column, column: Column, accuracy: Accuracy, *, is_timed: bool = True
) -> list[str]:
    ratios = (
        [b / a for a, b in zip(ours.per_strain, column.per_strain, strict=True)] if is_timed else []
    )
    return [
        column.name, spread(column.per_strain), spread(ratios) if ratios else "",
        f"{len(column.runs)} × {column.plan.frames * column.plan.between:g}",
        f"{column.runs[0].steps}", f"{column.runs[0].dt / layer.tau:.2g}",
        estimate(accuracy.friction, 4),
        estimate(accuracy.solid, 4), estimate(accuracy.inertial, 4), f"{accuracy.max_overlap:.1e}",
        f"{accuracy.mean_overlap:.1e}",
    ]  # fmt: skip


def _our_notes(ours: Column) -> list[str]:
    runs = [run for run in ours.runs if isinstance(run, OurRun)]
    sweeps, residual = (
        median([getattr(run, key) for run in runs]) for key in ("sweeps", "residual")
    )
    overlap, missed = max(run.overlap for run in runs), sum(run.unconverged for run in runs)
    solved = f"multicor: {sweeps:.0f} sweeps a step, rms residual {residual:.1e}"
    return [f"{solved}, largest overlap after any step {overlap:.1e}, {missed} steps unconverged"]


def as_json(result: ShearResult) -> dict[str, Any]:
    """The result as JSON types."""
    return {
        "grains": len(result.layer.radius),
        "inertial": result.layer.inertial,
        "tau": result.layer.tau,
        "codes": [
            _json_column(column, accuracy) for column,
            accuracy in zip(result.columns, result.accuracy, strict=True)
        ],
        "reference": None
        if result.reference is None
        else _json_column(result.reference, _accuracy(result.layer, result.reference)),
        "notes": [*_our_notes(result.columns[0]), *result.notes],
    }  # fmt: skip


def _json_column(column: Column, accuracy: Accuracy) -> dict[str, Any]:
    numbers = {key: _finite(value) for key, value in asdict(accuracy).items()}
    steps, dt = column.runs[0].steps, column.runs[0].dt
    return {
        "name": column.name,
        "seconds_per_strain": column.per_strain,
        "steps": steps,
        "dt": dt,
        **numbers,
    }


def _finite(value: Any) -> Any:
    """Numbers that are not finite become None: JSON has none of them."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    return value if math.isfinite(value) else None
