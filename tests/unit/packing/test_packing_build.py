"""From a scenario to Model and State: bodies, laws, motion, groups after each other, and what is
refused.
"""

import math

import numpy as np
import pytest
from packing_support import SECOND, pair_gaps, scenario, smallest_gap, wall
from scenes import PACKED, changed

from multicor_cli.packing import build
from multicor_cli.scenario import ScenarioError

FLOOR = wall("floor", 'kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0]')
LATTICE = 'particles.0.packing={kind="lattice", lattice="triangular"}'
EQUAL = 'particles.0.sizes={kind="list", radii=[1e-3]}'
UNCOUNTED = changed(PACKED, ("count = 200\n", ""))


def problems(*overrides, extra=""):
    with pytest.raises(ScenarioError) as caught:
        build(scenario(*overrides, extra=extra))
    return caught.value.problems


def test_masses_inertia_and_indices():
    model, state = build(scenario(extra=SECOND))
    g = model.grains
    assert model.grain_count == 300
    assert model.groups == ("grains", "second")
    assert model.materials == ("glass", "steel")
    np.testing.assert_array_equal(g.group, np.repeat([0, 1], [200, 100]))
    np.testing.assert_array_equal(g.material, np.repeat([0, 1], [200, 100]))
    density, thickness = (
        np.repeat([2500.0, 7800.0], [200, 100]),
        np.repeat([2e-3, 1e-3], [200, 100]),
    )
    np.testing.assert_allclose(g.mass, np.pi * g.radius**2 * thickness * density, rtol=1e-14)
    np.testing.assert_allclose(g.inertia, 0.5 * g.mass * g.radius**2, rtol=1e-14)
    assert model.shape_factor == 2.0
    assert smallest_gap(state.position, g.radius) >= 0.0
    assert not state.velocity.any()
    assert state.window_wall_impulse.shape == (0, 3)


def test_spheres():
    text = changed(PACKED, ("thickness = 2e-3\n", ""), ('"disc"', '"sphere"'))
    model, _ = build(scenario("particles.0.count=20", text=text))
    np.testing.assert_allclose(
        model.grains.mass, 4 / 3 * np.pi * model.grains.radius**3 * 2500.0, rtol=1e-14
    )
    np.testing.assert_allclose(
        model.grains.inertia, 0.4 * model.grains.mass * model.grains.radius**2, rtol=1e-14
    )
    assert model.shape_factor == 2.5


def test_motion():
    _, state = build(
        scenario("particles.0.velocity=[1, 2]", "particles.0.spin=3", "particles.0.shear_rate=10")
    )
    v, y = state.velocity, state.position[:, 1]
    np.testing.assert_allclose(v[:, 0], 1 + 10 * (y - 0.04), rtol=1e-13)
    np.testing.assert_array_equal(v[:, 1:], np.tile([2.0, -2.0], (200, 1)))


def test_laws_of_all_touching_pairs():
    extra = FLOOR + (
        '\n[[contacts]]\npair = ["glass", "steel"]\n'
        "friction = { speed = [0.0, 1.0], values = [0.5, 0.1] }\nrestitution = 0.7\n"
    )
    laws = build(scenario(extra=extra))[0].laws
    assert laws.friction[0, 0] == 0.4
    assert laws.table.tolist() == [[-1, 0], [0, -1]]
    assert laws.restitution.tolist() == [[0.0, 0.7], [0.7, 0.0]]
    assert laws.table_start.tolist() == [0, 2]
    assert laws.table_speed.tolist() == [0.0, 1.0]
    assert laws.table_friction.tolist() == [0.5, 0.1]


@pytest.mark.parametrize("kind", ["random", "deposited"])
def test_seed_decides_every_bit(kind):
    packing = f'particles.0.packing={{kind="{kind}"}}'
    one, again, other = (build(scenario(packing, f"scenario.seed={seed}"))[1] for seed in (5, 5, 6))
    assert one.digest() == again.digest()
    assert one.digest() != other.digest()


def test_wall_frames_start_at_their_reference_points():
    model, state = build(
        scenario(extra=FLOOR + wall("drum", 'kind = "circle", center = [0.03, 0.04], radius = 0.2'))
    )
    np.testing.assert_array_equal(state.wall_position, [[0, 0, 0], [0.03, 0.04, 0]])
    np.testing.assert_array_equal(model.shapes.geometry[1], [0, 0, 0.2, 0])
    assert model.walls.names == ("floor", "drum")


def test_periodic_lattice_on_a_floor_touches_it():
    model, state = build(
        scenario(LATTICE, EQUAL, "domain.periodic=true", "particles.0.count=600", extra=FLOOR)
    )
    assert model.period == 0.06
    assert np.all((state.position[:, 0] >= 0) & (state.position[:, 0] < 0.06))
    _, _, gap = pair_gaps(state.position, model.grains.radius, 1e-9, 0.06)
    assert gap.size == 600 + 2 * 570
    assert np.abs(gap).max() < 1e-16
    assert state.position[:30, 1] == pytest.approx([1e-3] * 30, rel=3e-16, abs=0.0)


