"""Every profile of random runs with moving walls by plain loops, and what must be conserved."""

from itertools import pairwise

import numpy as np
import post_oracle as oracle
import pytest
from from_wall_to_wall import profile
from made_up_frames import put, source_of

from multicor_cli.post import PROFILED, PostError, Selection, grain_map
from multicor_cli.post.flow import d2min

ALL = Selection(frames=slice(None))


@pytest.fixture(scope="module", params=[True, False], ids=["periodic", "bounded"])
def run(request, tmp_path_factory):
    return oracle.write_random_run(
        tmp_path_factory.mktemp("random") / "run", is_periodic=request.param, seed=5
    )


SIMPLE = {
    "velocity": lambda frame: frame.velocity[:, 0],
    "velocity-y": lambda frame: frame.velocity[:, 1],
    "spin": lambda frame: frame.spin,
    "temperature": lambda frame: frame.temperature,
}


OF_CELLS = ("local-solid-fraction", "hexatic")
"""What grains with open cells do not have."""


def _grain_values(run, of, chosen, width):
    frames = {k: run.frames[k] for k in chosen}
    if of in SIMPLE:
        return {k: SIMPLE[of](f) for k, f in frames.items()}
    if of == "coordination":
        return {k: oracle.counts(run, frame) for k, frame in frames.items()}
    if of in OF_CELLS:  # whose values are tested in their own modules
        return {k: grain_map(run, of, k).value for k in chosen}
    if of == "d2min":
        pairs = pairwise(chosen)
        return {k: d2min(run.model, run.frames[before], run.frames[k]) for before, k in pairs}
    slips = dict(zip(chosen, oracle.fluctuations(run, chosen, width), strict=True))
    if of == "granular-temperature":
        return {k: 0.5 * (v**2).sum(axis=1) for k, v in slips.items()}
    a, b = ("xy".index(axis) for axis in of.rsplit("-", 1)[1])
    density = run.model.grains.mass / (np.pi * run.model.grains.radius**2)
    return {k: density * v[:, a] * v[:, b] for k, v in slips.items()}


def _contact_sum(run, of, k, edges):
    axes = [(0, 0), (1, 1)]
    if of != "pressure":
        axes = [tuple("xy".index(axis) for axis in of.rsplit("-", 1)[1])]
    total = np.zeros(edges.size - 1)
    frame = run.frames[k]
    for i, _, force, way in oracle.branches(run, frame):
        start = float(frame.position[i, 1])
        carried = sum(force[a] * way[b] for a, b in axes) / len(axes)
        total += carried * oracle.parts(start, start - way[1], edges)
    return total


def direct(run, of, chosen, count, left_out):
    """Values and standard errors of the bins by loops over frames, grains and bins."""
    radius, rows = run.model.grains.radius, []
    layers = {k: oracle.layer(run, run.frames[k], count, left_out) for k in chosen}
    mean = float(np.mean([np.ptp(one.edges) for one in layers.values()]))
    if of == "heat":
        for before, after in pairwise(chosen):
            first, second = run.frames[before], run.frames[after]
            edges = 0.5 * (layers[before].edges + layers[after].edges)
            inside = oracle.areas(
                0.5 * (first.position[:, 1] + second.position[:, 1]), radius, edges
            )
            gain = (second.generated - first.generated) / (np.pi * radius**2)
            plane = 0.5 * (layers[before].plane + layers[after].plane)
            rows.append((gain @ inside, np.diff(edges) * plane * (second.time - first.time)))
    elif PROFILED[of].of_contacts is not None:
        for k in chosen:
            edges = layers[k].edges
            rows.append((_contact_sum(run, of, k, edges), np.diff(edges) * layers[k].plane))
    else:
        values = {} if of == "solid-fraction" else _grain_values(run, of, chosen, mean / count)
        for k in chosen[1:] if of == "d2min" else chosen:
            inside = oracle.areas(run.frames[k].position[:, 1], radius, layers[k].edges)
            if of in ("coordination", "d2min", *OF_CELLS):
                inside = inside / (np.pi * radius**2)[:, np.newaxis]
            if of in ("d2min", *OF_CELLS):
                inside = np.where(np.isnan(values[k])[:, np.newaxis], 0.0, inside)
                values[k] = np.nan_to_num(values[k])
            per_plane = of == "solid-fraction" or of.startswith("kinetic")
            below = np.diff(layers[k].edges) * layers[k].plane if per_plane else inside.sum(axis=0)
            rows.append((values.get(k, np.ones(radius.size)) @ inside, below))
    with np.errstate(invalid="ignore"):
        value = sum(row[0] for row in rows) / sum(row[1] for row in rows)
    return value, oracle.remembering_error(rows)


