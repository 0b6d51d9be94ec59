"""The documentation: the site is built without a warning, and every key and command stands in
it."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
from inspect import isfunction
from pathlib import Path

import pytest
from fontTools.ttLib import TTFont

pytest.importorskip("material")
pytest.importorskip("mkdocstrings")

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "docs" / "generate"))

import performance  # noqa: E402
from commands import command_pages  # noqa: E402
from equations import math_font, set_equations  # noqa: E402
from examples import FOLDERS, examples, shortened  # noqa: E402
from keys import SINCE, key_pages  # noqa: E402

from multicor_cli import post  # noqa: E402
from multicor_cli.post.table import Table  # noqa: E402
from multicor_cli.scenario.documents import in_line  # noqa: E402

SCHEMA = json.loads((ROOT / "schema" / "multicor.schema.json").read_text(encoding="utf-8"))
TABLES = {model: table.get("properties", {}) for model, table in SCHEMA["$defs"].items()}
KEYS = [(model, key, node) for model, table in TABLES.items() for key, node in table.items()]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stderr
    return folder


def test_what_holds_for_every_page(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert "<h1" in text, page
        assert "arithmatex" not in text, page  # equations are set
        # Nothing comes from elsewhere
        loaded = re.findall(r'(?:src|<link rel="stylesheet" href)="([^"]*)', text)
        assert not [address for address in loaded if "//" in address], page
        # ``a* … a*`` would lose its asterisks
        for words in re.findall(r"<em>(.*?)</em>", text, re.DOTALL):
            assert not set("=|²·") & set(re.sub(r"<[^>]*>", "", words)), (page, words)


_OVERFLOW = """() => [
    document.documentElement.scrollWidth - document.documentElement.clientWidth,
    ...[".md-typeset__scrollwrap", ".equation"].map((kind) => [...document.querySelectorAll(kind)]
        .filter((part) => part.scrollWidth > part.clientWidth + 2).length),
]"""


@pytest.mark.browser
def test_pages_fit_their_window(site):
    """No page scrolls sideways; tables and equations do, in themselves, on small screens only."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("needs chromium")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page()
        for path in sorted(site.rglob("*.html")):
            if path.is_relative_to(site / "repository"):
                continue
            page.goto(path.as_uri())
            for width in (1400, 768, 360):
                page.set_viewport_size({"width": width, "height": 900})
                sideways, tables, equations = page.evaluate(_OVERFLOW)
                assert sideways <= 0, (path, width)
                assert width < 1400 or tables == 0, path
                assert width < 768 or equations == 0, (path, width)
        browser.close()


def test_equations_are_set(site):
    theory = (site / "explanation" / "theory.html").read_text(encoding="utf-8")
    assert theory.count("<math") > 10
    assert (site / "pictures" / "math.woff").read_bytes().startswith(b"wOFF")


def test_equations_look_as_tex_sets_them():
    """Browsers put no space around the names of functions, and draw the sign of a root without that
    it stands in the text."""
    equations = r"\(a \sin\alpha + \sin(x) + \dot x\)", r"\(\sqrt 2\)"
    page = ", as ".join(f'<span class="arithmatex">{equation}</span>' for equation in equations)
    found = set_equations(page)
    space = '<mspace width="0.167em"></mspace>'
    assert f"<mi>a</mi>{space}" in found
    # Around the first function; the other one has a + and a parenthesis beside it
    assert found.count(space) == 2
    assert '<span class="unbroken"><math' in found
    font = TTFont(io.BytesIO(math_font([found])))
    assert ord("√") in font.getBestCmap()


def test_an_equation_that_is_no_tex_is_refused():
    with pytest.raises(ValueError, match=r"no equation.*frac"):
        set_equations(r'<p><span class="arithmatex">\(\frac{1\)</span></p>')


@pytest.mark.parametrize(
    ("model", "key", "node"), KEYS, ids=[f"{model}.{key}" for model, key, _ in KEYS]
)
def test_every_key_says_what_it_is_and_is_used_in_a_scenario_that_loads(model, key, node):
    assert key == "kind" or node.get("description")
    assert (model, key) in examples()


def test_every_key_and_command_stands_on_a_page():
    text = "\n".join(key_pages().values())
    assert [key for _, key, _ in KEYS if f"### `{key}`" not in text] == []
    assert text.count(f"since {SINCE}") == len(KEYS)
    for table in SCHEMA["properties"]:
        assert f"reference/scenario/{table}.md" in key_pages()
    pages = command_pages()
    assert {"reference/commands/run.md", "reference/commands/post.md"} < set(pages)
    assert "`--max-hours`" in pages["reference/commands/run.md"]
    assert "## rheology" in pages["reference/commands/post.md"]
    assert "| 75 | time limit reached" in pages["reference/commands/index.md"]


def test_every_table_and_what_makes_it_stand_on_the_page_of_python():
    face = (ROOT / "multicor_cli" / "post" / "__init__.pyi").read_text(encoding="utf-8")
    found = {name: getattr(post, name) for name in re.findall(r" as (\w+)", face)}
    tables = {name for name, it in found.items() if isinstance(it, type) and issubclass(it, Table)}
    makers = {
        name
        for name, it in found.items()
        if isfunction(it) and tables & {*re.findall(r"\w+", it.__annotations__["return"])}
    }
    page = (ROOT / "docs" / "reference" / "python" / "post.md").read_text(encoding="utf-8")
    assert len(makers) > 30
    assert tables | makers <= {*re.findall(r"^::: [\w.]+\.(\w+)$", page, re.MULTILINE)}


def test_values_are_written_as_toml_and_keys_say_their_units():
    deep = {"x": 1e-9, "third": 1.0 / 3.0}
    value = {"walls": ("a", "b"), "value": 1.0, "on": True, "n": 3, "deep": deep}
    written = '{ walls = ["a", "b"], value = 1.0, on = true, n = 3, deep = { x = 1e-09, third = 0.333333 } }'
    assert in_line(shortened(value)) == written
    page = key_pages()["reference/scenario/contacts.md"]
    assert "number · [N] · 0 to 1e+12" in page
    assert "number · 0 to 1 · default `0.0`" in page
    assert "**required**" in page


def test_examples_and_figures_come_from_files_that_are_there():
    for example in examples().values():
        assert (ROOT / example.file).is_file()
        assert example.file.startswith(FOLDERS)
    assert performance.digest() in performance.FIGURE.read_text(encoding="utf-8")


def test_recorded_validation_holds_every_long_test():
    page = (ROOT / "docs" / "explanation" / "recorded-validation.md").read_text(encoding="utf-8")
    tests = [path for path in (ROOT / "tests").rglob("test_*.py") if path.name != "test_site.py"]
    marked = [path for path in tests if "mark.validation" in path.read_text(encoding="utf-8")]
    names = [path.relative_to(ROOT).as_posix() for path in marked]
    assert [name for name in names if f"`{name}`" not in page] == []
    assert "failed**" not in page
    assert len(marked) > 10
