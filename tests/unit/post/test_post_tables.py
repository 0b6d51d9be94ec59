"""Tables as DataFrames and in notebooks; distributions and θ over several frames."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from heat_run import write_heated_run

from multicor_cli.optional import MissingLibrary
from multicor_cli.post import (
    Selection,
    angular_distribution,
    energy,
    force_distribution,
    profile,
    theta_eta,
)
from multicor_cli.post.compare import _labels
from multicor_cli.post.sums import scatter
from multicor_cli.store import Run, open_run


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path: Path = tmp_path_factory.mktemp("tables") / "run"
    write_heated_run(path)
    return open_run(path)


def test_frames_of_pandas_have_names_and_units(run: Run) -> None:
    pytest.importorskip("pandas")
    table = profile(run, "temperature", Selection(start=0.0))
    frame = table.to_pandas()
    assert list(frame.columns) == ["y", "temperature", "standard error", "area"]
    assert frame.attrs["units"] == {
        "y": "m",
        "temperature": "K",
        "standard error": "K",
        "area": "m2",
    }
    assert frame["temperature"].to_numpy() == pytest.approx(table.value, nan_ok=True)
    books = energy(run)
    at_end = books.to_pandas().set_index("quantity")
    assert at_end.loc["lost to friction", "unit"] == "J"
    assert at_end.loc["heat stored in the grains", "at the end"] == books.books["heat_stored"][-1]
    assert len(books.to_pandas(is_detailed=True)) == books.time.size
    with pytest.raises(ValueError, match="no details"):
        table.to_pandas(is_detailed=True)


def test_without_pandas_the_extra_is_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingLibrary, match=r"multicor-cli\[study\]"):
        energy(run).to_pandas()


def test_tables_show_themselves(run: Run) -> None:
    table = profile(run, "temperature", Selection(start=0.0), 3)
    assert repr(table).startswith("<ProfileTable: 3 rows of y [m], temperature [K]")
    assert table._repr_html_().count("<tr>") == 4


def test_theta_of_several_frames(run: Run) -> None:
    chosen = Selection(frames=slice(-3, None))
    several = theta_eta(run, selection=chosen, wall="top", bins=4)
    single = [
        theta_eta(run, int(k), wall="top", bins=4, height=several.height) for k in several.frames
    ]
    assert several.eta.size == sum(one.eta.size for one in single)
    assert several.scatter == pytest.approx(
        np.std([one.mean for one in single], axis=0, ddof=1), nan_ok=True
    )
    assert np.isnan(single[0].scatter).all()
    assert (
        len(several.headings)
        == len(several.rows[0])
        == 1 + len(single[0].headings)
        == 1 + len(single[0].rows[0])
    )


def test_distributions_of_several_frames_scatter_as_those_of_each(run: Run) -> None:
    chosen = Selection(frames=slice(-3, None))
    for make, name in ((force_distribution, "normal"), (angular_distribution, "density")):
        several = make(run, chosen)
        single = np.array(
            [
                getattr(make(run, Selection(frames=slice(k, k + 1))), name)
                for k in several.frames.tolist()
            ]
        )
        assert getattr(several, f"{name}_scatter") == pytest.approx(np.std(single, axis=0, ddof=1))
        assert np.isnan(
            getattr(make(run, Selection(frames=slice(-1, None))), f"{name}_scatter")
        ).all()


def test_scatter_leaves_out_what_is_not_known() -> None:
    rows = np.array([[1.0, np.nan], [2.0, 5.0], [4.0, np.nan]])
    assert scatter(rows) == pytest.approx([np.std([1.0, 2.0, 4.0], ddof=1), np.nan], nan_ok=True)


def test_runs_are_called_by_what_differs() -> None:
    friction, seed = ("contacts.0.friction", "0.3", "0.5"), ("scenario.seed", "1", "2")
    assert _labels([friction, seed], ("a", "b")) == ("friction = 0.3", "friction = 0.5")
    assert _labels([seed], ("a", "b")) == ("seed = 1", "seed = 2")
    assert _labels([friction, ("solver.dt", "1", "2")], ("a", "b")) == ("a", "b")
    assert _labels([], ("a", "b")) == ("a", "b")
