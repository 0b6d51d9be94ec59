"""The README and the pages that belong to it tell the truth: their Python runs as it stands, what
they name exists."""

import re
import subprocess
import sys

import pytest
from command_line import environment
from places import ROOT
from scenes import ONE, SMALL, changed

from multicor_cli.cli.post_commands import COMMANDS
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.particles import Start

PAGES = (
    "README.md", "docs/reference/scenario-language.md", "docs/reference/python/index.md",
    "docs/how-to/reading-files.md",
    "docs/how-to/looking-at-results.md", "docs/how-to/going-on.md",
)  # fmt: skip
README, LANGUAGE, PYTHON, FILES, RESULTS, GOING_ON = (
    (ROOT / page).read_text(encoding="utf-8") for page in PAGES
)


def test_python_example_runs(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", PYTHON, re.DOTALL)
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment(), capture_output=True,
        text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "298.1" in done.stdout  # the temperature of the walls
    results = tmp_path / "runs" / "short-shear" / "results.h5"
    assert results.exists()
    (reading,) = re.findall(r"<!-- executed -->\n```python\n(.*?)```", FILES, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", reading], cwd=results.parent, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert re.match(r"\d+ frames, the last at [\d.]+ s; mean v_x -?[\d.e-]+ m/s\n", done.stdout), (
        done.stderr
    )


def test_the_readme_is_short_and_its_variables_are_right():
    assert len(README.splitlines()) <= 134  # half of what it once was
    text, *_ = re.findall(r"```toml\n(.*?)```", LANGUAGE, re.DOTALL)
    scenario = parse_scenario(
        changed(SMALL, ("[domain]\nsize = [0.02, 0.02]\nperiodic = true\n", text)), "README.md"
    )
    assert scenario.domain.size == pytest.approx((0.06, 0.06))
    assert scenario.domain.gravity == pytest.approx((3.990, -8.962), abs=1e-3)


def test_example_of_stages_is_right():
    blocks = re.findall(r"```toml\n(.*?)```", LANGUAGE, re.DOTALL)
    stages = next(block for block in blocks if "[[loading]]" in block)
    before, after = ONE.split("[[loading]]", 1)[0], ONE[ONE.index("[solver]") :]
    walls = (
        before.replace('"floor"', '"bottom"')
        .replace('"lid"', '"top"')
        .replace("[[walls]]", "[[walls]]\nmass = 1.0")
    )
    slider = '[[walls]]\nname = "slider"\nmass = 1.0\nmaterial = "glass"\n'
    slider += 'geometry = { kind = "plane", point = [0, -1], normal = [0, 1] }\n'
    scenario = parse_scenario(walls + slider + stages + after, "README.md")
    assert [stage.name for stage in scenario.loading] == ["compact", "shake"]
    shake = scenario.drives()[1].walls
    assert shake[3].x.spring is not None
    assert shake[2].x.between == ("bottom", "top")


def test_example_of_going_on_is_right():
    (text,) = re.findall(r"```toml\n(.*?)```", GOING_ON, re.DOTALL)
    before, after = SMALL[: SMALL.index("[[particles]]")], SMALL[SMALL.index("[[walls]]") :]
    assert parse_scenario(before + text + after, "going-on.md").start == Start(
        run="runs/bed", at="end"
    )
    numbered = changed(text, ('at = "end"', "frame = 40"))
    assert parse_scenario(before + numbered + after, "going-on.md").start == Start(
        run="runs/bed", frame=40
    )


def test_what_it_names_exists():
    for path in re.findall(r"\]\(([\w./-]+)\)", README) + re.findall(
        r"`(configs/[\w-]+\.toml)`", README
    ):
        assert (ROOT / path).exists(), path
    for path in re.findall(r"python (benchmarks/[\w./]+)", README):
        assert (ROOT / path).exists(), path
    assert all(f"`{name}`" in RESULTS for name in COMMANDS)
