"""The calls by which a program changes files, with hooks: to record them, or to let one fail."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

WRITES = ("open", "pwrite", "write", "ftruncate", "posix_fallocate", "fsync", "close", "fchmod")
"""Calls about a file that is open, or that open it."""

NAMES = ("replace", "rename", "unlink", "mkdir", "rmdir", "link", "symlink")
"""Calls about names in directories."""

Hook = Callable[[str, tuple[Any, ...], Callable[[], Any]], Any]
"""Gets a call's name, its arguments and what carries it out; returns what the caller gets."""


@contextmanager
def hooked(hook: Hook) -> Iterator[None]:
    """Meanwhile ``hook`` stands between this process and the calls of `WRITES` and `NAMES`."""
    before = {name: getattr(os, name) for name in (*WRITES, *NAMES)}

    def wrap(name: str) -> Callable[..., Any]:
        return lambda *args, **kwargs: hook(name, args, lambda: before[name](*args, **kwargs))

    for name in before:
        setattr(os, name, wrap(name))
    try:
        yield
    finally:
        for name, function in before.items():
            setattr(os, name, function)
