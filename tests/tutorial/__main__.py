"""``python tests/tutorial``: executes the tutorial and writes what its commands print, and its
pictures, into its pages."""

import tempfile
import time
from pathlib import Path

from story import PAGES, write


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for page in PAGES:
            started = time.monotonic()
            write(page, Path(folder))
            print(f"{page}: {time.monotonic() - started:.0f} s")


if __name__ == "__main__":
    main()
