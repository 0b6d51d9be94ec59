"""From a scenario to Model and State: bodies, laws, motion, groups after each other, and what is
refused."""

import math
import re

import numpy as np
import pytest
from packing_support import (
    GRAVITY,
    PERIODIC,
    SECOND,
    built,
    pair_gaps,
    problems,
    smallest_gap,
    wall,
)
from scenes import PACKED, changed

FLOOR = wall("floor", 'kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]')
LATTICE = 'particles.0.packing={kind="lattice", lattice="triangular"}'
EQUAL = 'particles.0.sizes={kind="list", radii=[1e-3]}'
UNCOUNTED = changed(PACKED, ("count = 200\n", ""))


def area(model):
    return np.pi * (model.grains.radius**2).sum()


def test_masses_inertia_and_indices():
    model, state = built(extra=SECOND)
    g = model.grains
    assert model.grain_count == 300
    assert model.groups == ("grains", "second")
    assert model.materials == ("glass", "steel")
    np.testing.assert_array_equal(g.group, np.repeat([0, 1], [200, 100]))
    np.testing.assert_array_equal(g.material, np.repeat([0, 1], [200, 100]))
    height_density = np.repeat([2500.0 * 2e-3, 7800.0 * 1e-3], [200, 100])
    np.testing.assert_allclose(g.mass, np.pi * g.radius**2 * height_density, rtol=1e-14)
    np.testing.assert_allclose(g.inertia, 0.5 * g.mass * g.radius**2, rtol=1e-14)
    assert model.shape_factor == 2.0
    assert smallest_gap(state.position, g.radius) >= 0.0
    assert not state.velocity.any()
    assert state.window_wall_impulse.shape == (0, 3)
    text = changed(PACKED, ("thickness = 2e-3\n", ""), ('"disc"', '"sphere"'))
    model, _ = built("particles.0.count=20", text=text)
    g = model.grains
    np.testing.assert_allclose(g.mass, 4 / 3 * np.pi * g.radius**3 * 2500.0, rtol=1e-14)
    np.testing.assert_allclose(g.inertia, 0.4 * g.mass * g.radius**2, rtol=1e-14)
    assert model.shape_factor == 2.5


def test_motion():
    motion = ("velocity=[1, 2]", "spin=3", "shear_rate=10")
    _, state = built(*(f"particles.0.{key}" for key in motion))
    v, y = state.velocity, state.position[:, 1]
    np.testing.assert_allclose(v[:, 0], 1 + 10 * (y - 0.04), rtol=1e-13)
    np.testing.assert_array_equal(v[:, 1:], np.tile([2.0, -2.0], (200, 1)))


def test_laws_of_all_touching_pairs():
    pair = '\n[[contacts]]\npair = ["glass", "steel"]\nrestitution = 0.7\n'
    table = "friction = { speed = [0.0, 1.0], values = [0.5, 0.1] }\n"
    laws = built(extra=FLOOR + pair + table)[0].laws
    assert laws.friction[0, 0] == 0.4
    assert laws.table.tolist() == [[-1, 0], [0, -1]]
    assert laws.restitution.tolist() == [[0.0, 0.7], [0.7, 0.0]]
    assert laws.table_start.tolist() == [0, 2]
    assert laws.table_speed.tolist() == [0.0, 1.0]
    assert laws.table_friction.tolist() == [0.5, 0.1]


@pytest.mark.parametrize("kind", ["random", "deposited"])
def test_seed_decides_every_bit(kind):
    packing = f'particles.0.packing={{kind="{kind}"}}'
    one, again, other = (built(packing, f"scenario.seed={seed}")[1].digest() for seed in (5, 5, 6))
    assert one == again != other


def test_wall_frames_start_at_their_reference_points():
    drum = wall("drum", 'kind = "circle", center = [0.03, 0.04], radius = 0.2')
    model, state = built(extra=FLOOR + drum)
    np.testing.assert_array_equal(state.wall_position, [[0, 0, 0], [0.03, 0.04, 0]])
    np.testing.assert_array_equal(model.shapes.geometry[1], [0, 0, 0.2, 0])
    assert model.walls.names == ("floor", "drum")


def test_periodic_lattice_on_a_floor_touches_it():
    model, state = built(LATTICE, EQUAL, PERIODIC, "particles.0.count=600", extra=FLOOR)
    assert model.period == 0.06
    assert np.all((state.position[:, 0] >= 0) & (state.position[:, 0] < 0.06))
    _, _, gap = pair_gaps(state.position, model.grains.radius, 1e-9, 0.06)
    assert gap.size == 600 + 2 * 570
    assert np.abs(gap).max() < 1e-16
    assert state.position[:30, 1] == pytest.approx([1e-3] * 30, rel=3e-16, abs=0.0)


