"""Packings in a cell: periodic in both directions, without walls; and what becomes of velocities."""

from types import SimpleNamespace

import numpy as np
import pytest
from cut_runs import CELL
from scenarios import engine, scenario
from scenes import changed

import multicor_cli as multicor
from multicor_cli.arithmetic.sums import total
from multicor_cli.model.cell import mean_flow, real_velocity
from multicor_cli.packing import build, place
from multicor_cli.packing.other_run import read_source
from multicor_cli.packing.overlap import Groups, overlap_problems
from multicor_cli.packing.walls import Obstacles
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.problems import ScenarioError

SIZE = (0.03, 0.024)
IN_CELL = {"size": list(SIZE), "periodic": ["x", "y"], "gravity": [0.0, 0.0], "walls": []}


def gaps(position, radius, cell=(*SIZE, 0.0)):
    """Gaps of all pairs in a cell of this width, height and tilt [m]."""
    width, height, tilt = cell
    away = position[:, None, :2] - position[None, :, :2]
    images = np.round(away[..., 1] / height)
    away -= images[..., None] * np.array([tilt, height])
    away[..., 0] -= width * np.round(away[..., 0] / width)
    gap = np.hypot(away[..., 0], away[..., 1]) - radius[:, None] - radius[None, :]
    return gap[~np.eye(radius.size, dtype=bool)]


def built(**said):
    if isinstance(said.get("grains"), dict):
        said["grains"] = {"sizes": {"kind": "list", "radii": [1e-3]}, **said["grains"]}
    return build(scenario(**{**IN_CELL, **said}))


def test_the_cell_is_the_one_wall():
    for domain, factor in ({}, 1.0), ({"cell_inertia": 0.01}, 0.01):
        tables = {key: IN_CELL[key] for key in ("size", "periodic", "gravity")}
        model, state = built(grains=50, domain={**tables, **domain})
        inertia = factor * total(model.grains.mass) * model.mean_diameter**2
        assert (model.walls.names, model.shape_count, model.is_cell) == (("cell",), 0, True)
        assert (model.walls.mass[0], model.walls.inertia[0]) == pytest.approx((inertia, inertia))
        assert (model.period, model.height) == SIZE
        assert state.wall_position.tolist() == [[*SIZE, 0.0]]
        assert not state.wall_velocity.any()


PACKINGS = {
    "dilute": {"fill": 0.3, "packing": {"kind": "random"}},
    "dense": {"fill": 0.8, "packing": {"kind": "random"}},
    "apart": {"fill": 0.4, "packing": {"kind": "random", "separation": 0.2}},
    "triangular": {"packing": {"kind": "lattice", "lattice": "triangular"}},
    "square": {"packing": {"kind": "lattice", "lattice": "square", "spacing": 2.1e-3}},
    "tiles": {"packing": {"kind": "tile", "source": {"kind": "random"}, "tile": [0.015, 0.024],
        "tile_fill": 0.75, "repeat": [2, 1]}},
    "a half": {"fill": 0.6, "packing": {"kind": "random"},
        "region": {"min": [0.0, 0.012], "max": [0.03, 0.024]}},
    "a disc": {"fill": 0.5, "packing": {"kind": "random"},
        "region": {"kind": "circle", "center": [0.015, 0.012], "radius": 0.01}},
}  # fmt: skip


@pytest.mark.parametrize("name", PACKINGS)
def test_no_grain_meets_an_image(name):
    model, state = built(grains=PACKINGS[name])
    radius, position = model.grains.radius, state.position
    assert ((position[:, :2] >= 0.0) & (position[:, :2] < SIZE)).all()
    assert gaps(position, radius).min() >= -1e-9 * radius.min()
    if "region" not in PACKINGS[name] and name not in ("triangular", "square"):
        assert (position[:, 1] < radius).any()  # no floor


def test_rows_of_a_lattice_are_opened_to_close_both_periods():
    """Of 15.2 rows that touch across the rows there are 14, an even number; of 13.2 square 13."""
    for kind, rows, columns in ("triangular", 14, 15), ("square", 13, 15):
        model, state = built(
            size=[0.0305, 0.0262], grains={"packing": {"kind": "lattice", "lattice": kind}}
        )
        assert model.grain_count == rows * columns
        heights = np.unique(state.position[:, 1].round(12))
        np.testing.assert_allclose(np.diff([*heights, heights[0] + 0.0262]), 0.0262 / rows)
        assert gaps(state.position, model.grains.radius, (0.0305, 0.0262, 0.0)).min() > -1e-12


