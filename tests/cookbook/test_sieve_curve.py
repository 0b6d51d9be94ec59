"""`configs/sieve-curve.toml`: the packed grains have the mass of the sieve curve in every class.

One grain is drawn from each of n intervals of equal probability. A sum over such grains is off by
at most the total variation of what is summed (Koksma; H. Niederreiter, Random Number Generation and
Quasi-Monte Carlo Methods, SIAM 1992, chapter 2). In a class, mass rises from m(a) to m(b), and it
is 0 outside: its variation is 2 m(b). So the mass of a class differs from n times its expectation
by no more than two grains of its largest size, for any seed.
"""

import csv
import math

import numpy as np
import pytest
from places import ROOT

import multicor_cli as multicor
from multicor_cli.packing import build

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]

SIEVES = ROOT / "configs" / "sieve-curve.toml"
DENSITY, LOAD, HEIGHT = 2650.0, 1.0, 32e-3
LARGE = ("variables.width=0.2", "variables.height=0.5")


def sieves():
    """Diameters and what passes."""
    with SIEVES.with_suffix(".csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    diameter, passing = (
        np.array([float(row[name]) for row in rows]) for name in ("diameter", "passing")
    )
    return diameter, passing


def mass_of(diameter):
    return DENSITY * math.pi / 6.0 * diameter**3


def expected_masses(count):
    """Mean mass of each class among ``count`` grains.

    A class with the share s of the mass M has M s ⟨1/m⟩ grains, the mean over its diameters: ⟨1/D³⟩
    = (a + b)/(2 a² b²).
    """
    edge, passing = sieves()
    low, high = edge[:-1], edge[1:]
    inverse = (low + high) / (2.0 * low**2 * high**2) / (DENSITY * math.pi / 6.0)
    share = np.diff(passing)
    return count / (share * inverse).sum() * share


def masses(radius, mass):
    return np.histogram(2.0 * radius, sieves()[0], weights=mass)[0]


def test_every_class_has_its_mass(tmp_path):
    """In what lies under the lid at the end; the lid gets its load back, and the floor also has the
    weight of the grains."""
    multicor.run(SIEVES, tmp_path / "run")
    with multicor.open_run(tmp_path / "run") as run:
        grains, end, series = run.model.grains, run.frames[-1], run.series
        y = end.position[:, 1]
        assert ((y > 0.0) & (y < end.wall_position[1, 1] + HEIGHT)).all()
        found = masses(grains.radius, grains.mass)
        weight = 9.81 * grains.mass.sum()
        floor, lid = series["wall_force"][series["time"] > end.time - 0.02, :, 1].mean(axis=0)
    count, bound = grains.radius.size, 2.0 * mass_of(sieves()[0][1:])
    difference = found - expected_masses(count)
    shares = ", ".join(f"{share:.4f}" for share in found / found.sum())
    print(f"shares {shares}; {np.abs(difference / bound).max():.2f} of the bound at most")
    print(f"lid {lid:.4f} N, floor {-floor:.4f} N, weight {weight:.4f} N")
    assert (np.abs(difference) <= bound).all()
    assert found.sum() == pytest.approx(grains.mass.sum(), rel=1e-12)
    assert grains.mass == pytest.approx(mass_of(2.0 * grains.radius), rel=1e-12)
    assert lid == pytest.approx(LOAD, rel=0.02)
    assert floor == pytest.approx(-(weight + LOAD), rel=0.02)


@pytest.mark.parametrize("count", [100, 1000, 20_000])
def test_the_bound_holds_for_all_seeds_and_shrinks_with_the_number_of_grains(count):
    bound, expected = 2.0 * mass_of(sieves()[0][1:]), expected_masses(count)
    used = []
    for seed in range(10):
        changes = [f"scenario.seed={seed}", f"variables.count={count}", *LARGE]
        model = build(multicor.load_scenario(SIEVES, overrides=changes))[0]
        used.append(np.abs(masses(model.grains.radius, model.grains.mass) - expected) / bound)
    print(
        f"{count} grains: {np.max(used):.2f} of the bound, {np.max(bound / expected):.4f} of a class"
    )
    assert np.max(used) <= 1.0
