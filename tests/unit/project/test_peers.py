"""The benchmark with other codes: what can be checked without them, and short runs where they are
installed."""

import subprocess
import sys

import numpy as np
import pytest
from benchmark_modules import benchmark_modules
from places import ROOT


@pytest.fixture(scope="module", autouse=True)
def peers():
    with benchmark_modules("peers") as modules:
        yield modules


ROW = 2e-3 * np.arange(8)


def between(peers, x, y, glued, height, **others):
    """Rows of eight grains between glued ones."""
    bottom, top = (
        peers.case.Glued(np.column_stack([glued, np.full(8, y)]), np.full(8, 1e-3))
        for y in (0.0, height)
    )
    position, n = np.column_stack([np.tile(x, len(y)), np.repeat(y, 8)]), 8 * len(y)
    of_all = (position, np.zeros((n, 3)), np.full(n, 1e-3), 2500.0, 0.5, bottom, top, 16e-3)
    return peers.case.Layer(*of_all, rise=0.0, load=0.16, height=height, **others)


@pytest.fixture
def layer(peers):
    """Three rows of flowing grains, in contact."""
    x, y = ROW + 1e-3, 2e-3 * np.arange(1, 4)
    return between(peers, x, y, x, 8e-3, speed=0.1, wall_mass=1e-3, wall_damping=0.1)


@pytest.fixture
def nested(peers):
    """Eight grains in the hollows of the glued rows."""
    x, rise = ROW + 5e-4, 3.0**0.5 * 1e-3
    slow = {"speed": 1e-9, "wall_mass": 1e-2, "wall_damping": 600.0}
    return between(peers, x + 1e-3, np.array([rise]), x, 2.0 * rise, **slow)


def test_numbers_of_the_layer(layer):
    assert layer.pressure == pytest.approx(10.0)
    assert layer.tau == pytest.approx((2500.0 * 4.0 / 3.0 * np.pi * 1e-9 / 10.0) ** 0.5)
    assert layer.inertial == pytest.approx(0.1 / 8e-3 * layer.tau)
    assert layer.duration(2.0) == pytest.approx(0.16)


@pytest.mark.parametrize("restitution", [0.1, 0.6])
def test_soft_contact_has_its_restitution_and_duration(peers, restitution):
    """Two equal grains collide, integrated here."""
    mass = np.full(4, 1e-5)
    contact = peers.case.soft_contact(1e4, 0.5, mass, restitution)
    effective, overlap, speed, time = 0.5e-5, 0.0, 1.0, 0.0
    dt = contact.collision / 20_000
    while overlap >= 0.0:
        speed -= dt * (contact.stiffness * overlap / effective + contact.damping * speed)
        overlap += dt * speed
        time += dt
    assert -speed == pytest.approx(restitution, rel=2e-3)
    assert time == pytest.approx(contact.collision, rel=2e-3)


def test_area_of_discs_between_heights(peers):
    radius, y = np.array([1.0, 1.0, 0.5]), np.array([0.0, 5.0, 2.0])
    whole = peers.measure.fraction_between(y, radius, -10.0, 10.0, 3.0) * 60.0
    assert whole == pytest.approx(np.pi * 2.25)
    assert peers.measure.fraction_between(y, radius, 0.0, 10.0, 3.0) * 30.0 == pytest.approx(
        np.pi * 1.75
    )
    band = peers.measure.fraction_between(np.zeros(1), np.ones(1), -0.5, 0.5, 1.0)
    x = np.linspace(-0.5, 0.5, 100_001)
    assert band == pytest.approx(2.0 * np.trapezoid(np.sqrt(1.0 - x * x), x), rel=1e-8)


def test_overlaps_across_the_period_and_not_among_glued_grains(peers):
    position = np.array([[0.05, 0.0], [9.9, 0.0], [4.0, 0.0], [4.15, 0.0]])
    radius = np.array([0.1, 0.1, 0.1, 0.1])
    found = peers.measure.overlaps_of(position, radius, 10.0, 2)
    assert found == pytest.approx([0.5])  # gap 0.15 - 0.2 over 0.1; the last two are glued
    assert peers.measure.overlaps_of(position, radius, 10.0, 3).size == 2