def test_later_groups_keep_clear_of_the_images_of_earlier_ones():
    large = {"name": "large", "count": 6, "sizes": {"kind": "list", "radii": [2.9e-3]}}
    small = {"name": "small", "fill": 0.35, "sizes": {"kind": "list", "radii": [6e-4]}}
    both = [{**group, "packing": {"kind": "random"}} for group in (large, small)]
    model, state = built(particles=both)
    assert gaps(state.position, model.grains.radius).min() >= -1e-9 * 6e-4


def test_grains_of_a_file_are_brought_into_the_cell():
    _, state = built(grains=[[-0.001, 0.025, 1e-3], [0.061, -0.0005, 1e-3], [0.01, 0.01, 1e-3]])
    np.testing.assert_allclose(
        state.position[:, :2], [[0.029, 0.001], [0.001, 0.0235], [0.01, 0.01]], atol=1e-15
    )


@pytest.mark.parametrize("rows", [
    [[0.01, 0.0005, 1e-3], [0.0105, 0.0238, 1e-3]], [[0.0001, 0.02395, 1e-3], [0.0299, 0.0, 1e-3]],
])  # fmt: skip
def test_overlaps_across_the_height_are_refused(rows):
    with pytest.raises(ScenarioError, match=r"grains [12] and [12] of 'grains' by"):
        built(grains=[*rows, [0.02, 0.012, 1e-3]])


def test_grains_larger_than_a_fourth_of_the_height_are_refused():
    with pytest.raises(
        ScenarioError, match=r"the period 0\.0079 m is less than four of the largest"
    ):
        built(grains=[[0.01, 0.001, 1e-3]], size=[0.03, 0.0079])


def test_velocities_are_those_that_are_given():
    """At first the mean flow is none."""
    model, state = built(
        grains={
            "count": 40,
            "packing": {"kind": "random"},
            "velocity": [0.1, 0.2],
            "shear_rate": 2.0,
        }
    )
    y = state.position[:, 1] - 0.012
    np.testing.assert_allclose(state.velocity[:, 0], 0.1 + 2.0 * y)
    assert (real_velocity(model, state) == state.velocity).all()
    assert model.start_speed == pytest.approx(
        np.hypot(state.velocity[:, 0], state.velocity[:, 1]).max()
    )


RATES = {"xx": -0.5, "yy": 2.0, "xy": 10.0}
GRADIENT = np.array([-0.5, 2.0, 10.0])
PLACES = np.array([[0.003, 0.021], [0.029, 0.001], [0.001, 0.012], [0.04, 0.03]])
"""The last one is outside: its image there is faster than the one in the cell."""


def moving(tmp_path, names, velocity, group=None, rates=RATES):
    """A cell that begins with rates, and grains of a file with these columns of velocities."""
    file = tmp_path / "grains.csv"
    rows = np.column_stack([PLACES, np.full(len(PLACES), 1e-3), velocity])
    np.savetxt(file, rows, delimiter=",", header=f"x,y,radius,{names}", comments="")
    domain = {key: IN_CELL[key] for key in ("size", "periodic", "gravity")}
    packing = {"kind": "file", "path": str(file)}
    grains = {"packing": packing, **({} if group is None else group)}
    return build(scenario(domain={**domain, "cell_rates": rates}, grains=grains, walls=[]))


def test_real_velocities_hold_the_flow_with_which_a_cell_begins(tmp_path):
    own = np.array([[0.01, 0.0], [0.0, -0.02], [0.03, 0.01], [0.0, 0.04]])
    velocity = own + mean_flow(PLACES, GRADIENT)
    model, state = moving(tmp_path, "vx,vy", velocity)
    assert state.wall_velocity.tolist() == [list(RATES.values())]
    np.testing.assert_allclose(state.velocity[:, :2], own, atol=1e-15)
    np.testing.assert_allclose(real_velocity(model, state)[:3, :2], velocity[:3], atol=1e-15)
    assert model.start_speed == pytest.approx(0.04)


def test_peculiar_velocities_are_those_beside_it(tmp_path):
    own = np.array([[0.01, 0.0], [0.0, -0.02], [0.03, 0.01], [0.0, 0.04]])
    _, state = moving(tmp_path, "peculiar_vx,peculiar_vy", own)
    np.testing.assert_array_equal(state.velocity[:, :2], own)
    _, state = moving(tmp_path, "peculiar_vx,peculiar_vy", own, {"velocity": [1.0, 0.0]})
    np.testing.assert_array_equal(state.velocity[:, :2], own + np.array([1.0, 0.0]))


def test_grains_whose_velocity_is_not_given_move_with_it(tmp_path):
    _, state = moving(tmp_path, "spin", [3.0] * 4)
    assert state.velocity.tolist() == [[0.0, 0.0, 3.0]] * 4
    _, state = moving(tmp_path, "spin", [3.0] * 4, {"velocity": [0.0, 0.0]})
    np.testing.assert_allclose(state.velocity[:, :2], -mean_flow(PLACES, GRADIENT))


