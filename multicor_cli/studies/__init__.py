"""Studies: many runs of one scenario from one file. Importing this package loads nothing heavy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multicor_cli.studies.computing import Watcher


def study(
    file: str | Path,
    directory: str | Path | None = None,
    *,
    client: Any = None,
    retry: bool = False,
    max_hours: float | None = None,
    watcher: Watcher | None = None,
) -> Any:
    """Compute the cases of a study that are not done yet, and give its table.

    Args:
        file: The study file.
        directory: Where runs go; default: ``studies/NAME``.
        client: A `dask.distributed.Client`; default: what the file says under ``[compute]``.
        retry: Whether cases that failed are tried again.
        max_hours: Wall-clock time after which to stop with checkpoints [h].
        watcher: Is told how it goes; default: Python's warnings are given.

    Returns:
        A pandas DataFrame with a row for each case, or, where pandas is not installed, a
        `multicor_cli.studies.table.StudyTable`.

    Raises:
        ScenarioError: The study or a case of it is wrong, or not as when the study began.
        MissingLibrary: Dask, or what the study needs else, is not installed.
        StoreError: The directory cannot be used, or another client is at work on the study.
    """
    from multicor_cli.optional import MissingLibrary
    from multicor_cli.studies.session import StudySession

    session = StudySession.open(file, directory)
    session.compute(client=client, retry=retry, max_hours=max_hours, watcher=watcher)
    table = session.table()
    try:
        return table.frame()
    except MissingLibrary:
        return table
