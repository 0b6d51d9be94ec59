"""Runs with adhesion and rolling resistance: books of energy and heat, frames, files, stopping,
keys without effect."""

import re

import numpy as np
import pytest
from run_fakes import in_pieces
from scenarios import digests
from scenes import SMALL, WARM

import multicor_cli as multicor
from multicor_cli.export import ExportError, export_fclib
from multicor_cli.packing import build
from multicor_cli.post import force_network
from multicor_cli.scenario import ScenarioError, parse_scenario
from multicor_cli.store import run_info
from multicor_cli.store.results import model_digest

LAWS = "wear = 1e-4\nadhesion = 2e-4\nrolling_friction = 0.2"
"""Five weights of a grain."""

STEEL = """\
[materials.steel]
density = 7800.0

[[contacts]]
pair = ["glass", "steel"]
friction = 0.1
adhesion = 3.0
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("laws") / "laws.toml"
    path.write_text(WARM.replace("wear = 1e-4", LAWS).replace("heat = false\n", ""))
    return path


@pytest.fixture(scope="module")
def reference(scenario):
    return multicor.run(scenario, scenario.parent / "reference", threads=1).directory


def test_books_close_and_what_the_motion_loses_in_contacts_is_heat(reference):
    """Couples heat like friction, the work of adhesion like impacts."""
    info = run_info(reference)
    assert info["energy_closure"] < 1e-12
    assert info["heat_closure"] < 1e-12
    with multicor.open_run(reference) as run:
        last = {
            name: float(run.series[name][-1])
            for name in ("friction_loss", "impact_loss", "heat_friction", "heat_impact")
        }
    assert last["heat_friction"] == pytest.approx(last["friction_loss"], rel=1e-12)
    assert last["heat_impact"] == pytest.approx(last["impact_loss"], rel=1e-12)


def test_frames_hold_tension_and_couples(reference):
    with multicor.open_run(reference) as run:
        model = run.model
        assert (model.laws.adhesion, model.laws.rolling) == (2e-4, 0.2)
        for frame in run.frames[1:]:  # moving and frozen ones
            force, couple = frame.contacts.force, frame.contacts.couple
            assert -2e-4 * (1.0 + 1e-12) <= force[:, 0].min() < 0.0 < force[:, 0].max()
            assert couple.any()
            arm = model.grains.radius.max()
            assert (
                np.abs(couple) <= 0.2 * arm * frame.dt * (force[:, 0] + 2e-4) * (1.0 + 1e-6)
            ).all()
        network = force_network(run, -1)
        assert (network.force[:, 0] < 0.0).any()


def test_a_stopped_run_goes_on_to_the_same_bits(scenario, reference, tmp_path):
    for step in (13, 22):  # while grains move, and in the frozen stage
        assert in_pieces(scenario, tmp_path / str(step), step) == digests(reference)


def test_the_format_of_fclib_does_not_know_these_laws(reference, tmp_path):
    with (
        multicor.open_run(reference) as run,
        pytest.raises(ExportError, match="adhesion, which the format of FCLib does not know"),
    ):
        export_fclib(run, tmp_path / "a.hdf5")


@pytest.mark.parametrize(
    "keys", ["adhesion = 0.0", "rolling_friction = 0.0", "adhesion = 0\nrolling_friction = 0"]
)
def test_keys_of_zero_make_the_model_without_them(keys):
    """The same model and state are the same run, to the bit."""
    plain, state = build(parse_scenario(SMALL, "small.toml"))
    zero, zero_state = build(
        parse_scenario(
            SMALL.replace("restitution = 0.3", f"restitution = 0.3\n{keys}"), "small.toml"
        )
    )
    assert model_digest(zero) == model_digest(plain)
    assert zero.laws.adhesion.size == zero.laws.rolling.size == 0
    assert zero_state.digest() == state.digest()


@pytest.mark.parametrize(("given", "key"), [
    ("adhesion = { force = 1e-4, range = 2e-3 }", ("contacts", 0, "adhesion", "range")),
    ("adhesion = 1e-4", ("contacts", 0, "adhesion")),
])  # fmt: skip
def test_adhesion_across_more_than_the_smallest_radius_is_refused(given, key):
    """A default range where one grain in a thousand is tiny, too."""
    text = SMALL.replace("restitution = 0.3", f"restitution = 0.3\n{given}")
    if len(key) == 3:
        sizes = '{ kind = "list", radii = [1e-3, 1e-6] }'
        text = re.sub(r"sizes = \{.*\}", f"sizes = {sizes}", text, count=1)
    with pytest.raises(ScenarioError) as refused:
        build(parse_scenario(text, "small.toml"))
    (problem,) = refused.value.problems
    assert problem.key == ".".join(map(str, key))
    assert "smallest radius" in str(problem)


def test_what_is_given_of_adhesion_is_in_the_laws():
    wet = 'adhesion = { force = 1e-4, range = 2e-5, kind = "wet" }'
    for given, reach, is_wet in ((wet, 2e-5, 1), ("adhesion = 1e-4", None, 0)):
        text = SMALL.replace("restitution = 0.3", f"restitution = 0.3\n{given}")
        model = build(parse_scenario(text, "small.toml"))[0]
        assert model.laws.adhesion.tolist() == [[1e-4]]
        assert model.laws.adhesion_range[0, 0] == (reach or 0.01 * model.mean_diameter)
        assert model.laws.is_wet.tolist() == [[is_wet]]


def test_laws_of_pairs_are_symmetric_and_zero_where_not_given():
    text = SMALL.replace("[[contacts]]", f"{STEEL}\n[[contacts]]", 1)
    text = re.sub(r'(name = "top"\nmaterial = )"glass"', r'\1"steel"', text)
    laws = build(parse_scenario(text, "small.toml"))[0].laws
    assert sorted(laws.adhesion.ravel()) == [0.0, 0.0, 3.0, 3.0]
    assert laws.adhesion[0, 1] == laws.adhesion[1, 0] == 3.0
    assert laws.rolling.size == 0
