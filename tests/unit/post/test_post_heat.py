"""Profiles, θ–η and maps of a run with known temperatures, against the numbers that were put in."""

from dataclasses import replace

import numpy as np
import pytest
from from_wall_to_wall import profile
from heat_run import GRADIENT, GRAINS, INTERVAL, RADIUS, RATES, SHEAR, write_heated_run
from made_up_frames import put, source_of

from multicor_cli.post import PostError, Selection, grain_map, theta_eta
from multicor_cli.store import open_run

HEIGHTS = RADIUS + 2.0 * RADIUS * np.arange(GRAINS)
LATER = Selection(frames=slice(1, None))


def source(column, frames, model=None):
    """The run with changed frames."""
    return source_of(model or column.model, frames, [frame.time for frame in frames])


def other(tmp_path, **said):
    write_heated_run(tmp_path / "run", **said)
    return open_run(tmp_path / "run")


def test_temperature_profile_and_its_normalized_form(column):
    """One grain per bin: T = 300 + 20 y, and (T − 300)/20 between walls at 300 and 320 K."""
    table = profile(column, "temperature", LATER, bins=GRAINS)
    assert table.value == pytest.approx(300.0 + GRADIENT * HEIGHTS)
    assert table.wall_values == pytest.approx((300.0, 320.0))
    assert table.units == ("m", "K")
    assert table.normalized().value == pytest.approx(HEIGHTS)


def test_normalized_profiles_need_what_they_are_normalized_by(tmp_path, column):
    table = profile(other(tmp_path, walls=(300.0, np.nan)), "temperature", LATER)
    with pytest.raises(PostError, match="prescribed temperature of both walls; 'top' has none"):
        table.normalized()
    with pytest.raises(PostError, match="needs two frames"):
        profile(column, "heat", Selection(frames=slice(0, 1)))
    with pytest.raises(PostError, match="choose from: velocity, spin, temperature"):
        profile(column, "heat", LATER).normalized()


def test_spin_is_normalized_by_the_shear_rate_of_the_walls(column):
    table = profile(column, "spin", LATER, bins=5)
    assert table.value == pytest.approx(-0.5 * SHEAR)
    assert table.shear_rate == pytest.approx(SHEAR)
    assert table.normalized().value == pytest.approx(-0.5)
    assert profile(column, "spin", Selection(frames=slice(0, 1))).shear_rate == 0.0
    with pytest.raises(PostError, match="different velocity"):
        profile(column, "spin", Selection(frames=slice(0, 1))).normalized()


@pytest.mark.parametrize("of", ["temperature", "heat"])
def test_runs_without_heat_say_so(tmp_path, of):
    cold = other(tmp_path, heat=False)
    for make in (lambda: profile(cold, of), lambda: grain_map(cold, of), lambda: theta_eta(cold)):
        with pytest.raises(PostError, match="has no heat"):
            make()
    assert profile(cold, "velocity").value.size == GRAINS


# --- θ–η


def test_theta_eta_from_the_top_and_from_the_bottom(column):
    """T₀ = 300 K, the top wall at 320 K: θ = y, and η counts downwards from the highest grain."""
    table = theta_eta(column, wall="top", bins=GRAINS)
    assert table.eta == pytest.approx(1.0 - HEIGHTS)
    assert table.theta == pytest.approx(HEIGHTS)
    assert table.mean == pytest.approx(HEIGHTS[::-1])
    assert table.center == pytest.approx(HEIGHTS)
    assert table.count.tolist() == [1] * GRAINS
    found = (table.reference, table.wall_temperature, table.height)
    assert found == pytest.approx((300.0, 320.0, 1.0))
    with pytest.raises(PostError, match="--reference"):
        theta_eta(column, wall="bottom")
    up = theta_eta(column, wall="bottom", reference=290.0, bins=GRAINS)
    assert up.eta == pytest.approx(HEIGHTS)
    assert up.theta == pytest.approx((10.0 + GRADIENT * HEIGHTS) / 10.0)