def test_lattice_without_count_fills_the_region():
    model, _ = build(scenario(LATTICE, EQUAL, text=UNCOUNTED))
    assert model.grain_count > 0.85 * 0.06 * 0.08 / (np.pi * 1e-6) * 0.9


def test_fill_counts_the_area_of_the_region():
    text = changed(PACKED, ("count = 200", "fill = 0.5"))
    region = "particles.0.region={min=[0.0, 0.0], max=[0.06, 0.04]}"
    model, state = build(scenario(region, text=text))
    assert np.pi * (model.grains.radius**2).sum() == pytest.approx(0.5 * 0.06 * 0.04, rel=2e-3)
    assert (state.position[:, 1] + model.grains.radius).max() <= 0.04 + 1e-12


def test_later_group_is_piled_upon_the_earlier():
    extra = SECOND.replace('"random"', '"deposited"')
    model, state = build(scenario('particles.0.packing={kind="deposited"}', extra=extra))
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
    (tmp_path / "g.csv").write_text(
        "x,y,radius\n0.0002,0.01,1e-3\n0.0595,0.01,1e-3\n-0.03,0.02,1e-3\n"
    )
    text = changed(UNCOUNTED, ('sizes = { kind = "uniform", min = 0.8e-3, max = 1.2e-3 }\n', ""))

    def attempt(*more):
        loaded = scenario(
            'particles.0.packing={kind="file", path="g.csv"}',
            *more,
            text=text,
            path=tmp_path / "s.toml",
        )
        return build(loaded)

    _, state = attempt()
    assert state.position[2, 0] == pytest.approx(-0.03, rel=3e-16, abs=0.0)
    with pytest.raises(ScenarioError, match=r"grains 0 and 1 by 0\.0013 m"):
        attempt("domain.periodic=true")
    (tmp_path / "g.csv").write_text("x,y,radius\n-0.03,0.02,1e-3\n")
    assert attempt("domain.periodic=true")[1].position[0, 0] == pytest.approx(0.03)


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
    just = ['particles.0.packing={kind="lattice", lattice="square"}', EQUAL, "particles.0.count=30"]
    for depth, accepted in ((0.99e-6, True), (1.01e-6, False)):
        extra = wall("w", f'kind = "plane", point = [0.0, {depth}], normal = [0.0, 1.0]')
        if accepted:
            build(scenario(*just, extra=extra))
        else:
            assert problems(*just, extra=extra)[0].key == "walls.0"


def test_random_grains_keep_clear_of_walls():
    extra = (
        wall("plane", CUTS["plane"])
        + wall("line", CUTS["polyline"])
        + wall("rough", CUTS["rough"].replace("0.01]", "0.02]"))
    )
    model, _ = build(scenario(extra=extra))
    assert model.grain_count == 200


BEHIND = wall("w", 'kind = "rough", from = [0.0, 0.0795], to = [0.06, 0.0795], side = "left"')
BELOW = ("domain.periodic=true", "particles.0.region={min=[0.0, 0.0], max=[0.06, 0.07]}")
CROWDED = SECOND.replace("count = 100", "count = 6000").replace('"random"', '"deposited"')

