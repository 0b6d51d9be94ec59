"""What goes wrong while the initial bodies are made, before it is tied to a place in the scenario file."""

from __future__ import annotations

Key = tuple[str | int, ...]


class PackingError(ValueError):
    """A packing or a wall cannot be made as asked.

    Attributes:
        message: What is wrong, with the value.
        remedy: What to do about it.
        key: Path of the key at fault, relative to the table that is being built; empty: the table itself.
    """

    def __init__(self, message: str, remedy: str, key: Key = ()) -> None:
        super().__init__(f"{message}; {remedy}")
        self.message = message
        self.remedy = remedy
        self.key = key
