"""post rheology, energy, compare, forces and profile of stress: data on stdout, the right codes, on runs that still go on."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from heat_run import write_heated_run
from typer.testing import CliRunner

from multicor_cli.cli.app import app
from multicor_cli.store import RunDirectory

runner = CliRunner()


@pytest.fixture(scope="module")
def heated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("heated") / "run"
    write_heated_run(path)
    return path


def outputs(*arguments: object) -> tuple[dict, list[list[str]], str]:
    """JSON, CSV and table of a command."""
    words = ["post", *map(str, arguments), *(["--overwrite"] if "--plot" in arguments else [])]
    found = [runner.invoke(app, [*words, *extra]) for extra in (["--json"], ["--csv"], [])]
    assert [done.exit_code for done in found] == [0, 0, 0], found[0].stderr
    return json.loads(found[0].stdout), list(csv.reader(found[1].stdout.splitlines())), found[2].stdout


def test_a_figure_is_not_replaced_unasked(finished: Path, tmp_path: Path) -> None:
    figure = tmp_path / "mine.png"
    figure.write_text("mine")
    words = ["post", "energy", str(finished), "--plot", str(figure)]
    done = runner.invoke(app, words)
    assert (done.exit_code, figure.read_text()) == (6, "mine")
    assert runner.invoke(app, [*words, "--overwrite"]).exit_code == 0
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_rheology(finished: Path, tmp_path: Path) -> None:
    data, rows, table = outputs("rheology", finished, "--from", 0, "--margin", 1, "--plot", tmp_path / "r.png")
    assert rows[0][0] == "time [s]"
    assert [float(row[0]) for row in rows[1:]] == data["time"]
    assert f"{data['mean']['friction_walls']:.5g}" in table
    assert data["mean"]["solid_fraction"] > 0.5
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_energy(finished: Path, heated: Path, tmp_path: Path) -> None:
    data, rows, table = outputs("energy", finished, "--plot", tmp_path / "e.svg")
    assert float(rows[-1][rows[0].index("friction_loss [J]")]) == data["end"]["friction_loss"]
    assert "lost to friction" in table
    assert data["heat_closure"] is None
    assert "heat stored" in outputs("energy", heated)[2]
    assert (tmp_path / "e.svg").read_text().startswith("<?xml")


def test_region(finished: Path, tmp_path: Path) -> None:
    options = ("--in", "{ min = [0.0, 0.005], max = [0.01, 0.01] }", "--from", 0, "--plot", tmp_path / "r.pdf")
    data, rows, table = outputs("region", finished, *options)
    assert [float(row[0]) for row in rows[1:]] == data["time"]
    assert data["area"] == pytest.approx(5e-5)
    assert f"{data['mean']['solid_fraction']:.5g}" in table


def test_compare(finished: Path, heated: Path, tmp_path: Path) -> None:
    data, rows, table = outputs("compare", finished, finished, "--of", "velocity", "--of", "spin", "--plot", tmp_path / "c.png")
    assert data["scenario"] == []
    assert set(data["profiles"]) == {"velocity", "spin"}
    assert {row[0] for row in rows[1:]} == {"velocity", "spin"}
    assert "work of the walls" in table
    done = runner.invoke(app, ["post", "compare", str(finished), str(heated)])
    assert done.exit_code == 0
    assert "keys of the scenarios differ" in done.stderr


def test_forces_distribution_and_angles(finished: Path, tmp_path: Path) -> None:
    for option, column in (("--distribution", "edges"), ("--angles", "angle")):
        data, rows, _ = outputs("forces", finished, option, "--frames", "-5:", "--plot", tmp_path / f"f{option}.pdf")
        assert data["frame_count"] == 5
        assert len(rows) == len(data[column]) + (0 if column == "edges" else 1)
        one, _, _ = outputs("forces", finished, option)
        assert one["frame_count"] == 1


def test_profile_of_stress(finished: Path, tmp_path: Path) -> None:
    options = ("--bin-width", 2, "--exclude-walls", 1, "--plot", tmp_path / "s.png")
    data, rows, _ = outputs("profile", finished, "--of", "stress", *options)
    assert [float(row[0]) for row in rows[1:]] == data["y"]
    assert [float(row[7]) for row in rows[1:]] == data["fields"]["stress-yy"]["value"]
    assert data["y"][0] > data["bin_width"] / 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["profile", "--bins", "3", "--bin-width", "2"], "exclude each other"),
        (["profile", "--exclude-walls", "99"], "nothing is left"),
        (["forces", "--angles", "--distribution"], "exclude each other"),
        (["forces", "--frames", "1:"], "needs --distribution or --angles"),
        (["rheology", "--from", "0", "--margin", "99"], "no bulk is left"),
        (["rheology", "--frames", "-1:"], "needs two frames"),
        (["region", "--in", "circle"], "is not a region"),
        (["region", "--in", "{ min = [0, 0], max = [0, 1] }"], "not above and to the right"),
        (["region", "--in", '{ kind = "circle", center = [0, 0] }'], "radius"),
        (["region", "--in", "{ min = [50, 50], max = [51, 51] }"], "no grain is in the region"),
        (["energy", "--from", "1e9"], "no row in this time"),
        (["compare", "DIR", "--of", "wetness"], "choose from"),
        (["compare", "DIR", "--of", "stress"], "several components"),
    ],
)
def test_what_makes_no_sense_is_code_2(arguments: list[str], message: str, finished: Path) -> None:
    words = [str(finished) if word == "DIR" else word for word in arguments]
    done = runner.invoke(app, ["post", words[0], str(finished), *words[1:]])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert message in " ".join(done.stderr.replace("│", " ").split())
    assert "internal error" not in done.stderr


@pytest.mark.parametrize("arguments", [["rheology"], ["energy"], ["compare", "DIR"]])
def test_what_is_no_run_is_code_6(arguments: list[str], tmp_path: Path) -> None:
    words = [str(tmp_path) if word == "DIR" else word for word in arguments]
    done = runner.invoke(app, ["post", words[0], str(tmp_path), *words[1:]])
    assert done.exit_code == 6
    assert str(tmp_path) in done.stderr


def test_every_command_works_while_the_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Called where the run would end: its lock is held, its frames lie in segments."""
    path = tmp_path / "run"
    codes: dict[str, int] = {}

    def look(*_arguments: object, **_options: object) -> None:
        commands = [
            "profile",
            "profile --of stress",
            "profile --of heat",
            "theta-eta --wall top",
            "map",
            "map --of stress",
            "forces",
        ]
        commands += ["forces --angles", "forces --distribution", "rheology --from 0", "energy", f"compare {path}"]
        for text in commands:
            name, *rest = text.split()
            codes[text] = runner.invoke(app, ["post", name, str(path), *rest]).exit_code

    monkeypatch.setattr(RunDirectory, "finish", look)
    write_heated_run(path)
    assert len(codes) == 12
    assert set(codes.values()) == {0}, codes


