"""What goes wrong while the initial bodies are made, before it is tied to a place in the scenario file."""

from __future__ import annotations

from pathlib import Path

from multicor_cli.text import format_bytes

Key = tuple[str | int, ...]

NAMED = 5
"""So many faulty lines, rows or grains are named."""


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


def check_input(path: Path, most: int, key: Key) -> None:
    """Refuse a file from elsewhere that is not there or has more than ``most`` bytes, before memory is taken for it.

    Raises:
        PackingError: If so, with this key.
    """
    try:
        is_file, size = path.is_file(), path.stat().st_size if path.exists() else 0
    except (OSError, ValueError) as error:
        raise PackingError(f"cannot read '{path}': {error}", "give an existing file", key) from None
    if not is_file:
        raise PackingError(f"there is no file '{path}'", "give its path relative to the scenario file", key)
    if size > most:
        raise PackingError(f"'{path}' is too large ({format_bytes(size)})", f"the limit is {format_bytes(most)}", key)
