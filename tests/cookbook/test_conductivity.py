"""`configs/conductivity.toml`: how a packing without walls conducts, and how a flow mixes."""

import numpy as np
import pytest
from recorded import keep
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.model.columns import XY
from multicor_cli.post import Selection, conductivity, mean_heat

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

SEEDS = (1, 2, 3)


def frames_of(run, stage):
    """The later half of the frames of a stage."""
    of_stage = np.flatnonzero(np.asarray(run.frames.stage) == list(run.stages).index(stage))
    return Selection(frames=slice(of_stage[of_stage.size // 2], of_stage[-1] + 1))


def test_what_flows_at_rest_is_what_the_network_conducts(tmp_path, record_property):
    """Under three pressures, in vacuum: one flux of the contacts, by both ways, grows with P^⅓; it
    is below the mean-field bound ν Z/π of K/H."""
    found = []
    for pressure in (2.0, 20.0, 200.0):
        directory = run_config(
            "conductivity", tmp_path / f"run-{pressure}", f"variables.pressure={pressure}",
            "heat.gas.conductivity=1e-6", "loading.2.until.strain.value=0.01",
            "loading.1.duration=2000.0", "loading.1.dt=10.0",
        )  # fmt: skip
        with multicor.open_run(directory) as run:
            rest = frames_of(run, "conduct")
            flux, network = mean_heat(run, rest).mean, conductivity(run, rest).mean
        bound = network["solid_fraction"] * network["coordination"] / np.pi
        found.append(
            [flux["along"], network["square_yy"], network["over_contact"], bound,
             network["over_linear"], network["pressure"]]
        )  # fmt: skip
        print(
            f"P = {network['pressure']:.4g} N/m: K = {flux['along']:.6g} W/K from the flux, "
            f"{network['square_yy']:.6g} of the network; K/H = {network['over_contact']:.4f}, "
            f"ν Z/π = {bound:.4f}, K/K_lin = {network['over_linear']:.4f}"
        )
    keep(record_property, found=found)
    flux, network, over_contact, bound, over_linear, pressure = np.transpose(found)
    exponent = np.polyfit(np.log(pressure), np.log(network), 1)[0]
    print(f"exponent of P: {exponent:.3f}")
    np.testing.assert_allclose(flux, network, rtol=1e-3)
    assert exponent == pytest.approx(1.0 / 3.0, abs=0.03)
    assert (over_contact < 1.02 * bound).all()
    assert (over_linear < 1.0).all()


def test_a_flow_mixes_as_its_grains_diffuse(tmp_path, record_property):
    """Where grains hardly conduct on their way (Pe ≫ 1), the diffusivity of heat by motion is that
    of the grains themselves."""
    found = []
    for seed in SEEDS:
        directory = run_config(
            "conductivity", tmp_path / f"run-{seed}", f"scenario.seed={seed}",
            "loading.2.until.strain.value=30.0",
        )  # fmt: skip
        with multicor.open_run(directory) as run:
            table = mean_heat(run, frames_of(run, "shear"))
            scale = float(run.frames[-1].wall_velocity[0, XY]) * run.model.mean_diameter**2
        names = ("mixing", "self_diffusion", "peclet", "share_motion")
        found.append([table.mean[name] for name in names])
        mixing, diffusion = (table.mean[name] / scale for name in names[:2])
        errors = [table.error[name] / scale for name in names[:2]]
        print(
            f"seed {seed}: D_T = {mixing:.4f} ± {errors[0]:.4f}, D = {diffusion:.4f} ± "
            f"{errors[1]:.4f} of the rate times d²; Pe = {found[-1][2]:.1f}, share of motion "
            f"{found[-1][3]:.4f}"
        )
    keep(record_property, found=found)
    mixing, diffusion, peclet, share = np.transpose(found)
    assert mixing.mean() == pytest.approx(diffusion.mean(), rel=0.25)
    assert (share > 0.9).all()
    assert (peclet > 100.0).all()
