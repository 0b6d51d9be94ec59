"""The packages are as docs/explanation/architecture.md says: contracts about imports, and a table
with every package."""

import ast
import re
import subprocess
import sys
from pathlib import Path

from places import ROOT

PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
LISTED = set(re.findall(r"^\| `([\w/]+)` \|", PAGE, re.MULTILINE))
"""Packages in the table."""


def test_packages_import_what_the_contracts_allow():
    """``[tool.importlinter]`` in pyproject.toml; `lint-imports` says which import breaks which
    contract."""
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "0 broken" in done.stdout


def test_every_package_is_in_the_table():
    package = ROOT / "multicor_cli"
    packages = {
        path.parent.relative_to(package).as_posix() for path in package.rglob("__init__.py")
    } - {"."}
    modules = {path.stem for path in package.glob("*.py")} - {"__init__", "__main__"}
    assert {name for name in packages if not name.startswith("scenario/")} | modules == LISTED


def test_unit_tests_follow_the_packages():
    """What belongs to no package is in ``project``."""
    folder = ROOT / "tests" / "unit"
    assert {
        path.parent.relative_to(folder).as_posix() for path in folder.rglob("*.py")
    } <= LISTED | {"project"}


def imports_of(path, modules):
    """Modules of the package that a file names, wherever in it: for types, or when it is needed."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield name if name in modules else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_no_modules_need_each_other():
    """Whoever reads one can read what it needs first: peeled off from both ends, none is left."""
    files = sorted((ROOT / "multicor_cli").rglob("*.py"))
    modules = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in files
    }
    needs = {
        name: set(imports_of(path, modules)) & modules.keys() - {name}
        for name, path in modules.items()
    }
    while needs:
        wanted = set().union(*needs.values())
        free = {
            name
            for name, others in needs.items()
            if name not in wanted or not others & needs.keys()
        }
        assert free, f"in circles: {sorted(needs)}"
        needs = {name: others for name, others in needs.items() if name not in free}
