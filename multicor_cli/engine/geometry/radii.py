"""Radii of pairs of shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.shapes import ShapeKind

if TYPE_CHECKING:
    from multicor_cli.engine.geometry.scene import Scene

_DISC, _CIRCLE = int(ShapeKind.DISC), int(ShapeKind.CIRCLE)

LARGEST_CUP = 100.0
"""Largest radius of contact in a circle over the grain's. Beyond (R < 1.01 a) the bodies lie on
each other over much of the grain: no spot is small against it, as Hertz' formulas need."""


@formula
def effective_radius(a_i: float, a_j: float) -> float:
    """Effective radius ``a* = a_i a_j/(a_i + a_j)`` [m]; on a plane wall it is a_i (Hertz)."""
    return a_i * a_j / (a_i + a_j)


@formula
def other_radius(scene: Scene, j: int) -> float:
    """Radius of the second body of a pair [m]; 0 for lines and circles."""
    shape = j - scene.radius.size
    if shape < 0:
        return scene.radius[j]
    return scene.world[shape, RADIUS] if scene.kind[shape] == _DISC else 0.0


@formula
def surface_turning(scene: Scene, j: int, speed: float) -> float:
    """How fast the material of a wall shape turns whose surface runs at ``speed`` [rad/s].

    Counter-clockwise. Round a disc it turns as the disc would, along the inside of a circle the
    other way; a straight line does not turn it.
    """
    shape = j - scene.radius.size
    if speed == 0.0 or not (scene.kind[shape] == _DISC or scene.kind[shape] == _CIRCLE):
        return 0.0
    return (speed if scene.kind[shape] == _DISC else -speed) / scene.world[shape, RADIUS]


@formula
def pair_radius(scene: Scene, i: int, j: int) -> float:
    """a* of a pair [m]; a* = a_i at lines and circles."""
    other = other_radius(scene, j)
    return effective_radius(scene.radius[i], other) if other > 0.0 else scene.radius[i]


@formula
def cup_radius(a: float, circle: float) -> float:
    """``1/a* = 1/a − 1/R`` in a circle [m] (Johnson, eq. 4.3, concave); at most `LARGEST_CUP` a."""
    room = (circle - a) / circle
    return a / room if room * LARGEST_CUP > 1.0 else LARGEST_CUP * a


@formula
def hertz_radius(scene: Scene, i: int, j: int) -> float:
    """a* of an elastic contact [m]: as `pair_radius`, but a circle is as hollow as it is."""
    shape = j - scene.radius.size
    if shape >= 0 and scene.kind[shape] == _CIRCLE:
        return cup_radius(scene.radius[i], scene.world[shape, RADIUS])
    return pair_radius(scene, i, j)


@formula
def smaller_radius(scene: Scene, i: int, j: int) -> float:
    """Smaller radius of a pair [m]; that of the grain at lines and circles."""
    other = other_radius(scene, j)
    return min(scene.radius[i], other) if other > 0.0 else scene.radius[i]


@formula
def smaller_of(scene: Scene, i: int, j: int) -> float:
    """The smaller radius of two grains, or that of the grain beside a wall [m]."""
    is_grain = j < scene.radius.size
    return min(scene.radius[i], scene.radius[j]) if is_grain else scene.radius[i]
