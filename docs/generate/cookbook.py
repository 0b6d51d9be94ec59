"""Pictures of the cookbook: ``python docs/generate/cookbook.py [PAGE …]`` carries out what its
pages say (15 minutes).
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from pictures import DOCS, carry_out, keep_small

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
            carry_out(found["commands"], Path(folder))
            keep_small(Path(folder) / f"{name}.png", PICTURES / f"{name}.png", _SIZE, 96)


if __name__ == "__main__":
    main()
