"""What post-processing says of small sheared layers that were computed, and their walls feel."""

from dataclasses import replace

import numpy as np
import pytest
from from_wall_to_wall import profile, profiles
from made_up_frames import source_of
from scenes import write_small

import multicor_cli as multicor
from multicor_cli.post import PROFILE_GROUPS, Selection, energy, rheology
from multicor_cli.post.contacts import loaded_contacts
from multicor_cli.store import open_run

OVERRIDES = (
    "domain.size=[0.02, 0.03]", "domain.gravity=[0.0, 0.0]", "particles.0.count=200",
    "particles.0.region={min = [0.0, 0.001], max = [0.02, 0.0195]}",
    "particles.0.velocity=[0.5, 0.0]", "particles.0.shear_rate=50.0",
    "walls.1.geometry.from=[0.0, 0.0205]", "walls.1.geometry.to=[0.02, 0.0205]",
    "loading.0.duration=0.02", "loading.0.drives.top.x.velocity=1.0",
    "loading.0.drives.top.y.force=-0.4", "loading.1.until.strain.value=5.0",
    "loading.1.drives.top.x.velocity=1.0", "solver.dt=5e-5", "output.frame_interval=5e-4",
    "output.series_interval=5e-5",
)  # fmt: skip


@pytest.fixture(scope="module")
def flows(tmp_path_factory):
    """Twice two hundred grains sheared without gravity between rough walls (I = 0.03); a row
    of the time series for every step."""
    path = tmp_path_factory.mktemp("sheared")
    write_small(path)
    for seed in range(1, 3):
        overrides = (*OVERRIDES, f"scenario.seed={seed}")
        multicor.run(path / "small.toml", path / f"{seed}", overrides=overrides, threads=1)
    return [open_run(path / f"{seed}") for seed in range(1, 3)]


@pytest.fixture
def run(flows):
    """The first of them."""
    return flows[0]


def wall_forces(run, frames):
    """Forces of the last step before each frame on both walls, shape ``(frames, 2, 2)``."""
    steps = np.asarray(run.series["step"])
    rows = [int(np.flatnonzero(steps == run.frames[int(k)].step)[0]) for k in frames]
    return np.asarray(run.series["wall_force"])[rows, :, :2]


def test_stress_next_to_the_walls_is_their_force_per_length(run):
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


def test_stress_does_not_fade_towards_rough_walls(run):
    """Without gravity σ_yy is the load per length at all heights, in the bins at the walls too;
    those hold half as many grains."""
    chosen = Selection(start=0.4 * float(run.frames.time[-1]))
    kinetic = profile(run, "kinetic-stress-yy", chosen, 12).value
    stress = profile(run, "stress-yy", chosen, 12)
    total = stress.value + kinetic
    assert total == pytest.approx(np.full(12, total.mean()), rel=0.15)
    load = 0.4 / run.period
    assert total.mean() == pytest.approx(load, rel=0.15)
    fraction = profile(run, "solid-fraction", chosen, 12).value
    assert fraction[[0, -1]].max() < 0.8 * fraction[3:9].mean()


def test_area_and_virial_are_kept_while_the_lid_moves(run):
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


def test_stress_of_frames_is_the_recorded_virial(run):
    """Σ f ℓ of contacts between grains in the same steps; those with walls come on top of it."""
    steps = np.asarray(run.series["step"])
    for frame in run.frames[-10:]:
        contacts = loaded_contacts(frame, run.model)
        found = np.array(
            [[contacts.virial(a, b)[~contacts.is_wall].sum() for b in (0, 1)] for a in (0, 1)]
        )
        row = int(np.flatnonzero(steps == frame.step)[0])
        assert found == pytest.approx(run.series["virial_rate"][row], rel=1e-9, abs=1e-12)


def test_rheology_closes_the_energy_balance(run):
    """The shear force at the walls times their velocity is the work that the books say."""
    table = rheology(run, Selection(start=0.4 * float(run.frames.time[-1])))
    ends = [run.frames[int(table.frames[k])].time for k in (0, -1)]
    books = energy(run, *ends)
    work = books.books["wall_work"][-1] - books.books["wall_work"][0]
    assert books.time[[0, -1]].tolist() == ends
    force = table.mean["friction_walls"] * table.mean["pressure"] * run.period
    # the mean of both walls' forces; they differ by what the grains gain in momentum
    assert force * 1.0 * (ends[1] - ends[0]) == pytest.approx(work, rel=0.05)


class Regrouped:
    """A frame of a run whose grains belong to other groups."""

    def __init__(self, frame, model):
        self.frame, self.model = frame, model

    def __getattr__(self, name):
        return getattr(self.frame, name)


