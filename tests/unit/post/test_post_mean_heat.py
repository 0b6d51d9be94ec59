"""Mean heat flux under a mean gradient, against frames and series that are known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cells import THICKNESS, make_cell, square_of_discs, strained
from heat_parts import with_heat
from made_up_frames import frame_of, source_of

from multicor_cli import post
from multicor_cli.model.books import GRADIENT_BOOKS
from multicor_cli.post import Selection
from multicor_cli.post.conductivity import FLUX_QUANTITIES

ALL = Selection(start=0.0)
WIDTH, HEIGHT, RATE = 8.0, 5.0, 0.4
G = np.array([3.0, 4.0])
FLUX = {
    "contacts": (-2.0, -6.0),
    "gas": (-1.0, 0.5),
    "radiation": (0.0, -0.5),
    "motion": (1.0, -3.0),
}
DIFFUSION = 0.3


def run_of(count=4000, frames=12, *, rate=RATE, gradient=G, thickness=THICKNESS, frozen=False):
    """Frames a time 1 apart, whose grains diffuse freely after a jump that is undone in each; two
    rows of the series between two of them."""
    random = np.random.default_rng(11)
    model, _ = make_cell(random.uniform(0.0, 5.0, (count, 2)), np.full(count, 0.5), (WIDTH, HEIGHT))
    model = with_heat(model, capacity=2.0, thickness=thickness)
    model = replace(model, heat_gradient=tuple(gradient.tolist()))
    steps = random.normal(size=(frames, count, 2)) * np.sqrt(2.0 * DIFFUSION)
    way = np.cumsum(steps, axis=0) + 0.5 * random.normal(size=(frames, count, 2))
    warm = 300.0 + random.normal(size=(frames, count))
    moments = [
        frame_of(way[0], walls=1, nonaffine=w, temperature=t)
        for w, t in zip(way, warm, strict=True)
    ]
    time = np.arange(0.0, frames, 0.5)
    flux = np.array([value for k in (0, 1) for value in (FLUX[way][k] for way in FLUX)])
    books = np.outer(time, [7.0, *flux])
    series = {entry.series: books[:, k] for k, entry in enumerate(GRADIENT_BOOKS)}
    series |= strained((WIDTH, HEIGHT, 0.0), (0.0, 0.0, 0.0 if frozen else rate), time)
    run = source_of(model, moments, np.arange(float(frames)), series=series)
    return SimpleNamespace(run=run, warm=warm)


def test_each_quantity_is_what_it_says():
    made = run_of()
    found = post.mean_heat(made.run, ALL)
    mean, flux = found.mean, np.array([*FLUX.values()])
    along = -flux @ G / (G @ G)
    whole = along.sum()
    assert tuple(mean) == tuple(q.name for q in FLUX_QUANTITIES)
    assert mean["along"] == pytest.approx(whole)
    # To the right of −G
    right = np.array([-G[1], G[0]])
    assert mean["across"] == pytest.approx(-flux.sum(axis=0) @ right / (G @ G))
    assert mean["conductivity"] == pytest.approx(whole / THICKNESS)
    for way, part in zip(FLUX, along, strict=True):
        assert mean[f"share_{way}"] == pytest.approx(part / whole)
    per = WIDTH * HEIGHT / (2.0 * 4000)
    assert mean["diffusivity"] == pytest.approx(along[:3].sum() * per)
    assert mean["mixing"] == pytest.approx(along[3] * per)
    assert mean["peclet"] == pytest.approx(RATE / mean["diffusivity"])
    # What grains undo does not count, from a strain of 1 on
    assert found.counted_from == 3
    assert np.isnan(found.values["self_diffusion"][:2]).all()
    assert mean["self_diffusion"] == pytest.approx(DIFFUSION, rel=0.05)
    square = made.warm[1:].var(axis=1).mean()
    assert mean["fluctuation"] == pytest.approx(np.sqrt(square) / np.hypot(*G))
    assert found.error["along"] == pytest.approx(0.0, abs=1e-12)


def test_displacements_that_are_not_forgotten_are_no_diffusion():
    """Without strain they begin with each interval, and contain the jumps that are undone."""
    found = post.mean_heat(run_of(rate=0.0).run, ALL)
    assert found.counted_from == 1
    assert found.mean["self_diffusion"] == pytest.approx(DIFFUSION + 0.25, rel=0.05)
    assert found.mean["peclet"] == 0.0


def test_what_stands_still_is_not_strained():
    found = post.mean_heat(run_of(frozen=True).run, ALL)
    assert found.mean["peclet"] == 0.0
    assert found.mean["along"] == pytest.approx(post.mean_heat(run_of().run, ALL).mean["along"])


@pytest.mark.parametrize("axis", [0, 1])
def test_a_gradient_along_an_axis_has_components_of_the_tensor(axis):
    """K_xx and K_yx along x; K_yy and −K_xy along y."""
    gradient = 2.0 * np.eye(2)[axis]
    mean = post.mean_heat(run_of(gradient=gradient).run, ALL).mean
    tensor = -np.array([*FLUX.values()]).sum(axis=0) / 2.0
    expected = (tensor[0], tensor[1]) if axis == 0 else (tensor[1], -tensor[0])
    assert (mean["along"], mean["across"]) == pytest.approx(expected)


def test_layers_of_spheres_have_no_conductivity():
    made = run_of()
    model = made.run.model
    made.run.model = replace(model, shape_factor=2.5)
    found = post.mean_heat(made.run, ALL)
    assert np.isnan(found.thickness)
    assert "conductivity" not in found.mean


def test_what_it_refuses():
    with pytest.raises(post.PostError, match="no mean gradient"):
        post.mean_heat(square_of_discs([0.3, 0.5]), ALL)
    with pytest.raises(post.PostError, match="needs two frames"):
        post.mean_heat(run_of().run, Selection(frames=slice(-1, None)))