def test_height_scales_eta_and_leaves_out_what_is_beyond(column):
    table = theta_eta(column, wall="top", height=0.5, bins=5)
    assert table.eta == pytest.approx((1.0 - HEIGHTS) / 0.5)
    assert table.count.tolist() == [1, 1, 1, 1, 1]
    wide = theta_eta(column, wall="top", height=2.0, bins=4)
    assert wide.count.tolist() == [5, 5, 0, 0]
    assert np.isnan(wide.mean[2:]).all()
    assert np.isnan(wide.lowest[2:]).all()


def test_wall_is_found_if_it_is_the_only_one(tmp_path, column):
    assert theta_eta(other(tmp_path, walls=(np.nan, 320.0))).wall == "top"
    with pytest.raises(PostError, match=r"choose the wall with --wall: .* bottom, top"):
        theta_eta(column)
    with pytest.raises(PostError, match="no wall has a temperature"):
        theta_eta(column, 0)


@pytest.mark.parametrize(("said", "message"), [
    ({"wall": "lid"}, "no wall 'lid'; choose from: bottom, top"),
    ({"frame": 5}, "no frame 5: the run has 5, from 0 to 4"),
    ({"wall": "top", "height": 0.0}, "must be positive"),
    ({"wall": "top", "height": np.inf}, "must be positive and finite"),
    ({"wall": "top", "reference": np.nan}, "must be finite"),
    ({"wall": "top", "bins": 0}, "bins"),
])  # fmt: skip
def test_theta_eta_refuses_what_makes_no_sense(column, said, message):
    with pytest.raises(PostError, match=message):
        theta_eta(column, **said)


def test_theta_eta_needs_a_wall_of_known_temperature_below_or_above(tmp_path, column):
    with pytest.raises(PostError, match=r"'top' has no prescribed temperature .* bottom"):
        theta_eta(other(tmp_path, walls=(310.0, np.nan)), wall="top")
    geometry = column.model.shapes.geometry.copy()
    geometry[1] = [4.0, 0.0, -1.0, 0.0]  # the top wall becomes one at the side
    turned = replace(column.model, shapes=replace(column.model.shapes, geometry=geometry))
    with pytest.raises(PostError, match="'top' is neither below nor above"):
        theta_eta(source(column, list(column.frames), turned), wall="top")


# --- maps


def test_maps_hold_the_values_of_the_frame_and_refuse_others(column):
    assert grain_map(column, "temperature").value == pytest.approx(300.0 + GRADIENT * HEIGHTS)
    assert grain_map(column, "velocity", 1).value == pytest.approx(SHEAR * HEIGHTS)
    assert grain_map(column, "spin", 0).value == pytest.approx(0.0)
    heat = grain_map(column, "heat", 2)
    assert heat.value == pytest.approx(RATES)
    assert heat.time == 2 * INTERVAL
    fluctuation = grain_map(column, "fluctuation")
    assert fluctuation.vector == pytest.approx(np.zeros((GRAINS, 2)), abs=1e-12)
    names = "velocity, velocity-y, speed, displacement, rotation, spin, temperature"
    with pytest.raises(PostError, match=f"choose from: {names}"):
        grain_map(column, "wetness")
    with pytest.raises(PostError, match="frame 0 has none"):
        grain_map(column, "heat", 0)


def test_fluctuation_keeps_the_vertical_velocity(column):
    """Only the mean horizontal flow is taken away."""
    frame = column.frames[2]
    put(frame, velocity=np.column_stack([frame.velocity[:, 0], np.full(GRAINS, 0.3)]))
    table = grain_map(source(column, [frame]), "fluctuation")
    assert table.vector == pytest.approx(np.tile([0.0, 0.3], (GRAINS, 1)), abs=1e-12)
    assert table.value == pytest.approx(0.3)
    assert table.detail_headings[-1] == "fluctuation y [m/s]"
    assert len(table.detail_rows[0]) == len(table.detail_headings)
