"""From the tables of a scenario to the rules by which grains come and go."""

from __future__ import annotations

import math

from multicor_cli.engine.exchange.rules import ExchangeRules, Outlet, Rectangle, Release
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.packing.sizes import Purpose, TableKind, stream
from multicor_cli.scenario.models import ParticleGroup, RectangleRegion
from multicor_cli.scenario.scenario import Scenario

TRIES = 100
"""Places tried for each release."""


def exchange_rules(scenario: Scenario, model: Model) -> ExchangeRules:
    """The rules of a run.

    Args:
        scenario: What to do.
        model: All grains of the run.
    """
    releases = (_release(scenario, number, group) for number, group in enumerate(scenario.particles))
    return ExchangeRules(
        tuple(release for release in releases if release is not None),
        tuple(Outlet(_rectangle(outlet.region), outlet.then == "release") for outlet in scenario.outlets),
        None if scenario.domain.lost == "ignore" else _limits(scenario, 2.0 * float(model.grains.radius.max())),
        scenario.domain.lost == "stop",
    )


def _rectangle(region: RectangleRegion) -> Rectangle:
    return Rectangle(region.min, region.max)


def _limits(scenario: Scenario, margin: float) -> Rectangle:
    """The domain and a margin around it [m]; without limits in the direction of a period."""
    width, height = scenario.domain.size
    left, right = (-math.inf, math.inf) if scenario.domain.periodic else (-margin, width + margin)
    return Rectangle((left, -margin), (right, height + margin))


def _release(scenario: Scenario, number: int, group: ParticleGroup) -> Release | None:
    table = group.release
    if table is None:
        return None

    def draw(release: int) -> Floats:
        return stream(scenario.seed, TableKind.PARTICLES, number, Purpose.RELEASE, release).random((TRIES, 2))

    rate = table.rate if table.rate is not None else table.mass_rate
    assert rate is not None  # the scenario has been checked
    return Release(
        group=number,
        rate=rate,
        is_mass=table.mass_rate is not None,
        start=table.start,
        region=_rectangle(table.region),
        spans_period=scenario.domain.is_spanned(table.region.min[0], table.region.max[0]),
        velocity=(*group.velocity, group.spin),
        draw=draw,
    )
