"""Pictures of the page about figures: ``python docs/generate/figures.py [RUNS]`` carries out its
commands (five minutes).

With RUNS, a directory that has the runs of the page already, only the figures are drawn.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from pictures import DOCS, carry_out, keep_small

PAGE = DOCS / "how-to" / "figures.md"
PICTURES = DOCS / "pictures" / "figures"
_COMMANDS = re.compile(r"^```sh\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_SIZE = 1000  # pixels


def main() -> None:
    """Make all pictures of the page."""
    blocks = _COMMANDS.findall(PAGE.read_text(encoding="utf-8"))
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        if len(sys.argv) > 1:
            (Path(folder) / "runs").symlink_to(Path(sys.argv[1]).resolve())
            blocks = blocks[1:]
        carry_out("".join(blocks), Path(folder))
        for picture in sorted(Path(folder).glob("*.png")):
            keep_small(picture, PICTURES / picture.name, _SIZE, 128)


if __name__ == "__main__":
    main()
