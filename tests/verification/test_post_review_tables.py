"""Rheology, forces, maps, θ–η, comparisons of random runs by plain loops; windows; data output."""

import csv
import json
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import post_oracle as oracle
import pytest
from from_wall_to_wall import profile
from made_up_frames import put, source_of
from scene_parts import make_shapes
from typer.testing import CliRunner

from multicor_cli import post
from multicor_cli.cli.app import app
from multicor_cli.model import ShapeKind
from multicor_cli.post.bins import find_extent

ALL = post.Selection(frames=slice(None))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return oracle.write_random_run(tmp_path_factory.mktemp("random") / "run", seed=21)


# --- rheology


def bulk_of(frame, edge):
    return oracle.FLOOR + frame.wall_position[0, 1] + edge, oracle.LID + frame.wall_position[
        1, 1
    ] - edge


def direct_interval(run, first, second, edge, slip):
    """What one interval adds to the sums, with plain loops."""
    model, radius = run.model, run.model.grains.radius
    low, high = bulk_of(second, edge)
    y = second.position[:, 1]
    inside = [k for k in range(radius.size) if low < y[k] < high]
    found = oracle.branches(run, second)
    counts = oracle.counts(run, second)
    stress, normals = np.zeros((2, 2)), np.zeros((2, 2))
    middle = 0
    for i, _, force, way in found:
        start = float(y[i])
        stress += (
            np.outer(force, way) * oracle.parts(start, start - way[1], np.array([low, high]))[0]
        )
        if low < start - 0.5 * way[1] < high:
            normal = way / np.linalg.norm(way)
            normals += np.outer(normal, normal)
            middle += 1
    between = 0.5 * (np.array(bulk_of(first, edge)) + bulk_of(second, edge))
    halfway = 0.5 * (first.position[:, 1] + y)
    near = (halfway > between[0]) & (halfway < between[1])
    across = (
        second.position[:, 0] - first.position[:, 0] + oracle.PERIOD * (second.image - first.image)
    )
    weight = ((halfway - between[0]) * (between[1] - halfway))[near]
    turn = (second.angle - first.angle)[near]
    rows = [k for k, t in enumerate(run.series["time"]) if first.time < t <= second.time]
    forces = sum(run.series["wall_force"][k] * run.series["window_duration"][k] for k in rows)
    return {
        "lapse": second.time - first.time,
        "strain": np.polyfit(halfway[near], across[near], 1)[0],
        "turn": (weight * turn).sum() / weight.sum(),
        "solid": oracle.areas(y, radius, np.array([low, high])).sum(),
        "area": (high - low) * oracle.PERIOD,
        "kinetic": sum(0.5 * (slip[k] @ slip[k]) for k in inside),
        "grains": len(inside),
        "contacts": counts[inside].sum(),
        "heavy": sum(counts[k] for k in inside if counts[k] > 1),
        "heavies": sum(1 for k in inside if counts[k] > 1),
        "stress": stress,
        "normals": normals,
        "middle": middle,
        "shear": 0.5 * (forces[0, 0] - forces[1, 0]),
        "press": 0.5 * (forces[1, 1] - forces[0, 1]),
        "window": sum(run.series["window_duration"][k] for k in rows),
        "mass": model.grains.mass.mean(),
    }


def derived(rows, run):
    """The quantities from sums of intervals, as they are defined in the reference."""
    s = {name: sum(row[name] for row in rows) for name in rows[0]}
    rate, pressure = s["strain"] / s["lapse"], s["press"] / s["window"] / oracle.PERIOD
    grains = run.model.grains
    if not s["middle"]:  # nothing touches
        s["middle"], s["normals"], s["heavies"] = np.nan, np.eye(2), np.nan
    values, vectors = np.linalg.eigh(s["normals"])
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])) % 180.0
    dense = grains.mass.sum() / (np.pi * grains.radius**2).sum()
    return {
        "shear_rate": rate,
        "pressure": pressure,
        "inertial_number": abs(rate) * np.sqrt(grains.mass.mean() / pressure),
        "inertial_number_density": abs(rate)
        * 2.0
        * grains.radius.mean()
        * np.sqrt(dense / pressure),
        "friction_walls": s["shear"] / s["press"],
        "friction_bulk": -s["stress"][0, 1] / (s["stress"][1, 1] or np.nan),
        "bulk_stress_yy": s["stress"][1, 1] / s["area"],
        "solid_fraction": s["solid"] / s["area"],
        "coordination": s["contacts"] / s["grains"],
        "coordination_loaded": s["heavy"] / s["heavies"],
        "fabric_anisotropy": 2.0 * (values[1] - values[0]) / s["middle"],
        "fabric_direction": angle if s["middle"] > 0 else np.nan,
        "spin_ratio": s["turn"] / s["strain"],
        "granular_temperature": s["kinetic"] / s["grains"],
    }


