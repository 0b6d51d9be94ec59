"""Tables computed from a run directory, each in a module of its own; these are at hand here."""

from multicor_cli.post.compare import Comparison, ProfilePair, compare
from multicor_cli.post.crossings import FlowTable, flow_through
from multicor_cli.post.energy import EnergyTable, SeriesTable, energy, series
from multicor_cli.post.fields import FieldTable, fields
from multicor_cli.post.forces import (
    AngularDistribution,
    ForceDistribution,
    ForceNetwork,
    angular_distribution,
    force_distribution,
    force_network,
)
from multicor_cli.post.grain_map import GrainMap, GrainScene, grain_map, make_scene
from multicor_cli.post.profile import ProfileSet, ProfileTable, profile, profiles
from multicor_cli.post.quantities import MAPPED, PROFILE_GROUPS, PROFILED, QUANTITIES, GrainQuantity
from multicor_cli.post.region import RegionTable, in_region
from multicor_cli.post.rheology import Rheology, rheology
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, Selection, frame_index
from multicor_cli.post.table import Column, Quantity, Table
from multicor_cli.post.theta_eta import ThetaTable, theta_eta

__all__ = [
    "MAPPED",
    "PROFILED",
    "PROFILE_GROUPS",
    "QUANTITIES",
    "AngularDistribution",
    "Column",
    "Comparison",
    "EnergyTable",
    "FieldTable",
    "FlowTable",
    "ForceDistribution",
    "ForceNetwork",
    "FrameSource",
    "GrainFrame",
    "GrainMap",
    "GrainQuantity",
    "GrainScene",
    "PostError",
    "ProfilePair",
    "ProfileSet",
    "ProfileTable",
    "Quantity",
    "RegionTable",
    "Rheology",
    "Selection",
    "SeriesTable",
    "Table",
    "ThetaTable",
    "angular_distribution",
    "compare",
    "energy",
    "fields",
    "flow_through",
    "force_distribution",
    "force_network",
    "frame_index",
    "grain_map",
    "in_region",
    "make_scene",
    "profile",
    "profiles",
    "rheology",
    "series",
    "theta_eta",
]
