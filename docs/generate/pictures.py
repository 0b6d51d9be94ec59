"""How the pictures of the documentation are made: commands of a page are carried out, and what they
drew is made small.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1]


def carry_out(commands: str, folder: Path) -> None:
    """Carry out commands of a page in a folder, with this program and the scenarios of the
    repository.
    """
    (folder / "configs").symlink_to(DOCS.parent / "configs")
    program = f'multicor() {{ "{sys.executable}" -m multicor_cli "$@"; }}\n'
    subprocess.run(["bash", "-ec", program + commands], cwd=folder, check=True)


def keep_small(picture: Path, target: Path, size: int, colors: int) -> None:
    """Keep a picture, at most so many pixels wide or high and with so many colors."""
    with Image.open(picture) as image:
        small = image.convert("RGB")
        small.thumbnail((size, size))
        small.quantize(colors, dither=Image.Dither.NONE).save(target, optimize=True)
