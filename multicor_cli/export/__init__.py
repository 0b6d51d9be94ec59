"""Frames of a run in the formats of other programs.

Names are loaded when they are first used: importing this package loads none of the libraries that it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multicor_cli.export.csv_files import export_csv
    from multicor_cli.export.errors import ExportError, ExportRefused, MissingLibrary
    from multicor_cli.export.fclib_file import read_fclib, write_fclib
    from multicor_cli.export.fclib_problem import FrameProblem, export_fclib, frame_problem
    from multicor_cli.export.gsd_file import export_gsd

_HOMES = {
    "ExportError": "errors",
    "ExportRefused": "errors",
    "FrameProblem": "fclib_problem",
    "MissingLibrary": "errors",
    "export_csv": "csv_files",
    "export_fclib": "fclib_problem",
    "export_gsd": "gsd_file",
    "frame_problem": "fclib_problem",
    "read_fclib": "fclib_file",
    "write_fclib": "fclib_file",
}

__all__ = [
    "ExportError",
    "ExportRefused",
    "FrameProblem",
    "MissingLibrary",
    "export_csv",
    "export_fclib",
    "export_gsd",
    "frame_problem",
    "read_fclib",
    "write_fclib",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
