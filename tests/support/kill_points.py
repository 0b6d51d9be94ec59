"""The points of commits at which `multicor_cli.store.atomic.kill_point` can kill the process."""

from __future__ import annotations

COMMIT = ("mid_tmp", "after_tmp", "before_rename", "after_rename")
POINTS = (
    *(
        f"{label}.{point}"
        for label in ("runjson", "scenario", "model", "segment", "checkpoint", "results")
        for point in COMMIT
    ),
    *(f"checkpointjson.{point}" for point in COMMIT),
    *(
        "manifest.torn:2",
        "manifest.after_append:2",
        "checkpoint.before_prune:3",
        "cleanup.before",
        "cleanup.mid:2",
    ),
    *(
        "segment.after_rename:2",
        "checkpoint.before_rename:3",
        "checkpointjson.before_rename:2",
        "runjson.after_rename:2",
    ),
    *(
        "runjson.before_rename:3",
        "runjson.before_rename:6",
        "runjson.before_rename:7",
        "scenario.before_rename:2",
    ),
)
"""``LABEL.POINT``, or ``LABEL.POINT:N`` for the N-th time that it is passed."""
