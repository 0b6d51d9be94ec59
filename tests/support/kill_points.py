"""The points of commits at which `multicor_cli.store.atomic.kill_point` can kill the process:
``LABEL.POINT``, or ``LABEL.POINT:N`` for the N-th time that it is passed."""

COMMIT = ("mid_tmp", "after_tmp", "before_rename", "after_rename")
FILES = ("runjson", "scenario", "model", "segment", "checkpoint", "results", "checkpointjson")
POINTS = (
    *(f"{label}.{point}" for label in FILES for point in COMMIT),
    "manifest.torn:2", "manifest.after_append:2", "checkpoint.before_prune:3",
    "cleanup.before", "cleanup.mid:2",
    "segment.after_rename:2", "checkpoint.before_rename:3", "checkpointjson.before_rename:2",
    "runjson.after_rename:2",
    "runjson.before_rename:3", "runjson.before_rename:6", "runjson.before_rename:7",
    "scenario.before_rename:2",
)  # fmt: skip

_MOST = ("mid_tmp", "before_rename", "after_rename")
EXTENSION_POINTS = (
    "model.before_rename", "segment.mid_tmp", "segment.after_rename", "manifest.torn",
    "manifest.after_append",
    *(f"{label}.{point}" for label in ("checkpoint", "checkpointjson") for point in _MOST),
    "checkpoint.before_prune",
    *(f"scenario.{point}:{number}" for number in (1, 2, 3, 4) for point in _MOST),
    "extension.before", "runjson.mid_tmp", "runjson.before_rename", "runjson.after_rename",
    "extension.after",
    "runjson.before_rename:2", "segment.after_rename:3", "results.before_rename",
    "results.after_rename", "cleanup.mid",
)  # fmt: skip
"""Those that are passed while stages are added to a finished run, and carried out."""
