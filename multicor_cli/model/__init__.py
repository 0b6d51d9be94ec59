"""What the engine computes with: the constant `Model`, the time-varying `State`, and the energy `Books`."""

from multicor_cli.model.model import ContactLaws, Grains, Model, ShapeKind, Softening, Thermal, Walls, WallShapes
from multicor_cli.model.state import BOOK_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES, WINDOW_NAMES, State

__all__ = [
    "BOOK_NAMES",
    "HEAT_BOOK_NAMES",
    "TALLY_NAMES",
    "WINDOW_NAMES",
    "ContactLaws",
    "Grains",
    "Model",
    "ShapeKind",
    "Softening",
    "State",
    "Thermal",
    "WallShapes",
    "Walls",
]
