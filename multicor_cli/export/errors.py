"""What can go wrong with an export, beside reading the run and writing the file; each class carries its exit code."""

from __future__ import annotations

from multicor_cli.optional import MissingLibrary as MissingLibrary
from multicor_cli.store.errors import StoreError


class ExportError(StoreError):
    """The run does not hold what was asked for (exit code 2)."""

    exit_code = 2


class ExportRefused(StoreError):
    """The target exists, or is not one that an export may replace (exit code 6)."""

    exit_code = 6