# overrides, more tables, key and words of each problem
REFUSED = {
    "behind a rough wall": (BELOW, BEHIND, [("walls.0", "behind the rough wall 'w'")]),
    "too many": ((LATTICE, EQUAL, "particles.0.count=1500"), "", [("particles.0", "it holds 13")]),
    "too many in two groups": (
        (LATTICE, EQUAL, "particles.0.count=1500"),
        CROWDED,
        [("particles.0", "it holds 13"), ("particles.1", "the region is full")],
    ),
    "short period": (
        ("domain.periodic=true", "domain.size=[0.009, 0.5]", "particles.0.count=5"),
        "",
        [("particles.0.sizes", "four of the largest diameters")],
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_packings_are_refused_with_all_problems_at_their_keys(name):
    overrides, extra, expected = REFUSED[name]
    for problem, (key, words) in zip(problems(*overrides, extra=extra), expected, strict=True):
        assert problem.key == key
        assert words in problem.message


def test_grains_before_a_rough_wall_are_taken():
    build(scenario(*BELOW, extra=BEHIND.replace("left", "right")))


def tiled(source, repeat, *overrides):
    packing = (
        f'particles.0.packing={{kind="tile", source={{{source}}}, tile=[0.02, 0.02], '
        f"tile_fill=0.7, repeat={repeat}}}"
    )
    return build(scenario(packing, *overrides, text=UNCOUNTED))


def test_random_tile_closes_in_both_directions():
    model, state = tiled('kind="random"', [3, 4], "domain.periodic=true")
    assert smallest_gap(state.position, model.grains.radius, 0.06) > -1e-12
    fill = np.pi * (model.grains.radius**2).sum() / (0.06 * 0.08)
    assert 0.62 < fill < 0.7  # what sticks out at bottom and top is left out
    # Copies are congruent: the middle ones are whole.
    x, y = state.position[:, 0], state.position[:, 1]
    columns = [np.count_nonzero((x >= 0.02 * k) & (x < 0.02 * (k + 1))) for k in range(3)]
    assert columns[0] == columns[1] == columns[2]
    inner = [np.count_nonzero((y >= 0.02 * k) & (y < 0.02 * (k + 1))) for k in (1, 2)]
    assert inner[0] == inner[1]


def test_tile_in_a_bounded_region_stays_inside():
    model, state = tiled('kind="random"', [3, 1])
    x, r = state.position[:, 0], model.grains.radius
    assert np.all((x - r >= -1e-12) & (x + r <= 0.06 + 1e-12))


def test_tile_with_a_floor_is_not_stacked():
    with pytest.raises(ScenarioError, match="cannot be repeated in y"):
        tiled('kind="deposited"', [3, 2], "domain.periodic=true")


@pytest.mark.parametrize(
    ("periodic", "friction", "low", "high"), [("true", 0.5, 0.75, 0.82), ("false", 0.0, 0.8, 0.86)]
)
def test_compacted_packing_is_dense_and_carries_itself(periodic, friction, low, high):
    packing = f'{{kind="compacted", pressure=50.0, friction={friction}, kinetic_energy_ratio=1e-5}}'
    overrides = (
        f"particles.0.packing={packing}",
        f"domain.periodic={periodic}",
        "particles.0.count=300",
        "domain.size=[0.03, 0.06]",
    )
    model, state = build(scenario(*overrides))
    position, radius = state.position, model.grains.radius
    assert smallest_gap(position, radius, model.period) > -1e-3 * radius.min()
    assert not state.velocity.any()
    top = (position[:, 1] + radius).max()
    assert low < np.pi * (radius**2).sum() / (0.03 * top) < high
    i, _, _ = pair_gaps(position, radius, 1e-3 * radius.min(), model.period)
    assert i.size > 1.2 * radius.size  # held by contacts: more than two per grain


def test_pressure_of_a_compaction_does_not_matter_to_rigid_grains():
    results = []
    for pressure in (50.0, 200.0):
        packing = (
            f'particles.0.packing={{kind="compacted", pressure={pressure}, friction=0.5, '
            f"kinetic_energy_ratio=1e-4}}"
        )
        results.append(
            build(
                scenario(
                    packing,
                    "domain.periodic=true",
                    "particles.0.count=120",
                    "domain.size=[0.02, 0.04]",
                )
            )[1]
        )
    # A factor of four scales all times by an exact two, so not even rounding differs.
    np.testing.assert_array_equal(results[0].position, results[1].position)


def test_large_lattice():
    overrides = (
        LATTICE,
        'particles.0.sizes={kind="list", radii=[1e-4]}',
        "particles.0.count=100000",
        "domain.size=[0.06, 0.08]",
    )
    model, state = build(scenario(*overrides, extra=FLOOR))
    assert model.grain_count == 100_000
    assert math.isclose(state.position[:, 1].min(), 1e-4)


@pytest.mark.parametrize("packing", ['"random"', '"deposited"', '"lattice", lattice = "square"'])
@pytest.mark.parametrize("fill", [1e-6, 1e-4, 2e-4])
def test_a_fill_of_less_than_one_grain_is_refused(packing, fill):
    """The area is that of 1528 grains."""
    changes = (
        ("count = 200", f"fill = {fill}"),
        ('kind = "random"', f"kind = {packing}"),
        ("size = [0.06, 0.08]", "size = [0.06, 0.08]\ngravity = [0.0, -9.81]"),
    )
    with pytest.raises(
        ScenarioError,
        match=(
            rf"fill of {fill:g} is too small for grains of these sizes: 1 grain fill 0\.000\d+; "
            rf"give"
        ),
    ):
        build(scenario(text=changed(PACKED, *changes)))


def test_a_fill_of_some_grains_is_met_as_closely_as_they_can():
    for fill in (1e-3, 2e-3, 5e-3):
        model, _ = build(scenario(text=changed(PACKED, ("count = 200", f"fill = {fill}"))))
        assert np.pi * (model.grains.radius**2).sum() / (0.06 * 0.08) == pytest.approx(
            fill, abs=0.5 * np.pi * 1.2e-3**2 / (0.06 * 0.08)
        )