def test_runs_without_contacts_say_so(tmp_path: Path) -> None:
    write_heated_run(tmp_path / "run", contacts=False)
    for arguments in (
        ["profile", "--of", "stress"],
        ["profile", "--of", "coordination"],
        ["map", "--of", "stress"],
        ["forces", "--angles"],
    ):
        done = runner.invoke(app, ["post", arguments[0], str(tmp_path / "run"), *arguments[1:]])
        assert done.exit_code == 2
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1
        assert "contacts = true in [output]" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [["profile"], ["map", "--of", "velocity"], ["forces"], ["rheology"], ["energy"], ["theta-eta"], ["compare", "DIR"],
     ["region", "--in", "{ min = [0, 0], max = [1, 1] }"]],
)  # fmt: skip
def test_a_figure_that_is_there_is_kept(arguments: list[str], finished: Path, tmp_path: Path) -> None:
    figure = tmp_path / "figure.png"
    figure.write_text("mine")
    words = [str(finished) if word == "DIR" else word for word in arguments]
    done = runner.invoke(app, ["post", words[0], str(finished), *words[1:], "--plot", str(figure)])
    assert done.exit_code == 6
    assert figure.read_text() == "mine"
    assert f"{figure}: exists; choose another name, or give --overwrite" in done.stderr
