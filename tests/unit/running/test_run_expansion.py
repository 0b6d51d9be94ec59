"""Runs of grains that expand: what their files hold, stops, and runs that go on from them."""

import numpy as np
import pytest
from run_fakes import in_pieces
from scenarios import digests, plane, scenario
from scenes import WARM, changed

import multicor_cli as multicor
from multicor_cli.post.energy import energy
from multicor_cli.store import run_info, verify

ALPHA = 2e-4
BED = changed(
    WARM, ("hardness = 2e9", f"hardness = 2e9\nexpansion = {ALPHA}"),
    ("coefficient = 5.0", "coefficient = 5e3"), ("temperature = 290.0", "temperature = 400.0"),
)  # fmt: skip
GLASS = {
    "density": 2500.0, "young": 70e9, "poisson": 0.22, "conductivity": 1.0, "heat_capacity": 80.0,
    "hardness": 1e6,
}  # fmt: skip


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bed")
    (folder / "bed.toml").write_text(BED, encoding="utf-8")
    multicor.run(folder / "bed.toml", folder / "run", threads=1)
    return folder


def test_files_hold_the_radii(bed):
    with multicor.open_run(bed / "run") as run:
        initial, start = run.model.grains.radius, np.asarray(run.frames[0].temperature)
        assert run.frames[0].radius.tolist() == initial.tolist()
        last = [frame for frame in run.frames if frame.stage == 0][-1]
        # Those of the temperatures with which the last step began
        grown = initial * (1.0 + ALPHA * (np.asarray(last.temperature) - start))
        assert (np.abs(last.radius - grown) < 1e-4 * initial).all()
        assert (last.radius > 1.001 * initial).all()
        assert last.model.grains.radius.tolist() == last.radius.tolist()
        assert list(last.to_pandas().columns).count("radius") == 1
        books = energy(run).books
        assert books["expansion_work"][-1] == run.series["expansion_work"][-1] > 0.0
    assert run_info(bed / "run")["energy_closure"] < 1e-12
    assert verify(bed / "run") == []


def test_stops_change_nothing(bed, tmp_path):
    assert in_pieces(bed / "bed.toml", tmp_path / "run", 7, 33) == digests(bed / "run")


def test_worn_grains_are_lighter_and_smaller_in_files(tmp_path):
    text = changed(
        WARM, ("wear = 1e-4", "wear = 1.0"), ("[heat]\n", "[heat]\nwear_shrinks = true\n")
    )
    (tmp_path / "worn.toml").write_text(text, encoding="utf-8")
    multicor.run(tmp_path / "worn.toml", tmp_path / "run", threads=1)
    with multicor.open_run(tmp_path / "run") as run:
        last, grains = run.frames[-1], run.model.grains
        left = 1.0 - last.wear / (4.0 / 3.0 * np.pi * grains.radius**3)
        assert last.wear.max() > 0.0
        np.testing.assert_allclose(last.radius, grains.radius * np.cbrt(left), rtol=1e-12)
        np.testing.assert_allclose(last.model.grains.mass, grains.mass * left, rtol=1e-14)
        assert energy(run).books["worn_energy"][-1] == run.series["worn_energy"][-1]
    assert run_info(tmp_path / "run")["energy_closure"] < 1e-11
    assert verify(tmp_path / "run") == []


def test_worn_grains_come_again_as_they_came_first(run):
    """A disc slides to an outlet that sends it back to wait: its second way is the first again, as
    all of its mass and size is. Books close.
    """
    a = 1e-3
    group = {
        "count": 1, "material": "glass", "shape": "disc", "thickness": 1e-3, "temperature": 300.0,
        "sizes": {"kind": "list", "radii": [a]}, "velocity": [3.0, 0.0],
        "release": {"rate": 100.0, "region": {"min": [1e-3, 0.0], "max": [3.5e-3, 2.2e-3]}},
    }  # fmt: skip
    outlet = {"name": "end", "region": {"min": [0.05, -0.01], "max": [0.2, 0.1]}}
    made = run(scenario(
        particles=[group], materials={"glass": GLASS}, size=[0.2, 0.1],
        contacts=[{"pair": ["*", "*"], "friction": 0.5, "wear": 0.3}],
        outlets=[outlet | {"then": "release"}],
        heat={"temperature": 300.0, "conduction": "none", "wear_shrinks": True},
        duration=0.045, dt=2e-4, frame_interval=2e-4,
    ))  # fmt: skip
    x, wear = (
        np.array([getattr(f, of)[0, ...].flat[0] for f in made.frames if len(f.position)])
        for of in ("position", "wear")
    )
    ends = np.flatnonzero(np.diff(x) < -0.01)
    assert ends.size == 2
    first, second = wear[ends]
    assert first > 1e-4 * np.pi * a**2 * 1e-3
    assert wear[ends + 1].max() < 0.1 * first
    assert second == pytest.approx(first, rel=0.03)  # it comes a little nearer to the outlet
    series = made.series
    assert series["closure"][-1] < 1e-12
    assert series["mass_closure"][-1] < 1e-14


