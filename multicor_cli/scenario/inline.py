"""Values as TOML in one line, which the library that writes TOML does not do: for ``--set``, and for examples on pages."""

from __future__ import annotations

import json
import re
from typing import Any

import tomli_w

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def in_line(value: Any) -> str:
    """A value of TOML's types in one line."""
    if isinstance(value, dict):
        entries = (f"{key if _BARE.fullmatch(key) else json.dumps(key)} = {in_line(entry)}" for key, entry in value.items())
        return f"{{ {', '.join(entries)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(in_line, value))}]"
    return tomli_w.dumps({"value": value}).removeprefix("value = ").strip()
