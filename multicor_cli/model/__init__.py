"""What the engine computes with: the constant `Model` and the time-varying `State`."""

from multicor_cli.model.books import (
    BOOK_NAMES,
    EXCHANGE_NAMES,
    HEAT_BOOK_NAMES,
    TALLY_NAMES,
    WINDOW_NAMES,
)
from multicor_cli.model.model import ContactLaws, Grains, Model, Thermal, Walls, WallShapes
from multicor_cli.model.shapes import ShapeKind, WallBody
from multicor_cli.model.state import Presence, State

__all__ = [
    "BOOK_NAMES", "EXCHANGE_NAMES", "HEAT_BOOK_NAMES", "TALLY_NAMES", "WINDOW_NAMES", "ContactLaws",
    "Grains", "Model", "Presence", "ShapeKind", "State", "Thermal", "WallBody", "WallShapes",
    "Walls",
]  # fmt: skip