@pytest.mark.parametrize("of", [of for of, each in PROFILED.items() if not each.needs_axes])
@pytest.mark.parametrize(
    ("frames", "count", "left_out"),
    [(slice(None), 9, 0.0), (slice(2, 12, 3), 30, 0.0), (slice(5, 9), 4, 2.0)],
)
def test_profile_agrees_with_plain_loops(run, of, frames, count, left_out):
    chosen = list(range(oracle.FRAMES)[frames])
    if PROFILED[of].needs_contacts:
        chosen = [k for k in chosen if k not in oracle.BEFORE_FORCES]
    table = profile(run, of, Selection(frames=frames), count, exclude_walls=left_out)
    assert table.frames.tolist() == chosen
    edge, frames_ = left_out * run.model.mean_diameter, [run.frames[k] for k in chosen]
    value, error = direct(run, of, chosen, count, edge)
    scale = np.nanmax(np.abs(value))
    assert table.value == pytest.approx(value, rel=1e-9, abs=1e-10 * scale, nan_ok=True)
    assert table.error == pytest.approx(error, rel=1e-7, abs=1e-9 * scale, nan_ok=True)
    if PROFILED[of].kind != "rate":
        counted = frames_[1:] if of == "d2min" else frames_
        places = [(f.position[:, 1], oracle.layer(run, f, count, edge).edges) for f in counted]
        covered = [oracle.areas(y, run.model.grains.radius, edges) for y, edges in places]
        assert table.area == pytest.approx(np.mean(covered, axis=0).sum(axis=0))
    if len(chosen) < 5 and np.isfinite(error).any():
        assert "too few frames for good errors of" in table.note
    spans = [1.6 + f.wall_position[1, 1] - 0.4 - f.wall_position[0, 1] for f in frames_]
    assert table.height == pytest.approx(np.mean(spans))
    assert table.width == pytest.approx((np.mean(spans) - 2.0 * edge) / count)
    assert table.y == pytest.approx(edge + (np.arange(count) + 0.5) * table.width)


@pytest.mark.parametrize("count", [1, 7, 200])
def test_nothing_is_lost_between_moving_walls(run, count):
    """Sums over bins are those over grains and contacts, though the lid moves by several grains."""
    area = float((np.pi * run.model.grains.radius**2).sum())
    fraction = profile(run, "solid-fraction", ALL, count)
    assert fraction.value.sum() * fraction.bin_area == pytest.approx(area, rel=1e-12)
    assert fraction.area.sum() == pytest.approx(area, rel=1e-12)
    if run.period:
        assert fraction.bin_area == pytest.approx(fraction.width * run.period, rel=1e-12)
    heat = profile(run, "heat", ALL, count)
    ends = [run.frames[k] for k in (0, -1)]
    total = float((ends[1].generated - ends[0].generated).sum()) / (ends[1].time - ends[0].time)
    assert heat.value.sum() * heat.bin_area == pytest.approx(total, rel=1e-12)
    frames = [run.frames[k] for k in range(oracle.FRAMES) if k not in oracle.BEFORE_FORCES]
    each = [sum(np.outer(f, way) for *_, f, way in oracle.branches(run, frame)) for frame in frames]
    virial = np.sum([one for one in each if np.ndim(one)], axis=0) / len(frames)
    for a, b in np.ndindex(2, 2):
        stress = profile(run, f"stress-{'xy'[a]}{'xy'[b]}", ALL, count)
        assert stress.value.sum() * stress.bin_area == pytest.approx(virial[a, b], rel=1e-9)


