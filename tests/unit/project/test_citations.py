"""Whatever the repository cites is in it: sections of the theory, files and headings behind links,
no private documents."""

import re
from pathlib import Path

import pytest
from places import ROOT

FOLDERS = (".ci", "benchmarks", "configs", "docs", "multicor_cli", "schema", "tests")
ENDINGS = {"", ".c", ".css", ".html", ".js", ".json", ".md", ".py", ".pyi", ".sh", ".toml"}
THEORY = "docs/explanation/theory.md"
GENERATED = {"scenario", "commands"}  # folders of pages that are made when the site is built
THIS = "tests/unit/project/test_citations.py"  # holds what it forbids

SECTION = r"§\d+(?:\.\d+)?"
CITATION = re.compile(rf"\btheory(?:\.md)?\s+({SECTION}(?:(?:,| and)\s+{SECTION})*)")
PRIVATE = re.compile(r"\b(?:design|physics|ecosystem|peers|style)\.md\b|\bcheckvalues\b")
LINK = re.compile(r"\]\(([^)\s]+)\)")


def repository(root):
    """Text files of the repository by path relative to its root."""
    paths = [
        *root.iterdir(),
        *(path for each in FOLDERS for path in sorted((root / each).rglob("*"))),
    ]
    texts = {}
    for path in paths:
        inside = path.relative_to(root)
        is_hidden = any(part.startswith(".") and part != ".ci" for part in inside.parts)
        if path.is_file() and path.suffix in ENDINGS and not is_hidden:
            texts[inside.as_posix()] = path.read_text(encoding="utf-8", errors="replace")
    return texts


def without_code(text):
    """Markdown without fenced blocks, where ``#`` begins a comment."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def sections(theory):
    """Numbers of the headings of a document: ``## 5 …``, ``### 5.3 …``."""
    return set(re.findall(r"^#{2,3} (\d+(?:\.\d+)?) ", without_code(theory), re.MULTILINE))


def anchors(text):
    """Anchors of the headings of a Markdown file, as GitHub makes them."""
    found = {}
    for heading in re.findall(r"^#{1,6} (.+?)\s*$", without_code(text), re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        found[slug] = found.get(slug, -1) + 1
        if found[slug]:
            found[f"{slug}-{found[slug]}"] = 0
    return set(found)


def wrong_citations(texts):
    """Citations of sections or documents that do not exist."""
    known = sections(texts[THEORY])
    faults = []
    for name, text in texts.items():
        if name == THIS:
            continue
        is_theory = name == THEORY
        cited = text if is_theory else " ".join(CITATION.findall(text))
        numbers = re.findall(r"§(\d+(?:\.\d+)?)", cited)
        others = re.findall(r".{0,20}§.{0,5}", "" if is_theory else CITATION.sub("", text))
        found = [f"theory §{number}" for number in numbers if number not in known]
        found += [f"a section of what? …{other}" for other in others] + PRIVATE.findall(text)
        faults += [f"{name}: {each}" for each in found]
    return faults


def wrong_links(root, texts):
    """Relative links of Markdown files that lead to no file, or to no heading of it."""
    faults = []
    for name, text in texts.items():
        if not name.endswith(".md"):
            continue
        for link in LINK.findall(without_code(text)):
            target, _, anchor = link.partition("#")
            path = root / Path(name).parent / target if target else root / name
            if "://" in link or link.startswith("mailto:"):
                continue
            in_reference = path.resolve().is_relative_to(root / "docs" / "reference")
            if in_reference and path.parent.name in GENERATED:
                continue  # the site has them, and is built by a test of its own
            if not path.exists():
                faults.append(f"{name}: {link}")
                continue
            known = anchors(path.read_text(encoding="utf-8")) if path.suffix == ".md" else ()
            if anchor and anchor not in known:
                faults.append(f"{name}: {link} (no such heading)")
    return faults


@pytest.fixture(scope="module")
def texts():
    return repository(ROOT)


def test_what_is_cited_and_linked_exists(texts):
    assert {"README.md", "CHANGELOG.md", "pyproject.toml", ".ci/run", THEORY, THIS} <= texts.keys()
    assert len(texts) > 400
    assert {"1", "5.3", "15.4"} <= sections(texts[THEORY])
    assert sum(len(CITATION.findall(text)) for text in texts.values()) > 20
    assert sum(len(LINK.findall(text)) for name, text in texts.items() if name.endswith(".md")) > 30
    assert wrong_citations(texts) == []
    assert wrong_links(ROOT, texts) == []


GOOD = {
    THEORY: (
        "# Theory\n## 1 Bodies\nSee §2.1.\n## 2 Steps\n### 2.1 Walls\n```sh\n## 9 no heading\n"
        "```\n[1](#1-bodies), [2](heat.md#what-s-it)\n"
    ),
    "docs/explanation/heat.md": "# Heat\n## What `s-it`?\n[up](../../README.md) [web](https://example.org/no.md)\n",
    "README.md": (
        "[theory](docs/explanation/theory.md#21-walls) [folder](docs)\n```python\n"
        "frames[0](no.md)\n```\n"
    ),
    "multicor_cli/a.py": '"""As in theory §1 and §2.1 (theory.md\n§2), redesign."""\n',
}


def faults_of(tmp_path, name="README.md", more=""):
    """What is found in a small repository with something added to one of its files."""
    for path, text in GOOD.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text + (more if path == name else ""), encoding="utf-8")
    found = repository(tmp_path)
    assert found.keys() == GOOD.keys()
    return wrong_citations(found) + wrong_links(tmp_path, found)


def test_a_right_repository_passes(tmp_path):
    assert faults_of(tmp_path) == []


CODE, HEAT = "multicor_cli/a.py", "docs/explanation/heat.md"


@pytest.mark.parametrize(("name", "more", "fault"), [
    (CODE, "# theory §3\n", "theory §3"),
    (CODE, "# theory §1, §2.2\n", "theory §2.2"),
    (CODE, "# theory §9\n", "theory §9"),
    (CODE, "# the rule (design §2)\n", "a section of what? …# the rule (design §2)"),
    (CODE, "# of physics.md\n", "physics.md"),
    (CODE, "# see checkvalues.py\n", "checkvalues"),
    (THEORY, "As §4 says.\n", "theory §4"),
    ("README.md", "[a](docs/none.md)\n", "docs/none.md"),
    (HEAT, "[a](docs/explanation/heat.md)\n", "docs/explanation/heat.md"),
    (HEAT, "[a](theory.md#walls)\n", "theory.md#walls (no such heading)"),
    (HEAT, "[a](#9-no-heading)\n", "#9-no-heading (no such heading)"),
])  # fmt: skip
def test_every_fault_is_found(tmp_path, name, more, fault):
    assert faults_of(tmp_path, name, more) == [f"{name}: {fault}"]