@pytest.mark.parametrize("expands", [True, False])
def test_another_run_goes_on_with_the_radii(bed, tmp_path, expands):
    """As they are, whether they go on growing or not."""
    text = BED if expands else BED.replace(f"expansion = {ALPHA}", "")
    particles, walls, loading, solver = map(
        text.index, ("[[particles]]", "[[walls]]", "[[loading]]", "[solver]")
    )
    more = f'[start]\nrun = "{(bed / "run").as_posix()}"\n[[loading]]\nduration = 0.002\n'
    text = text[:particles] + text[walls:loading] + more + text[solver:]
    (tmp_path / "more.toml").write_text(text, encoding="utf-8")
    multicor.run(tmp_path / "more.toml", tmp_path / "more", threads=1)
    with multicor.open_run(bed / "run") as run, multicor.open_run(tmp_path / "more") as more:
        first, last = more.frames[0].model.grains.radius, run.frames[-1].radius
        assert first.tolist() == last.tolist()
        assert (more.frames[-1].radius is not None) == expands
    assert run_info(tmp_path / "more")["max_overlap"] < 1e-3


@pytest.mark.parametrize("moment", [{"at": "end"}, {"frame": -1}])
@pytest.mark.parametrize("expansion", [0.0, 1e-3])
def test_another_run_goes_on_with_what_is_left_of_worn_grains(expansion, moment, run):
    """A disc slides, wears and is heated: two runs, the second from the end of the first or from
    its last frame, come to what one does, whether it expands or not.
    """
    a = 1e-3
    told = {
        "materials": {"glass": GLASS | ({"expansion": expansion} if expansion else {})},
        "size": [1.0, 0.1], "contacts": [{"pair": ["*", "*"], "friction": 0.5, "wear": 0.5}],
        "walls": {"floor": plane()}, "dt": 1e-4, "frame_interval": 0.05,
        "heat": {"temperature": 300.0, "conduction": "none", "wear_shrinks": True},
    }  # fmt: skip
    grains = [[0.02, a, a, 9.0, 0.0, 0.0]]
    uncut = run(scenario(grains=grains, duration=0.1, **told), "uncut")
    first = run(scenario(grains=grains, duration=0.05, **told), "first")
    group = {"name": "grains", "material": "glass", "shape": "disc", "thickness": 1e-3}
    second = run(scenario(
        particles=[group | {"packing": {"kind": "start"}}], start={"run": str(first.path)} | moment,
        duration=0.05, **told,
    ), "second")  # fmt: skip
    here, there = second.frames[0], first.frames[-1]
    assert here.model.grains.mass == pytest.approx(there.model.grains.mass, rel=1e-12)
    assert second.series["kinetic_start"][-1] == pytest.approx(first.series["kinetic"][-1])
    last, whole = second.frames[-1], uncut.frames[-1]
    assert whole.wear[0] > 5e-3 * np.pi * a**2 * 1e-3
    assert last.radius == pytest.approx(whole.radius, rel=1e-12)
    assert last.model.grains.mass == pytest.approx(whole.model.grains.mass, rel=1e-12)
    assert last.velocity[0, 0] == pytest.approx(whole.velocity[0, 0], rel=1e-10)
    assert last.temperature == pytest.approx(whole.temperature, rel=1e-12)
    assert last.wear == pytest.approx(whole.wear, rel=1e-12)
    assert second.series["closure"][-1] < 1e-11