@pytest.mark.parametrize("frames", [slice(None), slice(1, 12, 2), slice(3, 5)])
def test_rheology_agrees_with_plain_loops(run, frames):
    table = post.rheology(run, post.Selection(frames=frames), margin=1.0)
    chosen = list(range(oracle.FRAMES)[frames])
    edge = run.model.mean_diameter + oracle.GLUED
    slips = oracle.fluctuations(run, chosen)
    found = [run.frames[k] for k in chosen]
    steps = zip(found[:-1], found[1:], slips[1:], strict=True)
    rows = [direct_interval(run, a, b, edge, slip) for a, b, slip in steps]
    assert table.mean == pytest.approx(derived(rows, run), rel=1e-8, nan_ok=True)
    assert table.time.tolist() == [frame.time for frame in found[1:]]
    assert len(table.detail_rows) == len(rows)
    assert len(table.rows) == len(table.mean) == len(table.detail_rows[0]) - 1
    for k, row in enumerate(rows):
        if row["contacts"]:
            one = {name: values[k] for name, values in table.values.items()}
            assert one == pytest.approx(derived([row], run), rel=1e-8)
    n, whole = len(rows), derived(rows, run)
    rest = [derived(rows[:k] + rows[k + 1 :], run) for k in range(n)] if n > 1 else []
    for name in (
        "shear_rate", "inertial_number", "solid_fraction", "spin_ratio", "granular_temperature",
        "friction_walls",
    ):  # fmt: skip
        added = np.array([n * whole[name] - (n - 1) * without[name] for without in rest])
        expected = oracle.error_of_mean(added) if n > 1 else np.nan
        assert table.error[name] == pytest.approx(expected, rel=1e-8, nan_ok=True), name


def test_where_nothing_presses_ratios_have_no_value(run):
    """Where walls are loose I and μ* are neither infinite nor numbers; grains are still known."""
    names = ("time", "window_duration", "wall_force")
    series = {name: np.array(run.series[name]) for name in names}
    series["wall_force"][:] = 0.0
    series["wall_force"][:, 0, 0] = 1.0
    loose = SimpleNamespace(model=run.model, frames=run.frames, series=series)
    mean = post.rheology(loose, ALL, margin=1.0).mean
    ratios = ("inertial_number", "inertial_number_density", "friction_walls")
    assert all(np.isnan(mean[name]) for name in ratios)
    assert mean["pressure"] == 0.0
    assert np.isfinite(mean["shear_rate"])


# --- forces


def between_grains(run, k):
    """Direction, normal and tangential force of each contact between grains."""
    frame, n = run.frames[k], run.model.grain_count
    rows = []
    for c in range(frame.contacts.count):
        p, q = frame.contacts.impulse[c] / frame.dt
        if p > 0.0 and frame.contacts.j[c] < n:
            x, y = frame.contacts.normal[c]
            rows.append((float(np.arctan2(y, x)), float(p), float(q)))
    return rows