def test_a_frame_without_contacts_has_no_stress_and_no_contacts(run):
    for of in ("stress-yy", "pressure", "coordination"):
        assert profile(run, of, Selection(frames=slice(4, 5)), 1).value.tolist() == [0.0]


def test_a_linear_flow_has_no_fluctuations_whatever_the_bins(run):
    """Grains of all sizes, cut by edges and walls: only what was added to the flow is found."""
    frames = [run.frames[k] for k in (3, 5)]
    for frame in frames:
        low, high = oracle.layer(run, frame, 1).edges
        flow = 7.0 * (frame.position[:, 1] - low) / (high - low) - 2.0
        put(frame, velocity=np.column_stack([flow, np.zeros_like(flow)]))
    source = source_of(run.model, frames)
    for count in (1, 5, 40):
        table = profile(source, "granular-temperature", ALL, count)
        assert table.value[np.isfinite(table.value)] == pytest.approx(0.0, abs=1e-18)
    # the same grains elsewhere: 0.4 up and 0.4 down are no flow, but for few grains at a knot
    for frame, sign in zip(frames, (1.0, -1.0), strict=True):
        put(
            frame,
            velocity=np.column_stack(
                [frame.velocity[:, 0], np.full(len(frame.velocity), 0.4 * sign)]
            ),
        )
    table = profile(source, "granular-temperature", ALL, 1)
    assert table.value[0] == pytest.approx(0.5 * 0.4**2, rel=0.2)


def test_walls_that_come_too_near_are_named(run):
    """The mean distance leaves room, the smallest does not."""
    spans = [np.diff(oracle.layer(run, frame, 1).edges)[0] for frame in run.frames]
    edge = 0.25 * (min(spans) + np.mean(spans)) / run.model.mean_diameter
    with pytest.raises(PostError, match="where they come nearest"):
        profile(run, "velocity", ALL, exclude_walls=edge)


def test_normalized_temperature_needs_that_of_the_walls_in_every_frame(run):
    """The lid has no temperature in frame 7."""
    with pytest.raises(PostError, match="'lid' has none, or not in all of these frames"):
        profile(run, "temperature", Selection(frames=slice(6, 9)), 3).normalized()
    table = profile(run, "temperature", Selection(frames=slice(8, 10)), 3)
    assert table.normalized().value == pytest.approx((table.value - 310.0) / 40.0)
    assert table.normalized().error == pytest.approx(table.error / 40.0)


@pytest.mark.parametrize("frames", [slice(3, 4), slice(3, 5), slice(3, 6)])
def test_errors_of_few_frames(run, frames):
    """One frame: none. Two and three: as of so many numbers, with the same grains in all."""
    table = profile(run, "spin", Selection(frames=frames), 1)
    single = (Selection(frames=slice(k, k + 1)) for k in range(oracle.FRAMES)[frames])
    means = [profile(run, "spin", one, 1).value for one in single]
    expected = oracle.remembering_error([(mean, np.ones(1)) for mean in means])
    assert table.error[0] == pytest.approx(expected[0], nan_ok=True)
    if len(means) == 2:
        assert table.error[0] == pytest.approx(0.5 * abs(means[1] - means[0])[0])


def test_a_run_that_still_goes_on_gives_the_same_numbers(tmp_path):
    """Segments instead of results.h5, several of them."""
    whole = oracle.write_random_run(tmp_path / "whole", seed=9)
    part = oracle.write_random_run(tmp_path / "part", seed=9, is_finished=False)
    assert not (tmp_path / "part" / "results.h5").exists()
    for of in ("velocity", "heat", "stress-xy", "coordination", "kinetic-stress-xy"):
        one, two = (profile(run, of, ALL, 6) for run in (whole, part))
        assert one.value.tolist() == two.value.tolist()
        assert one.error.tolist() == two.error.tolist()


def test_what_does_not_change_has_no_error(run):
    """The same frame eleven times, as while frozen: rounding of sums is no scatter."""
    source = source_of(run.model, [run.frames[6]] * 11)
    for of in ("solid-fraction", "velocity", "stress-yy"):
        table = profile(source, of, ALL, 7)
        assert table.error.tolist() == [0.0] * 7