@pytest.mark.parametrize(("before", "after"), [
    ({"expansion": 1e-2, "sheds": True}, {"expansion": 1e-2}),
    ({"expansion": 1e-2, "sheds": True}, {"sheds": True}),
    ({"expansion": 1e-2, "sheds": True}, {}),
    ({"expansion": 1e-2, "sheds": True}, {"expansion": 5e-3, "sheds": True}),
    ({"expansion": 1e-2, "sheds": True}, {"expansion": 1e-2, "sheds": True, "capacity": 160.0}),
    ({"expansion": 1e-2, "sheds": True}, {"expansion": 1e-2, "sheds": True, "density": 5000.0}),
    ({"expansion": 1e-2}, {"expansion": 1e-2, "temperature": 500.0}),
    ({}, {"expansion": 1e-2}),
])  # fmt: skip
@pytest.mark.parametrize("moment", [{"at": "end"}, {"frame": -1}])
def test_grains_stay_as_large_and_heavy_whatever_their_law_becomes(before, after, moment, run):
    """A disc slides and warms; then nothing heats it any more, and it stays as it is."""
    a = 1e-3

    def told(friction, expansion=None, sheds=False, capacity=80.0, density=2500.0, **_):
        glass = GLASS | {"heat_capacity": capacity, "density": density}
        return {
            "materials": {"glass": glass | ({"expansion": expansion} if expansion else {})},
            "size": [10.0, 0.1], "walls": {"floor": plane()}, "dt": 1e-4, "frame_interval": 0.02,
            "contacts": [{"pair": ["*", "*"], "friction": friction, "wear": friction or 1e-12}],
            "heat": {"temperature": 300.0, "conduction": "none", "wear_shrinks": sheds},
        }  # fmt: skip

    grains = [[0.02, a, a, 90.0, 0.0, 0.0]]
    first = run(scenario(grains=grains, duration=0.04, **told(0.5, **before)), "first")
    group = {
        "name": "grains", "material": "glass", "shape": "disc", "thickness": 1e-3,
        "packing": {"kind": "start"},
    }  # fmt: skip
    if "temperature" in after:
        group["temperature"] = after["temperature"]
    second = run(scenario(
        particles=[group], start={"run": str(first.path)} | moment, duration=0.02,
        **told(0.0, **after),
    ), "second")  # fmt: skip
    was, last = first.frames[-1], second.frames[-1]
    warmth = after.get("temperature", was.temperature[0])
    assert was.temperature[0] > 300.1
    assert last.temperature[0] == pytest.approx(warmth, rel=1e-12)
    weight = was.model.grains.mass[0] * after.get("density", 2500.0) / 2500.0
    assert last.model.grains.mass[0] == pytest.approx(weight, rel=1e-9)
    # It has not yet expanded by what the last step has warmed it
    assert last.model.grains.radius[0] == pytest.approx(was.model.grains.radius[0], rel=2e-5)


def test_stops_change_nothing_where_grains_wear_off(tmp_path, run):
    """What the solver's residuals are measured against goes by the mass that is left."""
    ways = {"y": {"stress": -100.0, "damping": 0.1}, "x": {"velocity": 0.5}}
    lid = {"from": [0.0, 0.02], "to": [0.01, 0.02], "side": "right"}
    floor = {"from": [0.0, 0.0], "to": [0.01, 0.0], "side": "left"}
    told = scenario(
        size=[0.01, 0.02], periodic=["x"], gravity=[0.0, 0.0], grains={"count": 25},
        materials={"glass": GLASS | {"hardness": 5e6}},
        walls={
            name: {"kind": "rough", "sizes": "grains"} | line
            for name, line in (("floor", floor), ("lid", lid))
        },
        contacts=[{"pair": ["*", "*"], "friction": 0.5, "wear": 1.0}],
        heat={"conduction": "none", "wear_shrinks": True}, dt=2e-4, frame_interval=0.05,
        loading=[{"duration": 0.12, "drives": {"lid": ways}}],
    )  # fmt: skip
    whole = run(told)
    left = (whole.frames[-1].radius ** 2).sum() / (whole.frames[0].radius ** 2).sum()
    assert left < 0.99
    assert in_pieces(told, tmp_path / "cut", *range(200, 600, 25)) == digests(whole.path)
