"""Tables computed from a run directory."""

from multicor_cli.post.fields import FIELDS, Field
from multicor_cli.post.forces import ForceNetwork, force_network
from multicor_cli.post.grain_map import MAP_FIELDS, GrainMap, MapField, grain_map
from multicor_cli.post.profile import ProfileTable, profile
from multicor_cli.post.scene import Scene, make_scene
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, Selection
from multicor_cli.post.theta_eta import ThetaTable, theta_eta

__all__ = [
    "FIELDS",
    "MAP_FIELDS",
    "Field",
    "ForceNetwork",
    "FrameSource",
    "GrainFrame",
    "GrainMap",
    "MapField",
    "PostError",
    "ProfileTable",
    "Scene",
    "Selection",
    "ThetaTable",
    "force_network",
    "grain_map",
    "make_scene",
    "profile",
    "theta_eta",
]
