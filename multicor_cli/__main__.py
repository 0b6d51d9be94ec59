"""``python -m multicor_cli`` is the command ``multicor``."""

from __future__ import annotations

import sys


def main() -> None:
    """Entry point of the command ``multicor``: Ctrl-C is answered from the first moment on."""
    try:
        from multicor_cli.cli.app import main as command
    except KeyboardInterrupt:
        print("multicor: interrupted before anything was done", file=sys.stderr)
        sys.exit(130)
    command()


if __name__ == "__main__":
    main()
