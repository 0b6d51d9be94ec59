"""Files of a run: segments, checkpoints, results, reading and verifying them.

Names are loaded when they are first used: importing this package loads neither numpy nor h5py.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multicor_cli.store.checkpoint import Checkpoint
    from multicor_cli.store.errors import (
        DamagedRun,
        DirectoryRefused,
        RunLocked,
        StorageError,
        StorageFull,
        StoreError,
        UnsupportedVersion,
    )
    from multicor_cli.store.frame_view import Contacts, Frame, Frames
    from multicor_cli.store.frames import ContactRows, FrameData, SeriesRow
    from multicor_cli.store.info import run_info
    from multicor_cli.store.provenance import collect_provenance
    from multicor_cli.store.reader import Run, Series, open_run
    from multicor_cli.store.rundir import RunDirectory
    from multicor_cli.store.segments import FrameWriter
    from multicor_cli.store.summary import summarize
    from multicor_cli.store.verification import Finding, verify

_HOMES = {
    "Checkpoint": "checkpoint",
    "ContactRows": "frames",
    "Contacts": "frame_view",
    "DamagedRun": "errors",
    "DirectoryRefused": "errors",
    "Finding": "verification",
    "Frame": "frame_view",
    "FrameData": "frames",
    "FrameWriter": "segments",
    "Frames": "frame_view",
    "Run": "reader",
    "RunDirectory": "rundir",
    "RunLocked": "errors",
    "Series": "reader",
    "SeriesRow": "frames",
    "StorageError": "errors",
    "StorageFull": "errors",
    "StoreError": "errors",
    "UnsupportedVersion": "errors",
    "collect_provenance": "provenance",
    "open_run": "reader",
    "run_info": "info",
    "summarize": "summary",
    "verify": "verification",
}

__all__ = [
    "Checkpoint",
    "ContactRows",
    "Contacts",
    "DamagedRun",
    "DirectoryRefused",
    "Finding",
    "Frame",
    "FrameData",
    "FrameWriter",
    "Frames",
    "Run",
    "RunDirectory",
    "RunLocked",
    "Series",
    "SeriesRow",
    "StorageError",
    "StorageFull",
    "StoreError",
    "UnsupportedVersion",
    "collect_provenance",
    "open_run",
    "run_info",
    "summarize",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
