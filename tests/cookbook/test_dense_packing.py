"""`configs/dense-packing.toml`: without friction a packing of rigid discs is isostatic.

The forces on N discs that contacts hold, and on a lid that is free in y, obey 2N + 1 equations, and
generic rigid packings have no more contacts than that, 4 for each disc (C. F. Moukarzel, Phys. Rev.
Lett. 81, 1634, 1998; J.-N. Roux, Phys. Rev. E 61, 6802,
2000).
"""

import numpy as np
import pytest
from scenarios import run_config

import multicor_cli as multicor
from multicor_cli.post.rheology import rheology

pytestmark = [pytest.mark.validation, pytest.mark.timeout(1800)]


def backbone(grains, i, j):
    """Number of discs that three contacts or more hold, and of the contacts between them and with
    walls; rattlers left out."""
    is_held = np.ones(grains, np.bool_)
    while True:
        keeps = is_held[i] & ((j >= grains) | is_held[np.minimum(j, grains - 1)])
        between = keeps & (j < grains)
        degree = np.bincount(i[keeps], minlength=grains) + np.bincount(j[between], minlength=grains)
        still = is_held & (degree >= 3)
        if still.sum() == is_held.sum():
            return int(is_held.sum()), int(keeps.sum())
        is_held = still


@pytest.mark.parametrize("seed", [4, 5])
def test_isostatic_without_friction_and_less_with_it(seed, tmp_path):
    path = run_config("dense-packing", tmp_path / "run", f"scenario.seed={seed}")
    with multicor.open_run(path) as run:
        last = int(np.flatnonzero(np.asarray(run.frames.stage) == 0)[-1])
        contacts, grains = run.frames[last].contacts, run.model.grain_count
        discs, count = backbone(grains, contacts.i, contacts.j)
        sheared = rheology(run)
    per_disc = 2.0 * (count - 1) / discs  # one of the equations is that of the lid
    print(f"{discs} of {grains} discs held, {count} contacts: {per_disc:.4f} a disc")
    print(f"sheared: {sheared.mean['coordination']:.3f}")
    assert discs > 0.9 * grains
    assert per_disc == pytest.approx(4.0, abs=0.08)
    assert sheared.mean["coordination"] < 3.5  # friction needs fewer