def test_a_flow_goes_on_from_its_first_step(tmp_path):
    """Else the first half of it would be at rest."""
    grains = [[*place, 1e-3] for place in PLACES[:3].tolist()]
    loading = {"duration": 1.0, "cell": {"xy": {"rate": 10.0}}}
    domain = {key: IN_CELL[key] for key in ("size", "periodic", "gravity")}
    for rates, strain in ({"xy": 10.0}, 30e-4), ({}, 25e-4):
        stepper, _ = engine(
            scenario(
                domain={**domain, "cell_rates": rates}, grains=grains, loading=[loading], walls=[]
            )
        )
        for k in range(3):
            stepper.step(1e-4, 1e-4 * k)
        assert stepper.state.wall_position[0, 2] == pytest.approx(strain * SIZE[1])


WRONG_VELOCITIES = {
    "both": ("vx,peculiar_vy", IN_CELL["periodic"], "and real ones"),
    "no cell": ("peculiar_vx,peculiar_vy", True, "which only a cell has"),
}


@pytest.mark.parametrize("name", WRONG_VELOCITIES)
def test_velocities_that_mean_nothing_are_refused(name, tmp_path):
    columns, periodic, words = WRONG_VELOCITIES[name]
    (tmp_path / "g.csv").write_text(f"x,y,radius,{columns}\n0.01,0.01,1e-3,0.1,0.2\n")
    packing = {"kind": "file", "path": str(tmp_path / "g.csv")}
    with pytest.raises(ScenarioError, match=words):
        build(scenario(**{**IN_CELL, "periodic": periodic, "grains": {"packing": packing}}))


def start(folder, *changes):
    head, tail = CELL.split("[[particles]]")
    text = (
        f'{head}[start]\nrun = "{folder}"\nframe = 7\n[[loading]]{tail.split("[[loading]]", 1)[1]}'
    )
    return parse_scenario(changed(text, *changes), "cell.toml")


def test_a_cell_goes_on_as_it_is(sheared):
    """Its sides, and velocities relative to its mean flow; frames have the real ones."""
    placed = place(start(sheared))
    model, state = placed.model, placed.state
    with multicor.open_run(sheared) as run:
        frame = run.frames[7]
        assert state.wall_position.tolist() == frame.wall_position.tolist()
        assert (model.period, model.height) == tuple(frame.wall_position[0, :2])
        assert abs(frame.wall_position[0, 2]) > 1e-3
        assert abs(frame.wall_velocity[0, 2] - 40.0) < 1e-9
        np.testing.assert_allclose(real_velocity(model, state)[:, :2], frame.velocity, atol=1e-15)
        flow = mean_flow(state.position, frame.wall_velocity[0])
        np.testing.assert_allclose(state.velocity[:, :2] + flow, frame.velocity, atol=1e-15)
    assert gaps(state.position, model.grains.radius, state.wall_position[0]).min() > -1e-3 * 4e-4


MISFITS = {
    "another size": (("size = [0.012, 0.01]", "size = [0.012, 0.011]"), "domain.size", "0.012 × 0.01 m"),
    "no cell": (('periodic = ["x", "y"]', "periodic = true"), "domain.periodic", "is a cell"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISFITS)
def test_another_cell_is_refused(name, sheared):
    change, key, words = MISFITS[name]
    changes = [change]
    if name == "no cell":
        changes += [(line, "") for line in CELL.splitlines() if line.startswith("cell =")]
    with pytest.raises(ScenarioError, match=words) as caught:
        place(start(sheared, *changes))
    assert [problem.key for problem in caught.value.problems] == [key]


def test_overlaps_in_a_tilted_cell_are_found(sheared):
    """One grain is where the image of another is."""
    source = read_source(start(sheared))
    state = source.state
    width, height, tilt = state.wall_position[0].tolist()
    lowest = int(state.position[:, 1].argmin())
    highest = int(state.position[:, 1].argmax())
    position = state.position.copy()
    position[highest, :2] = (position[lowest, 0] + tilt) % width, height - 1e-4
    here = np.arange(len(position))
    cell = state.wall_position[0]
    groups = Groups([SimpleNamespace(packing=None, name="g")], source.model.grains.group)
    rest = (source.model, Obstacles.none(), here, groups, cell)
    assert overlap_problems(state.position, *rest) == []
    (problem,) = overlap_problems(position, *rest)
    assert f"{lowest}" in problem.what
    assert f"{highest}" in problem.what
