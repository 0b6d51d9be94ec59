"""``python -m multicor_cli`` is the command ``multicor``."""

from multicor_cli.cli.app import main

if __name__ == "__main__":
    main()
