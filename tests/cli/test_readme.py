"""The README tells the truth: its Python runs as it stands there, and the commands and files that it names exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import environment
from places import ROOT
from scenes import SMALL, changed

from multicor_cli.cli.post_commands import COMMANDS
from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.start import Start

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_python_example_runs(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "298.1" in done.stdout  # the temperature of the walls
    assert (tmp_path / "runs" / "short-shear" / "results.h5").exists()


def _toml_examples() -> list[str]:
    found: list[str] = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    return found


def test_example_of_a_run_that_goes_on_is_right() -> None:
    _, text = _toml_examples()
    begin, end = SMALL.index("[[particles]]"), SMALL.index("[[walls]]")
    scenario = parse_scenario(SMALL[:begin] + text + SMALL[end:], "README.md")
    assert scenario.start == Start(run="runs/bed", at="end")
    assert parse_scenario(SMALL[:begin] + text.replace('at = "end"', "frame = 40") + SMALL[end:], "README.md").start is not None


def test_example_of_variables_is_right() -> None:
    text, _ = _toml_examples()
    scenario = parse_scenario(changed(SMALL, ("[domain]\nsize = [0.02, 0.02]\nperiodic = true\n", text)), "README.md")
    assert scenario.domain.size == pytest.approx((0.06, 0.06))
    assert scenario.domain.gravity == pytest.approx((3.990, -8.962), abs=1e-3)


def test_what_it_names_exists() -> None:
    for path in re.findall(r"\]\(([\w./-]+)\)", README) + re.findall(r"`(configs/[\w-]+\.toml)`", README):
        assert (ROOT / path).exists(), path
    for path in re.findall(r"python (benchmarks/[\w./]+)", README):
        assert (ROOT / path).exists(), path
    assert all(f"`{name}`" in README for name in COMMANDS)