def test_friction_and_its_error_from_blocks(peers):
    generator = np.random.default_rng(5)
    below = np.full(4000, 2.0)
    found = peers.measure.ratio_of_blocks(0.6 + 0.1 * generator.normal(size=4000), below)
    assert found.mean == pytest.approx(0.3, abs=5.0 * 0.05 / 4000**0.5)
    assert 0.3 < found.error / (0.05 / 4000**0.5) < 2.0
    assert np.isnan(peers.measure.ratio_of_blocks(np.ones(3), np.ones(3)).error)


def test_measures_of_a_known_flow(peers, layer):
    y = layer.position[:, 1]
    position = np.concatenate([layer.position, layer.bottom.position, layer.top.position])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("measure.SKIPPED", 0.6)  # the layer is thin
        assert peers.measure.bulk_rate(layer, position, 3.0 * y) == pytest.approx(3.0)
        force = np.array([[-0.3, 1.0]] * 20)
        frames = peers.case.Frames(np.array([position] * 20), np.array([3.0 * y] * 20), force)
        found = peers.measure.measure_flow(layer, [frames])
    assert found.friction.mean == pytest.approx(0.3)
    assert found.friction.error == pytest.approx(0.0, abs=1e-12)
    assert found.inertial.mean == pytest.approx(3.0 * layer.tau)
    assert found.solid.mean == pytest.approx(np.pi / 4.0, abs=0.03)
    assert found.max_overlap < 1e-9


def test_grains_are_written_with_all_digits(peers, layer, tmp_path):
    peers.gran_shear.write_layer(tmp_path / "grains.data", layer)
    lines = (tmp_path / "grains.data").read_text().splitlines()
    atoms = np.array([line.split() for line in lines[lines.index("Atoms") + 2 :][:40]], float)
    assert np.array_equal(atoms[:, 0], np.arange(1, 41))
    assert np.array_equal(atoms[:24, 4:6], layer.position)
    mass = atoms[:, 3] * np.pi / 6.0 * atoms[:, 2] ** 3
    assert mass[32:].sum() == pytest.approx(layer.wall_mass)
    assert mass[:24] == pytest.approx(layer.mass)
    speeds = np.array([line.split() for line in lines[lines.index("Velocities") + 2 :]], float)
    assert np.array_equal(speeds[32:, 1], np.full(8, 0.1))
    assert not speeds[:32, 1:].any()


def test_scripts_name_the_same_contact(peers, layer):
    contact = peers.case.soft_contact(1e5, 0.5, layer.mass, 0.1)
    for dialect in (peers.lammps.LAMMPS, peers.liggghts.LIGGGHTS):
        for style in dialect.styles:
            text = "\n".join(peers.gran_shear.layer_lines(
                dialect, layer, contact, peers.gran.Tuning(style, 0.2, (1, 1)), 1e-6,
            ))  # fmt: skip
            for value in (contact.stiffness, contact.tangential, contact.damping, contact.friction):
                assert f" {value!r}" in text
            assert "fix load top aveforce NULL -0.02 NULL" in text


def test_logs_and_dumps_are_read(peers, tmp_path):
    loops = peers.gran.parse_loops(
        "Loop time of 1.5 on 2 procs for 300 steps with 9 atoms\nx\n"
        "Loop time of 2e-3 on 2 procs for 7 steps\n"
    )
    assert [(loop.seconds, loop.steps) for loop in loops] == [(1.5, 300), (2e-3, 7)]
    box = "ITEM: BOX BOUNDS pp ff ff\n0 1\n0 1\n0 1\n"
    head, rows = (
        "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n2\n",
        "ITEM: ATOMS id x y\n2 {} 4\n1 5 6\n",
    )
    frame = f"{head}{box}{rows}"
    (tmp_path / "d").write_text(frame.format(0, 3) + frame.format(5, 7))
    first, second = peers.gran.read_dump(tmp_path / "d", 2).tolist()
    assert (first, second) == ([[5.0, 6.0], [3.0, 4.0]], [[5.0, 6.0], [7.0, 4.0]])
    (tmp_path / "a").write_text("# Time-averaged data\n# TimeStep v\n10 -1 2\n20 -3 4\n")
    assert peers.gran.read_averages(tmp_path / "a").tolist() == [[-1.0, 2.0], [-3.0, 4.0]]


def test_the_best_of_each_choice_is_taken(peers):
    tried = peers.gran.candidates(peers.lammps.LAMMPS, 2)
    best = peers.gran.Tuning("granular", 0.4, (2, 1))
    times = {
        t: (t.style != best.style) + (t.skin != best.skin) + (t.grid != best.grid) for t in tried
    }
    assert peers.gran.choose(times) == best


