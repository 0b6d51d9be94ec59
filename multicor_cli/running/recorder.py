"""From the controller to the files of a run directory."""

from __future__ import annotations

from typing import Any

from multicor_cli.engine.contact.report import PhysicsError
from multicor_cli.model import State
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.faults import find_absurd_value
from multicor_cli.store.moment import Moment
from multicor_cli.store.rundir import RunDirectory
from multicor_cli.store.segments import FrameWriter
from multicor_cli.store.stage_ends import StageEnd


class DirectoryRecorder:
    """Writes what the controller says into a run directory."""

    def __init__(self, directory: RunDirectory, writer: FrameWriter) -> None:
        self._directory = directory
        self._writer = writer

    def frame(self, state: State, contacts: ContactTable | None) -> None:
        """Write a frame; without contacts if they are not recorded. Raises as `checkpoint` does."""
        self._require_sound(state)
        self._writer.frame(Moment(state, self._writer.model, contacts))

    def series(self, state: State) -> None:
        """Write the row of the time series that ends the window of ``state``; raises as `frame` does."""
        self._require_sound(state)
        self._writer.series_row(Moment(state, self._writer.model))

    def stage_ended(self, end: StageEnd) -> None:
        """Note how a stage ended, for ``run.json``."""
        self._directory.stage_ended(end)

    def checkpoint(self, state: State) -> None:
        """Commit the output so far, then the state.

        Raises:
            StoreError: If something cannot be written.
            PhysicsError: If the state holds a value that is not finite or absurd: what is on disk stays right.
        """
        self._require_sound(state)
        self._directory.checkpoint(state, self._writer)

    def heartbeat(self, data: dict[str, Any]) -> None:
        """Replace ``progress.json``."""
        self._directory.progress(data)

    def _require_sound(self, state: State) -> None:
        fault = find_absurd_value(state, self._writer.model)
        if fault is not None:
            raise PhysicsError(state.step, fault)
