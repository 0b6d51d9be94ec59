"""Every shipped scenario is valid, and runs at least in a short form with closed books and small overlaps."""

from pathlib import Path

import pytest

import multicor_cli as multicor
from multicor_cli.store import run_info

CONFIGS = Path(__file__).parents[2] / "configs"
SHORT = {
    "shear": ["loading.0.duration=2e-3", "loading.1.until.strain.value=0.001", "output.frame_interval=2e-3"],
    "shear-dynamic": ["loading.0.duration=2e-3", "loading.1.until.strain.value=0.01", "output.frame_interval=2e-3"],
    "shear-gravity-free": ["loading.0.until.strain.value=0.3"],
    "column-collapse": ["loading.0.duration=0.01", "loading.1.duration=0.01"],
    "drum": ["loading.0.duration=0.02", "loading.1.duration=0.02"],
    "hopper": ["loading.0.duration=0.02", "loading.1.duration=0.02"],
    "lattice14": [],
    "heated-bed": [
        "particles.0.count=400",
        "domain.size=[0.06,0.13]",
        "walls.2.geometry.point=[0.06,0.0]",
        "loading.0.duration=0.3",
        "loading.1.duration=0.02",
    ],
    "million": ["particles.0.count=20_000", "domain.size=[1.2,0.14]"],
}


def test_no_scenario_is_forgotten():
    assert {path.stem for path in CONFIGS.glob("*.toml")} == set(SHORT)


@pytest.mark.parametrize("name", SHORT)
def test_shipped_scenario_is_valid_and_runs_in_short(name, tmp_path):
    multicor.load_scenario(CONFIGS / f"{name}.toml")
    multicor.run(multicor.load_scenario(CONFIGS / f"{name}.toml", overrides=SHORT[name]), tmp_path / name)
    info = run_info(tmp_path / name)
    assert info["status"] == "finished"
    assert info["energy_closure"] < 1e-10
    assert info["max_overlap"] < 1e-3
    assert info["solver"]["unconverged_steps"] == 0
    if info["heat"] is not None:
        assert info["heat_closure"] < 1e-10
    if name == "million":
        with multicor.open_run(tmp_path / name) as run:
            # From the first step on; 10^6 grains of the full scenario have the same rows, hence as many contacts per grain.
            assert (run.series["contacts_mean"][1:] > 1.5 * info["grain_count"]).all()
