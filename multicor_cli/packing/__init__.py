"""From a scenario to the initial `Model` and `State`."""

from multicor_cli.packing.build import build

__all__ = ["build"]