def test_force_distribution_agrees_with_plain_loops(run):
    table = post.force_distribution(run, ALL, 15)
    frames = [between_grains(run, k) for k in range(1, oracle.FRAMES)]
    normal, tangential, total = np.zeros(15), np.zeros(15), 0
    for rows in (rows for rows in frames if rows):
        f, g = np.array([row[1] for row in rows]), np.abs([row[2] for row in rows])
        normal += np.histogram(f / f.mean(), table.edges)[0]
        tangential += np.histogram(g / g.mean(), table.edges)[0]
        total += len(rows)
    assert table.contacts == total
    assert table.normal == pytest.approx(normal / total / np.diff(table.edges))
    assert table.tangential == pytest.approx(tangential / total / np.diff(table.edges))
    assert table.mean == pytest.approx(np.mean([row[1] for rows in frames for row in rows]))
    inside = table.normal * np.diff(table.edges)
    assert inside.sum() == pytest.approx(table.count.sum() / total)
    # the mean of f/<f> is 1: the first moment of the density, to the width of the bins
    assert (inside * table.center).sum() == pytest.approx(1.0, rel=0.05)
    assert len(table.rows) == 15


def test_angular_distribution_agrees_with_plain_loops(run):
    table = post.angular_distribution(run, ALL, 12)
    rows = np.array([row for k in range(1, oracle.FRAMES) for row in between_grains(run, k)])
    both = np.concatenate([rows, rows + np.array([np.pi, 0.0, 0.0])])
    bins = np.floor((both[:, 0] % (2.0 * np.pi)) / (np.pi / 6.0)).astype(int) % 12
    for b in range(12):
        mine = both[bins == b]
        assert table.density[b] == pytest.approx(len(mine) / len(both) / (np.pi / 6.0))
        assert table.normal[b] == pytest.approx(mine[:, 1].mean() / rows[:, 1].mean())
        assert table.tangential[b] == pytest.approx(mine[:, 2].mean() / rows[:, 1].mean())
    tensor = np.mean(
        [np.outer(n, n) for n in np.column_stack([np.cos(rows[:, 0]), np.sin(rows[:, 0])])], axis=0
    )
    assert table.moments["a_c"] == pytest.approx(2.0 * np.ptp(np.linalg.eigvalsh(tensor)))


def test_force_network_agrees_with_plain_loops(run):
    network, frame, n = post.force_network(run, 9), run.frames[9], run.model.grain_count
    found = oracle.branches(run, frame)
    counts = oracle.counts(run, frame)
    summary = network.summary
    assert summary["contacts"] == len(found)
    assert summary["wall_contacts"] == sum(1 for _, j, _, _ in found if j >= n) > 0
    assert summary["coordination"] == pytest.approx(counts.mean())
    assert summary["rattler_share"] == pytest.approx((counts < 2).mean())
    ends = np.array([frame.position[i] - way for i, _, _, way in found])
    assert network.end == pytest.approx(ends)
    assert network.i.tolist() == [i for i, *_ in found]  # every fifth contact has no force
    empty = post.force_network(run, 4)
    assert empty.contacts == empty.coordination == 0
    assert empty.rattler_share == 1.0
    assert np.isnan(empty.normal_force_mean)


# --- maps and θ–η


def test_maps_agree_with_plain_loops(run):
    frame, before = run.frames[8], run.frames[7]
    load = np.zeros(run.model.grain_count)
    for i, j, force, way in oracle.branches(run, frame):
        push = float(force @ way) / float(np.linalg.norm(way))
        load[i] += push
        if j < load.size:
            load[j] += push
    pressure = load / (2.0 * np.pi * run.model.grains.radius)
    assert post.grain_map(run, "stress", 8).value == pytest.approx(pressure)
    heat = (frame.generated - before.generated) / (frame.time - before.time)
    assert post.grain_map(run, "heat", 8).value == pytest.approx(heat)
    slip = oracle.fluctuations(run, [8])[0]
    vector = post.grain_map(run, "fluctuation", 8).vector
    assert vector[:, 0] == pytest.approx(slip[:, 0])
    assert vector[:, 1] == pytest.approx(frame.velocity[:, 1])


