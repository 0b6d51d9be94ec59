"""Tables computed from a run directory."""

from multicor_cli.post.fields import FIELDS, Field
from multicor_cli.post.profile import ProfileTable, profile
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, Selection

__all__ = ["FIELDS", "Field", "FrameSource", "GrainFrame", "PostError", "ProfileTable", "Selection", "profile"]
