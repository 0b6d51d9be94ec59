"""``python -m multicor_cli`` is the command ``multicor``."""

from __future__ import annotations

import gc
import sys

GARBAGE = 50_000
"""New objects after which garbage is looked for. What is imported stays: looking through it after
every 700 objects, as Python does, takes a tenth of a short command."""


def main() -> None:
    """Entry point of the command ``multicor``: Ctrl-C is answered from the first moment on."""
    gc.set_threshold(GARBAGE)
    try:
        from multicor_cli.cli.app import main as command
    except KeyboardInterrupt:
        print("multicor: interrupted before anything was done", file=sys.stderr)
        sys.exit(130)
    command()


if __name__ == "__main__":
    main()
