"""What needs a library of an extra says so where it is missing, in one way; everything else does
without."""

import sys
import tomllib

import numpy as np
import pytest
from cells import square_of_discs
from command_line import call
from places import ROOT
from scenes import SMALL

from multicor_cli.optional import LIBRARIES, MissingLibrary, library
from multicor_cli.post import Selection, chains, clusters, conductivity, voronoi
from multicor_cli.studies.figure import FITS, fit
from multicor_cli.studies.table import Series

LISTED = '"contacts.0.friction" = [0.2, 0.5]'
DRAWN = 'sample = { kind = "KIND", count = 4 }\n"contacts.0.friction" = { from = 0.2, to = 0.5 }'
STUDIES = {
    "sobol": (DRAWN.replace("KIND", "sobol"), ""),
    "latin-hypercube": (DRAWN.replace("KIND", "latin-hypercube"), ""),
    "slurm": (LISTED, "[compute.slurm]\n"),
    "dask": (LISTED, '[compute]\nscheduler = "tls://localhost:1"\n'),
    "here": (LISTED, "[compute]\nworkers = 1\n"),
}
"""What is varied, and where it is computed."""


@pytest.fixture
def studies(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    for name, (vary, more) in STUDIES.items():
        head = '[study]\nname = "s"\nscenario = "small.toml"\n'
        observe = '[[observe]]\nname = "steps"\ninfo = "step"\n'
        (tmp_path / f"{name}.toml").write_text(f"{head}[vary]\n{vary}\n{observe}{more}")
    for kind in ("wkt", "geojson"):
        shape = f'{{ kind = "file", file = "none.{kind}" }}'
        (tmp_path / f"{kind}.toml").write_text(SMALL.replace('shape = "disc"', f"shape = {shape}"))
        (tmp_path / f"none.{kind}").write_text("POINT (0 0)")
    return set(tmp_path.iterdir())


def remove(monkeypatch, name):
    """Let a library be missing; what is then said of it."""
    for module in {name, *(module for module in sys.modules if module.startswith(f"{name}."))}:
        monkeypatch.setitem(sys.modules, module, None)
    wanted = LIBRARIES[name]
    return (
        f"{wanted.use} need {wanted.name}, which is not installed: pip install "
        f"'multicor-cli[{wanted.extra}]'"
    )


def test_the_list_is_that_of_the_extras():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    named = {
        (extra, need.partition(">")[0])
        for extra in ("plots", "gsd", "shapes", "study")
        for need in extras[extra]
    }
    told = {(each.extra, each.name) for each in LIBRARIES.values()}
    assert told <= named  # scipy is in two
    assert {name for _, name in told} == {name for _, name in named}


@pytest.mark.parametrize(("missing", "words"), [
    ("matplotlib", "post energy RUN --plot a.png"),
    ("matplotlib", "post map RUN --of velocity --plot term"),
    ("matplotlib", "post animate RUN --of velocity -o a.gif"),
    ("gsd", "export gsd RUN -o a.gsd"),
    ("shapely", "validate wkt.toml"),
    ("shapely", "validate geojson.toml"),
    ("scipy", "post structure RUN --voronoi"),
    ("scipy", "post map RUN --of hexatic"),
    ("scipy", "study validate sobol.toml"),
    ("scipy", "study run latin-hypercube.toml"),
    ("scipy", "study status sobol.toml"),
    ("distributed", "study run slurm.toml"),
    ("dask_jobqueue", "study run slurm.toml"),
    ("cryptography", "study run slurm.toml"),
    ("distributed", "study run dask.toml"),
])  # fmt: skip
def test_a_command_names_the_extra(missing, words, studies, typed, tmp_path, monkeypatch):
    said = remove(monkeypatch, missing)
    done = typed(words, 5)
    assert done.stderr.splitlines()[-1] == f"multicor: {said}"
    assert "Traceback" not in done.stderr
    assert {path for path in tmp_path.iterdir() if path.name != "studies"} == studies


TEXTS = (
    "post profile RUN", "post map RUN --of velocity", "post map RUN --of fluctuation",
    "post forces RUN",
    "post rheology RUN --from 0",
    "post region RUN --in {min=[0.0,0.0],max=[0.02,0.01]}", "post fields RUN", "post energy RUN",
    "post compare RUN RUN",
    "post structure RUN --margin 0", "post correlation RUN --margin 0",
    "post avalanches RUN --of kinetic --threshold 1e-12",
    "post fabric RUN --from 0", "post lifetimes RUN --from 0",
    "post chains RUN --lengths --angle 89", "post chains RUN", "post chains RUN --frame -1",
    "post clusters RUN", "post forces RUN --mobilization", "post series RUN",
    "post flow RUN --from 0 --line 0.01,0.0:0.01,0.01",
)  # fmt: skip


@pytest.mark.parametrize("words", TEXTS)
def test_the_terminal_needs_matplotlib_for_pictures_only(words, finished, tmp_path, monkeypatch):
    said = remove(monkeypatch, "matplotlib")
    for more in ([], ["--plot", "term"]):
        done = call(*words.replace("RUN", str(finished)).split(), *more, cwd=tmp_path)
        assert done.returncode == 0 or (more and done.returncode == 5 and said in done.stderr), (
            done.stderr
        )


@pytest.mark.parametrize("missing", ["pandas", "pyarrow"])
def test_parquet_names_the_extra(missing, studies, typed, tmp_path, monkeypatch):
    (tmp_path / "studies" / "s").mkdir(parents=True)
    typed("study run here.toml --max-hours 0", 75)
    said = remove(monkeypatch, missing)
    typed("study table here.toml")
    done = typed("study table here.toml --parquet t.parquet", 5)
    assert done.stderr.splitlines()[0] == f"multicor: {said}"
    assert not (tmp_path / "t.parquet").exists()


@pytest.mark.parametrize("kind", FITS)
def test_a_fit_names_the_extra(kind, monkeypatch):
    x = np.linspace(1.0, 2.0, 5)
    series = Series("", x, 1.0 + x, np.full(5, np.nan), np.full(5, np.nan))
    fit("line", series)
    said = remove(monkeypatch, "scipy")
    with pytest.raises(MissingLibrary) as caught:
        fit(kind, series)
    assert str(caught.value) == said


@pytest.mark.parametrize("measure", [chains, clusters])
def test_chains_and_clusters_name_the_extra(measure, column, monkeypatch):
    said = remove(monkeypatch, "scipy")
    with pytest.raises(MissingLibrary) as caught:
        measure(column)
    assert str(caught.value) == said


@pytest.mark.parametrize("measure", [conductivity, voronoi])
def test_a_table_names_the_extra(measure, monkeypatch):
    said = remove(monkeypatch, "scipy")
    with pytest.raises(MissingLibrary) as caught:
        measure(square_of_discs([0.3]), Selection(start=0.0))
    assert str(caught.value) == said


def test_a_library_that_is_broken_is_not_called_missing(tmp_path, monkeypatch):
    remove(monkeypatch, "gsd")
    monkeypatch.delitem(sys.modules, "gsd")
    (tmp_path / "gsd.py").write_text("import no_such_thing")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        MissingLibrary,
        match=r"gsd, which cannot be loaded \(No module named 'no_such_thing'\): pip install",
    ):
        library("gsd")
