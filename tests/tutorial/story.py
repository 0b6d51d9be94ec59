"""The pages of the tutorial as one story: their commands, executed in order in one directory, and
what they print."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "tutorial"
PAGES = ("shear", "change", "heat", "many-runs", "own-problem")
"""In the order in which they are read; the index only says how to install the program."""

_BLOCK = re.compile(
    r"^```sh\n(?P<commands>.*?)^```\n(?:\n```text\n(?P<printed>.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
_PICTURE = re.compile(r"!\[[^\]]*\]\(pictures/([^)]+)\)")
_CLAIM = re.compile(r"\*\*(−?[\d.,]+)\*\*")
_OWN = [
    re.compile(pattern)
    for pattern in (
        r"^(wall time\s+).*",
        r"^(memory\s+).*",
        r"^(disk\s+).*",
        r"^(\(rough, ).*",
        r"^(\d+ grains, \d+ walls, ).*",
        r"^(ok\s+(?:memory|disk)\s+).*",
        r"^(.*finished .* (?:ok|warning)  ) *\d+\.\d+$",
    )
]
"""Beginnings of lines of which the rest is the machine's own."""

_HOURS = re.compile(r"(verdict) +hours\n( ?─{70})─*\n")
"""Head of a table whose last column is as wide as the hours that a machine takes."""

_PASSING = re.compile(
    r"^( *\d+\.\d %  |writing |packing |making |frame \d+ of |case \d+ of |grains \d+ of ).*"
)
"""Lines that come or not, as time goes by."""


_WIDTH = 1200  # pixels of a picture


@dataclass(frozen=True)
class Block:
    """Commands of a page, and what it says that they print (None: it says nothing)."""

    commands: str
    printed: str | None


def blocks(text: str) -> list[Block]:
    """The blocks of commands of a page."""
    return [Block(found["commands"], found["printed"]) for found in _BLOCK.finditer(text)]


def pictures(text: str) -> list[str]:
    """Names of the pictures that a page shows, each made by its commands."""
    return _PICTURE.findall(text)


def claims(text: str) -> list[str]:
    """Bold numbers in the prose of a page: each has been printed on it."""
    return [found.replace("−", "-") for found in _CLAIM.findall(_BLOCK.sub("", text))]


def perform(commands: str, directory: Path) -> str:
    """What commands print, on either stream, with ``...`` for what is the machine's own; a failure
    with its exit code."""
    programs = directory / ".programs"
    if not programs.exists():
        programs.mkdir()
        program = programs / "multicor"
        program.write_text(
            f'#!/bin/sh\nexec "{sys.executable}" -m multicor_cli "$@"\n', encoding="utf-8"
        )
        program.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{programs}:{os.environ['PATH']}",
        "PYTHONPATH": f"{ROOT}:{os.environ.get('PYTHONPATH', '')}",
        "COLUMNS": "120",
        "NO_COLOR": "1",
    }
    done = subprocess.run(
        ["bash", "-eo", "pipefail", "-c", commands], cwd=directory, env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    lines = [
        _masked(line.rstrip()) for line in done.stdout.splitlines() if not _PASSING.match(line)
    ]
    if done.returncode:
        lines.append(f"exit code {done.returncode}")
    return _HOURS.sub(r"\1  hours\n\2\n", "\n".join(lines).strip("\n") + "\n")


def _masked(line: str) -> str:
    for pattern in _OWN:
        if found := pattern.match(line):
            return f"{found[1]}..."
    return line


def write(page: str, directory: Path) -> None:
    """Write what the commands of a page print, and its pictures, into the documentation."""
    path = FOLDER / f"{page}.md"
    text = path.read_text(encoding="utf-8")

    def renewed(found: re.Match[str]) -> str:
        printed = perform(found["commands"], directory)
        if found["printed"] is None:
            return found[0]
        return f"```sh\n{found['commands']}```\n\n```text\n{printed}```\n"

    path.write_text(_BLOCK.sub(renewed, text), encoding="utf-8")
    (FOLDER / "pictures").mkdir(exist_ok=True)
    for name in pictures(text):
        _shrink(directory / name, FOLDER / "pictures" / name)


def _shrink(picture: Path, target: Path) -> None:
    """A picture small enough for a repository: as wide as a column of the site, with few colors."""
    from PIL import Image

    with Image.open(picture) as image:
        small = image.convert("RGB")
        small.thumbnail((_WIDTH, _WIDTH))
        small.quantize(96, dither=Image.Dither.NONE).save(target, optimize=True)
