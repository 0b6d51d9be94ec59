"""The page about going on from a run tells the truth: its example is one."""

from __future__ import annotations

import re

from places import ROOT
from scenes import SMALL

from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.particles import Start

PAGE = (ROOT / "docs" / "how-to" / "going-on.md").read_text(encoding="utf-8")


def test_example_is_right() -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    begin, end = SMALL.index("[[particles]]"), SMALL.index("[[walls]]")
    scenario = parse_scenario(SMALL[:begin] + text + SMALL[end:], "going-on.md")
    assert scenario.start == Start(run="runs/bed", at="end")
    assert parse_scenario(SMALL[:begin] + text.replace('at = "end"', "frame = 40") + SMALL[end:], "going-on.md").start is not None