def test_stresses_of_groups_add_up_to_that_of_all_and_contacts_count_whole(run):
    model = run.model
    group = (np.arange(model.grain_count) % 3 == 0).astype(np.int32)
    model = replace(model, groups=("many", "few"), grains=replace(model.grains, group=group))
    frames = [Regrouped(run.frames[k], model) for k in (-3, -2, -1)]
    source = source_of(model, frames)
    whole, many, few = (
        profiles(source, "stress", Selection(start=0.0), 5, groups=names)
        for names in ((), ("many",), ("few",))
    )
    for all_, first, second in zip(whole.tables, many.tables, few.tables, strict=True):
        assert first.value + second.value == pytest.approx(all_.value)
        assert np.abs(second.value).max() > 0.0
    # Contacts per grain over all heights: each with the contacts that it has, whoever the other is.
    table = profile(source, "coordination", Selection(start=0.0), 1, groups=["few"])
    chosen = group == 1
    expected = []
    for frame in frames:
        held, n = frame.contacts.force[:, 0] != 0.0, model.grain_count
        i, j = np.asarray(frame.contacts.i)[held], np.asarray(frame.contacts.j)[held]
        expected.append(np.mean([np.sum(i == k) + np.sum(j == k) for k in range(n) if chosen[k]]))
    assert table.value[0] == pytest.approx(np.mean(expected), rel=1e-6)
    # A group that touches nothing of its own kind still bears half of what it exchanges with the
    # other.
    contacts = loaded_contacts(frames[-1], model)
    plain = [
        0.5 * (group[a] + group[b]) if b < model.grain_count else 1.0 * group[a]
        for a, b in zip(contacts.i, contacts.j, strict=True)
    ]
    assert contacts.parts(np.flatnonzero(group == 1)) == pytest.approx(np.array(plain))


def test_forces_of_wall_contacts_are_the_recorded_wall_forces(run):
    """With a row of the time series per step both are the same sums."""
    model, series = run.model, run.series
    for frame in run.frames[-20:]:
        contacts = loaded_contacts(frame, model)
        walls = model.shapes.wall[contacts.j[contacts.is_wall] - model.grain_count]
        forces = -contacts.vector[contacts.is_wall]
        on_walls = [np.bincount(walls, force, minlength=2) for force in forces.T]
        row = int(np.flatnonzero(series["step"] == frame.step)[0])
        recorded = series["wall_force"][row, :, :2]
        assert np.column_stack(on_walls) == pytest.approx(recorded, rel=1e-9, abs=1e-12)


def test_stress_equals_wall_forces_per_area(flows):
    """Momentum balance: on average the layer carries what the walls exert.

    In single runs the two differ: over 32 seeds by 3.7 % (shear) and 2.7 % (normal stress),
    standard deviations, with means of 0 %.
    """
    ratios = []
    for run in flows:
        chosen = Selection(start=0.4 * float(run.frames.time[-1]))
        xx, xy, yx, yy = (
            float(profile(run, of, chosen, 1, exclude_walls=2.0).value[0])
            for of in PROFILE_GROUPS["stress"]
        )
        rows = run.series["time"] >= chosen.start
        force = run.series["wall_force"][rows].mean(axis=0) / run.period
        shear_force, press = 0.5 * (force[1, 0] - force[0, 0]), 0.5 * (force[1, 1] - force[0, 1])
        assert xy < 0.0 < min(xx, yy)
        ratios.append([xy / shear_force, yx / shear_force, yy / press])
    deviation = np.abs(np.mean(ratios, axis=0) - 1.0)
    assert (deviation < 3.0 * np.array([0.037, 0.037, 0.027]) / np.sqrt(len(flows))).all(), ratios


def test_rheology_of_a_real_run_agrees_between_walls_and_bulk(run):
    table = rheology(run, Selection(start=0.4 * float(run.frames.time[-1])))
    mean, error = table.mean, table.error
    both = np.hypot(error["friction_walls"], error["friction_bulk"])
    assert abs(mean["friction_walls"] - mean["friction_bulk"]) < 3.0 * both
    assert 0.1 < mean["friction_walls"] < 0.8
    assert 0.6 < mean["solid_fraction"] < 0.9
    # Contacts resist where the flow compresses: 135° for x upwards of y
    assert 100.0 < mean["fabric_direction"] < 170.0
    assert mean["coordination_loaded"] > mean["coordination"] > 1.0
    assert -1.5 < mean["spin_ratio"] < 0.0
