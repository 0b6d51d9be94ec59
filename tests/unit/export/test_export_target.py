"""Files of users beside an export are theirs, whatever they are called."""

import re

import pytest

from multicor_cli.export.target import new_directory, new_file


def test_what_lies_beside_a_target_stays(tmp_path):
    mine = {tmp_path / "table.csv.tmp": "precious", tmp_path / "frames.tmp": "precious too"}
    for path, text in mine.items():
        path.write_text(text)
    with new_file(tmp_path / "table.csv", is_overwriting=False) as file:
        file.write_text("1,2\n")
    with new_directory(
        tmp_path / "frames", re.compile(r".*\.csv"), is_overwriting=False
    ) as directory:
        (directory / "a.csv").write_text("3\n")
    with (
        pytest.raises(ZeroDivisionError),
        new_file(tmp_path / "other.csv", is_overwriting=False) as file,
    ):
        raise ZeroDivisionError
    assert {path: path.read_text() for path in mine} == mine
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "frames", "frames.tmp", "table.csv", "table.csv.tmp",
    ]  # fmt: skip
