"""Pictures of the page about figures: ``python docs/generate/figures.py [RUNS]`` carries out its commands (five minutes).

With RUNS, a directory that has the runs of the page already, only the figures are drawn.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1]
PAGE = DOCS / "how-to" / "figures.md"
PICTURES = DOCS / "pictures" / "figures"
_COMMANDS = re.compile(r"^```sh\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_SIZE = 1000  # pixels


def main() -> None:
    """Make all pictures of the page."""
    blocks = _COMMANDS.findall(PAGE.read_text(encoding="utf-8"))
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "configs").symlink_to(DOCS.parent / "configs")
        if len(sys.argv) > 1:
            (Path(folder) / "runs").symlink_to(Path(sys.argv[1]).resolve())
            blocks = blocks[1:]
        program = f'multicor() {{ "{sys.executable}" -m multicor_cli "$@"; }}\n'
        subprocess.run(["bash", "-ec", program + "".join(blocks)], cwd=folder, check=True)
        for picture in sorted(Path(folder).glob("*.png")):
            with Image.open(picture) as image:
                small = image.convert("RGB")
                small.thumbnail((_SIZE, _SIZE))
                small.quantize(128, dither=Image.Dither.NONE).save(PICTURES / picture.name, optimize=True)


if __name__ == "__main__":
    main()
