"""Every shipped scenario is valid, and runs at least in a short form with closed books and small
overlaps."""

import pytest
from digest_cases import CONFIGS, SHIPPED
from digest_run import digests_of, frozen

import multicor_cli as multicor
from multicor_cli.checks import Verdict, worst_verdict
from multicor_cli.model.state import nudge_seed
from multicor_cli.store import run_info


def test_no_scenario_is_forgotten():
    assert {path.stem for path in CONFIGS.glob("*.toml")} == set(SHIPPED)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenario_is_valid_and_runs_in_short(name, tmp_path):
    multicor.load_scenario(CONFIGS / f"{name}.toml")
    multicor.run(
        multicor.load_scenario(CONFIGS / f"{name}.toml", overrides=SHIPPED[name]), tmp_path / name
    )
    assert worst_verdict(multicor.check_run(tmp_path / name)) is not Verdict.BAD
    info = run_info(tmp_path / name)
    assert info["status"] == "finished"
    assert info["energy_closure"] < 1e-10
    assert info["max_overlap"] < 1e-3
    assert info["solver"]["unconverged_steps"] == 0
    if info["heat"] is not None:
        assert info["heat_closure"] < 1e-10
    if nudge_seed() is None:
        assert digests_of(tmp_path / name) == frozen()[name]
    if name == "million":
        with multicor.open_run(tmp_path / name) as run:
            # From the first step on; 10^6 grains of the full scenario have the same rows, hence as
            # many contacts per grain.
            assert (run.series["contacts_mean"][1:] > 1.5 * info["grain_count"]).all()


@pytest.mark.parametrize("name", sorted(SHIPPED.keys() - {"million"}))
def test_no_check_of_a_shipped_scenario_is_bad(name):
    checks = multicor.check_scenario(CONFIGS / f"{name}.toml")
    assert worst_verdict(checks) is not Verdict.BAD, checks