@pytest.fixture
def small_problem(peers):
    from multicor_cli.engine import ContactProblem

    # Two discs on a floor (body 2): both fall and the upper one slides.
    lever = np.array([[[0.0, -1.0], [0.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])
    problem = ContactProblem(
        inverse_mass=np.array([[1.0, 1.0, 2.0], [0.5, 0.5, 1.0], [0.0, 0.0, 0.0]]),
        velocity=np.array([[0.0, -1.0, 0.0], [3.0, -1.0, 0.0], [0.0, 0.0, 0.0]]),
        pair=np.array([[0, 2], [1, 0]]),
        normal=np.array([[0.0, 1.0], [0.0, 1.0]]),
        lever=lever,
        bias=np.zeros(2),
        friction=np.array([0.5, 0.3]),
    )
    return problem, peers.problems.as_matrix(problem)


def test_the_matrix_is_that_of_the_problem(small_problem):
    problem, matrix = small_problem
    delassus = problem.delassus()
    dense = matrix.matrix.toarray()
    assert np.allclose(dense, dense.T)
    assert np.allclose(dense.diagonal(), delassus[:, [0, 2]].ravel())
    assert dense[0, 2] == pytest.approx(-1.0)  # both push body 0, from opposite sides
    assert matrix.scale == pytest.approx(1.0)


def test_the_common_error_vanishes_for_the_solution_alone(peers, small_problem):
    from multicor_cli.engine import Settings, solve_contacts

    problem, matrix = small_problem
    tight = Settings(tolerance_rms=1e-12, tolerance_max=1e-11, tolerance_energy=1e-12)
    impulse = solve_contacts(problem, tight).impulse
    assert peers.residual.natural_error(matrix, impulse) < 1e-9
    assert peers.residual.natural_error(matrix, 1.01 * impulse) > 1e-3
    assert peers.residual.natural_error(matrix, np.zeros((2, 2))) > 0.1


def test_problems_survive_a_file(peers, tmp_path, small_problem):
    _, matrix = small_problem
    path = str(tmp_path / "p.npz")
    peers.residual.save_problem(path, matrix, np.zeros(4), 1e-3, 1.0)
    again = peers.residual.load_problem(path)
    impulse = np.array([1.0, 0.1, 0.5, 0.0])
    assert peers.residual.natural_error(again, impulse) == peers.residual.natural_error(
        matrix, impulse
    )


def test_tables_give_medians_and_ranges(peers):
    assert peers.table.median([3.0, 1.0, 2.0, 9.0]) == 2.5
    assert peers.table.spread([3.0, 1.0, 2.0]) == "2 [1, 3]"
    assert peers.table.spread([4.0]) == "4"
    assert peers.table.draw(["a", "bc"], [["x", "1"]]).splitlines() == ["a  bc", "-  --", "x   1"]


@pytest.mark.parametrize("name", ["liggghts", "lammps", "yade"])
def test_a_loaded_wall_rests_where_the_springs_say(peers, name, tmp_path, nested):
    """Each of 2 × 16 contacts at 30° carries its share of the load through both of its springs."""
    others = () if name == "yade" else peers.peers.find_peers([name], None, 1, 15.0)[0]
    peer = peers.peers.find_yade(1, 15.0) if name == "yade" else next(iter(others), None)
    if peer is None:
        pytest.skip(f"{name} is not installed")
    contact = peers.case.soft_contact(1e5, 0.5, nested.mass, 0.1)
    # 24 ms; the wall sinks in 1 ms, so slowly that nothing slips
    still = peers.case.FlowPlan(settle=6e-9, strain=1e-9, between=1e-9)
    run = peer.prepare_shear(nested, contact, still, tmp_path)[0](nested)
    y = run.frames.position[-1, :, 1]
    sunk = nested.height - (y[-8:] - y[8:16]).mean()
    each = nested.load / 16 / (0.75 * contact.stiffness + 0.25 * contact.tangential)
    assert run.frames.wall_force[-1, 1] == pytest.approx(nested.load, rel=1e-4)
    assert sunk == pytest.approx(2.0 * each, rel=1e-4)


def test_it_says_what_it_can_do():
    command = [sys.executable, "benchmarks/peers", "--help"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "--kappa" in done.stdout