@pytest.mark.parametrize(("wall", "temperature"), [("floor", 310.0), ("lid", 350.0)])
def test_theta_eta_agrees_with_plain_loops(run, wall, temperature):
    """The first frame is at 300 K."""
    table = post.theta_eta(run, 9, wall=wall, bins=6)
    frame, radius = run.frames[9], run.model.grains.radius
    y = frame.position[:, 1]
    low, high = min(y - radius), max(y + radius)
    eta = ((y - low) if wall == "floor" else (high - y)) / (high - low)
    theta = (frame.temperature - 300.0) / (temperature - 300.0)
    assert table.eta == pytest.approx(eta)
    assert table.theta == pytest.approx(theta)
    for b in range(6):
        mine = theta[(eta >= b / 6.0) & (eta < (b + 1) / 6.0)]
        assert table.count[b] == mine.size
        if mine.size:
            assert (table.mean[b], table.spread[b]) == pytest.approx((mine.mean(), mine.std()))
            assert (table.lowest[b], table.highest[b]) == pytest.approx((mine.min(), mine.max()))
    with pytest.raises(post.PostError, match="'lid' has no prescribed temperature in this frame"):
        post.theta_eta(run, 7, wall="lid")


def test_a_wall_at_the_temperature_of_the_grains_gives_no_theta(run):
    """A mean of equal temperatures with weights is off by 1e-13: that is no difference."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        capacity = rng.uniform(1.0, 2.0, run.model.grain_count)
        thermal = SimpleNamespace(capacity=capacity)
        model = replace(run.model, thermal=thermal)
        frame = run.frames[9]
        of_walls = [298.15, *frame.wall_temperature[1:]]
        put(frame, temperature=np.full(len(frame.temperature), 298.15), wall_temperature=of_walls)
        with pytest.raises(post.PostError, match="not at the reference temperature"):
            post.theta_eta(source_of(model, [frame]), 0, wall="floor")


# --- windows


def test_ends_of_a_window_count_though_times_are_rounded(column):
    """300 steps of 0.2 ms end at 0.06 s for people, at 0.060000000000000005 s in the file."""
    times = np.array([0.0, 300 * 0.0002, 0.1 + 0.2, 1648 * 0.00028, 1.1 - 0.2])
    assert times[1] > 0.06
    assert times[2] > 0.3
    assert times[3] < 0.46144
    series = {name: np.array(column.series[name]) for name in column.series} | {"time": times}
    source = source_of(column.model, column.frames, times, series=series)
    for start, end, expected in (
        (0.06, 0.3, [1, 2]), (0.46144, None, [3, 4]), (None, 0.06, [0, 1]), (0.3, 0.3, [2]),
        (0.07, 0.3, [2]),
    ):  # fmt: skip
        assert profile(source, "velocity", post.Selection(start, end)).frames.tolist() == expected
        assert post.energy(source, start, end).time.tolist() == times[expected].tolist()
    for start, end in ((0.07, 0.29), (0.3, 0.06), (5.0, None)):
        with pytest.raises(post.PostError, match="no frame is selected"):
            profile(source, "velocity", post.Selection(start, end))
        with pytest.raises(post.PostError, match="no row in this time"):
            post.energy(source, start, end)


# --- which walls bound the grains


def with_walls(run, kinds, geometry):
    """The run with four other walls, at rest at their places."""
    shapes = make_shapes(list(zip(kinds, range(4), geometry, strict=True)))
    model, frames = replace(run.model, shapes=shapes), list(run.frames)
    for frame in frames:
        put(frame, wall_position=np.zeros_like(frame.wall_position))
    return source_of(model, frames, run.frames.time)


SIDES = [[0.0, 0.0, 1.0, 0.0], [oracle.PERIOD, 0.0, -1.0, 0.0]]


@pytest.mark.parametrize(("first", "second", "lower", "upper"), [
    ([0.0, 0.2, 3.0, 0.2], [0.0, 1.9, 3.0, 1.9], 0, 1),
    ([0.0, 0.3, 3.0, 0.2], [0.0, 1.9, 3.0, 1.9], 0, 1),  # a little tilted: its middle counts
    ([0.0, 0.2, 3.0, 0.85], [0.0, 1.9, 3.0, 1.9], None, 1),  # grains lie below its middle
    ([1.0, 1.9, 1.0, 2.9], [0.0, 2.5, 3.0, 2.5], None, 1),  # a gate that was lifted is no lid
    # a plate amid the grains bounds nothing
    ([0.2, 1.0, 0.3, 1.0], [0.0, 0.1, 3.0, 0.1], 1, None),
])  # fmt: skip
def test_only_walls_that_bound_the_grains_count(run, first, second, lower, upper):
    kinds = [ShapeKind.SEGMENT, ShapeKind.SEGMENT, ShapeKind.PLANE, ShapeKind.PLANE]
    source = with_walls(run, kinds, [first, second, *SIDES])
    extent = find_extent(source, np.arange(oracle.FRAMES))
    assert (extent.lower, extent.upper) == (lower, upper)
    table = profile(source, "solid-fraction", ALL, 8)
    area = float((np.pi * run.model.grains.radius**2).sum())
    assert table.value.sum() * table.bin_area == pytest.approx(area, rel=1e-12)


# --- comparisons, and data as it leaves the program


def test_comparison_agrees_with_plain_loops(tmp_path):
    runs = [oracle.write_random_run(tmp_path / f"run-{seed}", seed=seed) for seed in (1, 2)]
    sources = [
        SimpleNamespace(model=r.model, frames=r.frames, series=r.series, scenario_resolved="")
        for r in runs
    ]
    found = post.compare(*sources, of=["spin"], selection=ALL, bins=5)
    tables = [post.profile(run, "spin", ALL, 5) for run in runs]  # without the layers at the walls
    error = np.sqrt(tables[0].error ** 2 + tables[1].error ** 2)
    ratio = (tables[1].value - tables[0].value) / error
    pair = found.profiles["spin"]
    assert pair.ratio == pytest.approx(ratio)
    assert pair.rms_ratio == pytest.approx(np.sqrt(np.mean(ratio**2)))
    assert 0.3 < pair.rms_ratio < 3.0  # both runs are drawn alike
    numbers = {number.name: number for number in found.numbers}
    flows = [post.rheology(run, ALL) for run in runs]
    for name in ("shear_rate", "solid_fraction", "spin_ratio"):
        one, two = (flow.mean[name] for flow in flows)
        error = np.sqrt(sum(flow.error[name] ** 2 for flow in flows))
        found = (numbers[name].difference, numbers[name].ratio)
        assert found == pytest.approx((two - one, (two - one) / error))


COMMANDS = [
    *(f"profile --of {of} --frames :" for of, each in post.PROFILED.items() if not each.needs_axes),
    *(f"profile --of {of} --frames :" for of in post.PROFILE_GROUPS if of != "nematic"),
    *(f"map --of {of}" for of, each in post.MAPPED.items() if not each.needs_axes),
    "profile --of stress-yy --frames 4:5", "theta-eta --wall floor", "forces", "forces --frame 4",
    "forces --distribution --frames :", "forces --angles --frames :", "rheology --frames :",
    "rheology --frames 3:5", "energy",
]  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_data_are_strict_json_and_csv_of_full_precision(run, command):
    """No NaN or Infinity in JSON; numbers of the CSV that it holds are there to the last bit."""
    name, *options = command.split()
    words = ["post", name, str(run.path), *options]
    done = [CliRunner().invoke(app, [*words, extra]) for extra in ("--json", "--csv")]
    assert [result.exit_code for result in done] == [0, 0], done[0].stderr

    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    data = json.loads(done[0].stdout, parse_constant=refuse)
    rows = list(csv.reader(done[1].stdout.splitlines()))
    assert len({len(row) for row in rows}) == 1
    numbers = [float(cell) for row in rows[1:] for cell in row if _is_number(cell)]
    assert numbers or command == "forces --frame 4"  # no contacts, no rows
    assert np.isfinite(numbers).all()
    if name in ("profile", "rheology", "energy", "theta-eta"):
        assert set(numbers) <= set(_numbers(data))


def _is_number(cell):
    with suppress(ValueError):
        float(cell)
        return True
    return False


def _numbers(data):
    if isinstance(data, dict):
        return [number for value in data.values() for number in _numbers(value)]
    if isinstance(data, list):
        return [number for value in data for number in _numbers(value)]
    return [float(data)] if isinstance(data, int | float) else []
