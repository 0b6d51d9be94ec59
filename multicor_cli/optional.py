"""Libraries of extras: whatever needs one gets it here, or is told what to install."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple


class Library(NamedTuple):
    """A library that not every installation has.

    Attributes:
        name: What it is called where packages come from.
        extra: The extra of this package that brings it.
        use: What is not to be had without it, in the plural.
    """

    name: str
    extra: str
    use: str

    @property
    def remedy(self) -> str:
        """How to install it."""
        return f"pip install 'multicor-cli[{self.extra}]'"


LIBRARIES = {
    "matplotlib": Library("matplotlib", "plots", "figures"),
    "gsd": Library("gsd", "gsd", "GSD files"),
    "dask": Library("dask", "study", "clusters"),
    "distributed": Library("distributed", "study", "clusters"),
    "dask_jobqueue": Library("dask-jobqueue", "study", "jobs on a cluster"),
    "cryptography": Library("cryptography", "study", "jobs on a cluster"),
    "scipy": Library("scipy", "plots", "drawn points, fits, networks and survival"),
    "pandas": Library("pandas", "study", "DataFrames"),
    "pyarrow": Library("pyarrow", "study", "Parquet files"),
    "shapely": Library("shapely", "shapes", "outlines in WKT and GeoJSON"),
}
"""By the name under which each is imported."""


class MissingLibrary(ImportError):
    """A library that is needed is not installed, or cannot be loaded (exit code 5)."""

    exit_code = 5


def library(module: str) -> Any:
    """A module of one of `LIBRARIES`, as ``scipy.stats``; raises `MissingLibrary`."""
    top = module.partition(".")[0]
    wanted = LIBRARIES[top]
    try:
        return import_module(module)
    except ImportError as error:
        is_missing = (
            isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] == top
        )
        why = "which is not installed" if is_missing else f"which cannot be loaded ({error})"
        raise MissingLibrary(f"{wanted.use} need {wanted.name}, {why}: {wanted.remedy}") from error
