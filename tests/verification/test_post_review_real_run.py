"""What post-processing says of a small sheared layer that was computed, and its walls feel."""

from __future__ import annotations

import numpy as np
import pytest
from from_wall_to_wall import profile
from scenes import write_small

import multicor_cli as multicor
from multicor_cli.post import Selection, energy, rheology
from multicor_cli.store import Run, open_run

OVERRIDES = (
    "domain.size=[0.02, 0.03]",
    "domain.gravity=[0.0, 0.0]",
    "particles.0.count=150",
    "particles.0.sizes={kind = 'list', radii = [0.3e-3, 0.6e-3], fractions = [0.5, 0.5]}",
    "particles.0.region={min = [0.0, 0.001], max = [0.02, 0.0145]}",
    "particles.0.velocity=[0.4, 0.0]",
    "particles.0.shear_rate=50.0",
    "walls.1.geometry.from=[0.0, 0.0155]",
    "walls.1.geometry.to=[0.02, 0.0155]",
    "loading.0.duration=0.02",
    "loading.0.drives.top.x.velocity=0.8",
    "loading.0.drives.top.y.force=-0.4",
    "loading.1.until.strain.value=3.0",
    "loading.1.drives.top.x.velocity=0.8",
    "solver.dt=5e-5",
    "output.frame_interval=5e-4",
    "output.series_interval=5e-5",
)
"""150 grains of two sizes, no gravity, under 20 N/m; a row of the time series for every step."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = tmp_path_factory.mktemp("sheared")
    write_small(path)
    multicor.run(path / "small.toml", path / "run", overrides=OVERRIDES, threads=1)
    return open_run(path / "run")


def wall_forces(run: Run, frames: np.ndarray) -> np.ndarray:
    """Forces of the last step before each frame on both walls, shape ``(frames, 2, 2)``."""
    steps = np.asarray(run.series["step"])
    rows = [int(np.flatnonzero(steps == run.frames[int(k)].step)[0]) for k in frames]
    return np.asarray(run.series["wall_force"])[rows, :, :2]


def test_stress_next_to_the_walls_is_their_force_per_length(run: Run) -> None:
    """A thin bin at the line of glued grains is crossed by the contacts with the wall alone.

    So it carries, frame by frame, exactly what the wall feels; what is left are positions half a
    step later than contacts.
    """
    chosen = Selection(frames=slice(-30, None))
    tables = {of: profile(run, of, chosen, 400) for of in ("stress-xy", "stress-yy")}
    force = wall_forces(run, tables["stress-yy"].frames).mean(axis=0) / run.period
    for of, axis in (("stress-xy", 0), ("stress-yy", 1)):
        value = tables[of].value
        assert value[[1, 2]] == pytest.approx(-force[0, axis], rel=2e-2)
        assert value[[-3, -2]] == pytest.approx(force[1, axis], rel=2e-2)


def test_stress_does_not_fade_towards_rough_walls(run: Run) -> None:
    """Without gravity σ_yy is the load per length at all heights, in the bins at the walls too;
    those hold half as many grains.
    """
    chosen = Selection(start=0.4 * float(run.frames.time[-1]))
    kinetic = profile(run, "kinetic-stress-yy", chosen, 12).value
    stress = profile(run, "stress-yy", chosen, 12)
    total = stress.value + kinetic
    assert total == pytest.approx(np.full(12, total.mean()), rel=0.15)
    load = 0.4 / run.period
    assert total.mean() == pytest.approx(load, rel=0.15)
    fraction = profile(run, "solid-fraction", chosen, 12).value
    assert fraction[[0, -1]].max() < 0.8 * fraction[3:9].mean()


def test_area_and_virial_are_kept_while_the_lid_moves(run: Run) -> None:
    """The whole run: the load closes gaps of the packing by several grains."""
    everything = Selection(frames=slice(None))
    heights = [frame.wall_position[1, 1] for frame in run.frames]
    assert np.ptp(heights) > run.model.mean_diameter
    fraction = profile(run, "solid-fraction", everything, 23)
    area = float((np.pi * run.model.grains.radius**2).sum())
    assert fraction.value.sum() * fraction.width * run.period == pytest.approx(area, rel=1e-9)
    coarse, fine = (profile(run, "stress-yy", everything, count) for count in (1, 50))
    assert coarse.value[0] * coarse.bin_area == pytest.approx(
        fine.value.sum() * fine.bin_area, rel=1e-9
    )


def test_stress_of_frames_is_the_recorded_virial(run: Run) -> None:
    """Σ f ℓ of contacts between grains in the same steps; those with walls come on top of it."""
    from multicor_cli.post.contacts import loaded_contacts

    steps = np.asarray(run.series["step"])
    for frame in run.frames[-10:]:
        contacts = loaded_contacts(frame, run.model)
        found = np.array(
            [[contacts.virial(a, b)[~contacts.is_wall].sum() for b in (0, 1)] for a in (0, 1)]
        )
        row = int(np.flatnonzero(steps == frame.step)[0])
        assert found == pytest.approx(run.series["virial_rate"][row], rel=1e-9, abs=1e-12)


def test_rheology_closes_the_energy_balance(run: Run) -> None:
    """The shear force at the walls times their velocity is the work that the books say."""
    table = rheology(run, Selection(start=0.4 * float(run.frames.time[-1])))
    ends = [run.frames[int(table.frames[k])].time for k in (0, -1)]
    books = energy(run, *ends)
    work = books.books["wall_work"][-1] - books.books["wall_work"][0]
    assert books.time[[0, -1]].tolist() == ends
    force = table.mean["friction_walls"] * table.mean["pressure"] * run.period
    # the mean of both walls' forces; they differ by what the grains gain in momentum
    assert force * 0.8 * (ends[1] - ends[0]) == pytest.approx(work, rel=0.05)
