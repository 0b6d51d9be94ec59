"""The tutorial says what its commands print: they are executed, page by page, in one directory."""

import difflib

import pytest
from story import FOLDER, PAGES, blocks, claims, perform, pictures

pytest.importorskip("matplotlib")
pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    return tmp_path_factory.mktemp("tutorial")


@pytest.mark.parametrize("page", PAGES)
def test_a_page_says_what_its_commands_print(page, directory):
    text = (FOLDER / f"{page}.md").read_text(encoding="utf-8")
    everything = ""
    for block in blocks(text):
        printed = perform(block.commands, directory)
        everything += printed
        if block.printed is not None:
            said, found = block.printed.splitlines(), printed.splitlines()
            changes = list(difflib.unified_diff(said, found, lineterm=""))
            assert said == found, "\n".join(["python tests/tutorial writes it anew", *changes])
        else:
            assert "exit code" not in printed, printed
    for name in pictures(text):
        assert (directory / name).stat().st_size > 1000, name
        assert (FOLDER / "pictures" / name).is_file(), name
    for number in claims(text):
        assert number in everything, f"{number}: nothing on the page prints it"


def test_every_page_is_executed():
    assert {path.stem for path in FOLDER.glob("*.md")} == {*PAGES, "index"}


def test_a_page_that_says_something_else_is_noticed(directory):
    assert (
        perform("echo wall time 3 s; echo 'wall time   3 s'; false", directory)
        == "wall time ...\nwall time   ...\nexit code 1\n"
    )
    [block] = blocks("```sh\necho 1\n```\n\n```text\n2\n```\n")
    assert perform(block.commands, directory) != block.printed
    assert claims("**0.25** and\n```sh\necho **3**\n```\n") == ["0.25"]
