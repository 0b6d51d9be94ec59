"""Gap and normal between a disc and each kind of shape. Normals point from the shape towards the disc."""

from __future__ import annotations

from math import floor, sqrt

from multicor_cli.engine.jit.formulas import formula


@formula
def minimum_image(dx: float, period: float) -> float:
    """The shortest of the periodic images of a difference in x [m]; ``period`` 0 means not periodic. |dx| < 3/2 period."""
    if period > 0.0:
        half = 0.5 * period
        if dx > half:
            return dx - period
        if dx < -half:
            return dx + period
    return dx


@formula
def nearest_image(dx: float, period: float) -> float:
    """As `minimum_image` for any dx, however many periods long (a wall that keeps moving)."""
    if period > 0.0:
        return dx - period * floor(dx / period + 0.5)
    return dx


@formula
def disc_disc(dx: float, dy: float, radii: float) -> tuple[float, float, float]:
    """Gap [m] and unit normal of two discs whose centers differ by (dx, dy) and whose radii sum to ``radii``."""
    distance = sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return -radii, 0.0, 1.0
    return distance - radii, dx / distance, dy / distance


@formula
def disc_plane(dx: float, dy: float, nx: float, ny: float, radius: float) -> tuple[float, float, float]:
    """Disc against a half-plane; (dx, dy) from a point of the plane to the center."""
    return dx * nx + dy * ny - radius, nx, ny


@formula
def segment_parameter(px: float, py: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Where the foot of (px, py) lies on the line from (x0, y0) to (x1, y1): 0 at the first end, 1 at the second."""
    ex, ey = x1 - x0, y1 - y0
    return ((px - x0) * ex + (py - y0) * ey) / (ex * ex + ey * ey)


@formula
def disc_circle(dx: float, dy: float, circle_radius: float, radius: float) -> tuple[float, float, float]:
    """Disc inside a circle (a drum); (dx, dy) from the circle's center to the disc's. The normal points inwards."""
    distance = sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return circle_radius - radius, 0.0, 1.0
    return circle_radius - distance - radius, -dx / distance, -dy / distance