def test_lattices_of_any_size():
    model, _ = built(LATTICE, EQUAL, text=UNCOUNTED)
    assert model.grain_count > 0.85 * 0.06 * 0.08 / (np.pi * 1e-6) * 0.9
    small = 'particles.0.sizes={kind="list", radii=[1e-4]}'
    model, state = built(LATTICE, small, "particles.0.count=100000", extra=FLOOR)
    assert model.grain_count == 100_000
    assert math.isclose(state.position[:, 1].min(), 1e-4)


def test_fill_counts_the_area_of_the_region():
    text = changed(PACKED, ("count = 200", "fill = 0.5"))
    model, state = built("particles.0.region={min=[0.0, 0.0], max=[0.06, 0.04]}", text=text)
    assert area(model) == pytest.approx(0.5 * 0.06 * 0.04, rel=2e-3)
    assert (state.position[:, 1] + model.grains.radius).max() <= 0.04 + 1e-12


@pytest.mark.parametrize("fill", [1e-3, 2e-3, 5e-3])
def test_a_fill_of_some_grains_is_met_as_closely_as_they_can(fill):
    model, _ = built(text=changed(PACKED, ("count = 200", f"fill = {fill}")))
    assert abs(area(model) - fill * 0.06 * 0.08) <= 0.5 * np.pi * 1.2e-3**2


@pytest.mark.parametrize("packing", ['"random"', '"deposited"', '"lattice", lattice = "square"'])
@pytest.mark.parametrize("fill", [1e-6, 1e-4, 2e-4])
def test_a_fill_of_less_than_one_grain_is_refused(packing, fill):
    """The area is that of 1528 grains."""
    changes = (("count = 200", f"fill = {fill}"), ('kind = "random"', f"kind = {packing}"))
    (problem,) = problems(GRAVITY, text=changed(PACKED, *changes))
    words = rf"fill of {fill:g} is too small for grains of these sizes: 1 grain fill 0\.000\d+"
    assert re.search(words, problem.message)
    assert problem.remedy.startswith("give")


def test_later_group_is_piled_upon_the_earlier():
    extra = SECOND.replace('"random"', '"deposited"')
    model, state = built('particles.0.packing={kind="deposited"}', extra=extra)
    assert smallest_gap(state.position, model.grains.radius) > -1e-12
    assert state.position[200:, 1].min() > 2e-3


def test_overlapping_groups_are_refused_by_number():
    extra = SECOND.replace('{ kind = "random" }', '{ kind = "lattice", lattice = "square" }')
    (problem,) = problems(LATTICE, EQUAL, extra=extra)
    assert problem.key == "particles.1"
    assert problem.line > 1
    assert problem.message.count("grains ") == 6  # the sentence and five pairs
    assert "more pairs" in problem.message
    assert "% of the smaller radius" in problem.message


def test_overlap_across_the_period(tmp_path):
    uniform = 'sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }\n'
    given = {"text": changed(UNCOUNTED, (uniform, "")), "path": tmp_path / "s.toml"}
    packing = 'particles.0.packing={kind="file", path="g.csv"}'
    rows = "x,y,radius\n-0.03,0.02,1e-3\n"
    (tmp_path / "g.csv").write_text(f"{rows}0.0002,0.01,1e-3\n0.0595,0.01,1e-3\n")
    _, state = built(packing, **given)
    assert state.position[0, 0] == pytest.approx(-0.03, rel=3e-16, abs=0.0)
    (problem,) = problems(packing, PERIODIC, **given)
    assert "grains 2 and 3 of 'grains' by 0.0013 m" in problem.message
    (tmp_path / "g.csv").write_text(rows)
    assert built(packing, PERIODIC, **given)[1].position[0, 0] == pytest.approx(0.03)


CUTS = {
    "plane": 'kind = "plane", point = [0.0, 0.01], normal = [0.0, 1.0]',
    "polyline": 'kind = "polyline", points = [[0.01, 0.01], [0.05, 0.03]]',
    "box": 'kind = "box", min = [0.0, 0.0], max = [0.05, 0.1]',
    "circle": 'kind = "circle", center = [0.03, 0.03], radius = 0.02',
    "rough": 'kind = "rough", from = [0.0, 0.01], to = [0.06, 0.01], side = "left"',
}


@pytest.mark.parametrize("kind", CUTS)
def test_wall_that_cuts_grains_is_refused_by_name(kind):
    found = problems(LATTICE, EQUAL, extra=wall("cutter", CUTS[kind]))
    assert found[0].key == "walls.0"
    assert "the wall 'cutter' cuts grains" in found[0].message
    assert "grain " in found[0].message


def test_overlap_below_the_bound_is_accepted():
    square = ['particles.0.packing={kind="lattice", lattice="square"}', EQUAL]
    just = [*square, "particles.0.count=30"]
    floor = 'kind = "plane", point = [0.0, {}], normal = [0.0, 1.0]'.format
    built(*just, extra=wall("w", floor(0.99e-6)))
    assert problems(*just, extra=wall("w", floor(1.01e-6)))[0].key == "walls.0"
    rough = CUTS["rough"].replace("0.01]", "0.02]")
    kinds = {"plane": CUTS["plane"], "line": CUTS["polyline"], "rough": rough}
    model, _ = built(extra="".join(wall(*each) for each in kinds.items()))
    assert model.grain_count == 200
    built(*BELOW, extra=BEHIND.replace("left", "right"))


