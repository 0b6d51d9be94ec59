"""The notebook of the tutorial is carried out, and what it says comes out."""

import json

import pytest
from places import ROOT

NOTEBOOK = ROOT / "docs" / "tutorial" / "notebook.ipynb"


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Its cells with their outputs; a last one of ours shows the numbers that are looked at."""
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    for module in ("ipykernel", "pandas", "matplotlib"):
        pytest.importorskip(module)
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    numbers = (
        "mean_load, ratio, same, steered.info['stage_ends'], flow.value[[0, -1]].tolist(), "
        "heavier.loading[0].drives['top'].y.force"
    )
    notebook.cells.append(nbformat.v4.new_code_cell(f"import json; print(json.dumps([{numbers}]))"))
    folder = tmp_path_factory.mktemp("notebook")
    return (
        nbclient.NotebookClient(
            notebook, timeout=300, resources={"metadata": {"path": str(folder)}}
        )
        .execute()
        .cells
    )


def test_it_is_kept_without_outputs():
    kept = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert all(
        not cell["outputs"] and cell["execution_count"] is None
        for cell in kept
        if cell["cell_type"] == "code"
    )


def test_what_it_says_comes_out(cells):
    load, ratio, is_same, ends, speeds, doubled = json.loads(cells[-1].outputs[0].text)
    assert load == pytest.approx(0.2, rel=0.01)
    assert 0.0 < ratio < 1.0
    assert is_same
    assert [(end["name"], end["reason"]) for end in ends] == [
        ("settle", "duration"), ("shear", "steered"), ("back", "steered"),
    ]  # fmt: skip
    there, back = ends[1]["duration"], ends[2]["duration"]
    assert there == pytest.approx(4e-3 / 0.1, abs=6 * 2e-4)  # asked every 5 steps of 0.2 ms
    assert back == pytest.approx(there, abs=6 * 2e-4)
    assert speeds[0] < speeds[1]
    assert doubled == -0.4


def test_runs_and_figures_are_shown(cells):
    shown = [
        output["data"] for cell in cells for output in cell.get("outputs", []) if "data" in output
    ]
    pictures = [data["text/plain"] for data in shown if "image/png" in data]
    assert [text.partition(" ")[0] for text in pictures] == ["<Run", "<Figure"]
