"""Pictures of the cookbook: ``python docs/generate/cookbook.py [PAGE …]`` carries out what its pages say (15 minutes)."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1]
PAGES = DOCS / "how-to" / "cookbook"
PICTURES = DOCS / "pictures" / "cookbook"
_LOOK = re.compile(r"^## Look at it\n\n```sh\n(?P<commands>.*?)^```\n", re.MULTILINE | re.DOTALL)
_SIZE = 1300  # pixels: sharp on a page and on a phone


def main() -> None:
    """Make the pictures of the pages that are named, or of all."""
    names = sys.argv[1:] or sorted(page.stem for page in PAGES.glob("*.md") if page.stem != "index")
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in names:
        found = _LOOK.search((PAGES / f"{name}.md").read_text(encoding="utf-8"))
        assert found is not None, f"{name}: has no commands under 'Look at it'"
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "configs").symlink_to(DOCS.parent / "configs")
            program = f'multicor() {{ "{sys.executable}" -m multicor_cli "$@"; }}\n'
            subprocess.run(["bash", "-ec", program + found["commands"]], cwd=folder, check=True)
            with Image.open(Path(folder) / f"{name}.png") as image:
                small = image.convert("RGB")
                small.thumbnail((_SIZE, _SIZE))
                small.quantize(96, dither=Image.Dither.NONE).save(PICTURES / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