BEHIND = wall("w", 'kind = "rough", from = [0.0, 0.0795], to = [0.06, 0.0795], side = "left"')
BELOW = (PERIODIC, "particles.0.region={min=[0.0, 0.0], max=[0.06, 0.07]}")
MANY = (LATTICE, EQUAL, "particles.0.count=1500")
CROWDED = SECOND.replace("count = 100", "count = 6000").replace('"random"', '"deposited"')
SHORT = (PERIODIC, "domain.size=[0.009, 0.5]", "particles.0.count=5")

# overrides, more tables, key and words of each problem
REFUSED = {
    "behind a rough wall": (BELOW, BEHIND, [("walls.0", "behind the rough wall 'w'")]),
    "too many": (MANY, "", [("particles.0", "it holds 13")]),
    "too many in two groups": (MANY, CROWDED, [("particles.0", "it holds 13"),
        ("particles.1", "the region is full")]),
    "short period": (SHORT, "", [("particles.0.sizes", "four of the largest diameters")]),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_packings_are_refused_with_all_problems_at_their_keys(name):
    overrides, extra, expected = REFUSED[name]
    for problem, (key, words) in zip(problems(*overrides, extra=extra), expected, strict=True):
        assert problem.key == key
        assert words in problem.message


def tile(source, repeat):
    return f"particles.0.packing={{kind='tile', source={{kind='{source}'}}, tile=[0.02, 0.02], tile_fill=0.7, repeat={repeat}}}"


def test_random_tile_closes_in_both_directions():
    model, state = built(tile("random", [3, 4]), PERIODIC, text=UNCOUNTED)
    assert smallest_gap(state.position, model.grains.radius, 0.06) > -1e-12
    assert 0.62 < area(model) / (0.06 * 0.08) < 0.7  # what sticks out at the ends is left out
    # Copies are congruent: the middle ones are whole
    x, y = state.position[:, 0], state.position[:, 1]
    counts = np.histogram(x, np.arange(4) * 0.02)[0]
    assert counts[0] == counts[1] == counts[2]
    counts = np.histogram(y, np.arange(5) * 0.02)[0]
    assert counts[1] == counts[2]


def test_tile_in_a_bounded_region_stays_inside():
    model, state = built(tile("random", [3, 1]), text=UNCOUNTED)
    x, r = state.position[:, 0], model.grains.radius
    assert np.all((x - r >= -1e-12) & (x + r <= 0.06 + 1e-12))


@pytest.mark.parametrize(("packing", "words"), [
    (tile("deposited", [3, 2]), "cannot be repeated in y"),
    (tile("random", [3, 1]).replace("[0.02, 0.02]", "[0.009, 0.02]"), "too narrow for grains"),
    (tile("random", [3, 2]).replace("[0.02, 0.02]", "[0.02, 0.009]"), "too low for grains"),
])  # fmt: skip
def test_tiles_that_cannot_be_stacked_are_refused(packing, words):
    (problem,) = problems(packing, PERIODIC, text=UNCOUNTED)
    assert words in problem.message


def compacted(pressure, friction, ratio):
    return f'particles.0.packing={{kind="compacted", pressure={pressure}, friction={friction}, kinetic_energy_ratio={ratio}}}'


@pytest.mark.parametrize(
    ("periodic", "friction", "low", "high"), [("true", 0.5, 0.75, 0.82), ("false", 0.0, 0.8, 0.86)]
)
def test_compacted_packing_is_dense_and_carries_itself(periodic, friction, low, high):
    model, state = built(
        compacted(50.0, friction, 1e-5), f"domain.periodic={periodic}", "particles.0.count=300",
        "domain.size=[0.03, 0.06]",
    )  # fmt: skip
    position, radius = state.position, model.grains.radius
    assert smallest_gap(position, radius, model.period) > -1e-3 * radius.min()
    assert not state.velocity.any()
    assert low < area(model) / (0.03 * (position[:, 1] + radius).max()) < high
    i, _, _ = pair_gaps(position, radius, 1e-3 * radius.min(), model.period)
    assert i.size > 1.2 * radius.size  # held by contacts: more than two per grain


def test_pressure_of_a_compaction_does_not_matter_to_rigid_grains():
    small = (PERIODIC, "particles.0.count=120", "domain.size=[0.02, 0.04]")
    one, other = (built(compacted(pressure, 0.5, 1e-4), *small)[1] for pressure in (50.0, 200.0))
    # A factor of four scales all times by an exact two, so not even rounding differs.
    np.testing.assert_array_equal(one.position, other.position)
