"""Modules of the benchmarks for tests."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType

from places import ROOT


class Modules:
    """Modules by their names, loaded when they are asked for."""

    def __getattr__(self, name: str) -> ModuleType:
        return import_module(name)


@contextmanager
def benchmark_modules(name: str) -> Iterator[Modules]:
    """Modules of ``benchmarks/name``, run as a folder, can be imported by plain names meanwhile."""
    folder = ROOT / "benchmarks" / name
    plain = {path.stem for path in folder.iterdir()} - {"__main__"}

    def loaded() -> list[str]:
        return [module for module in sys.modules if module.partition(".")[0] in plain]

    before = {module: sys.modules.pop(module) for module in loaded()}
    sys.path.insert(0, str(folder))
    try:
        yield Modules()
    finally:
        sys.path.remove(str(folder))
        for module in loaded():
            del sys.modules[module]
        sys.modules.update(before)
