"""The scripts of the report page are what a linter finds nothing in, joined as the page joins
them."""

import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

from multicor_cli.report import page


def lint(script, folder):
    """Run oxlint on a script with the settings of the repository."""
    (folder / "joined.js").write_text(script, encoding="utf-8")
    command = [
        str(Path(sys.executable).with_name("oxlint")), "--config", str(ROOT / ".oxlintrc.json"),
        "--deny-warnings",
    ]  # fmt: skip
    return subprocess.run(
        [*command, str(folder / "joined.js")], capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def joined():
    folder = Path(page.__file__).parent
    return "".join((folder / name).read_text(encoding="utf-8") for name in page._SCRIPTS)


def test_no_script_is_forgotten():
    assert {path.name for path in Path(page.__file__).parent.glob("*.js")} == set(page._SCRIPTS)


def test_the_linter_finds_nothing(joined, tmp_path):
    done = lint(joined, tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    "line", ["nowhere();", "if (1 == 2) start();", "var x = 1; start(x);", "const unused = 1;"]
)
def test_it_would(joined, line, tmp_path):
    assert lint(f"{joined}\nfunction last() {{ {line} }}\nlast();\n", tmp_path).returncode != 0
