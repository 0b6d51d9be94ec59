"""How grains come and go: releases of groups, and outlets."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from multicor_cli.scenario.base import Name, Table, refuse
from multicor_cli.scenario.region import RectangleRegion

Rate = Annotated[float, Field(gt=0.0, le=1e12)]


class Release(Table):
    """``release`` of a group: its grains come one after the other, in the order of their numbers."""

    rate: Rate | None = Field(None, description="grains per second [1/s] (or give mass_rate)")
    mass_rate: Rate | None = Field(None, description="mass per second [kg/s] (or give rate)")
    region: RectangleRegion = Field(
        description="where: grains come at random places wholly inside it that are free; if none is, they wait"
    )
    start: float = Field(0.0, ge=0.0, le=1e12, description="time of the first release [s]")

    @model_validator(mode="after")
    def _one_rate(self) -> Self:
        given = [key for key in ("rate", "mass_rate") if getattr(self, key) is not None]
        if len(given) != 1:
            what = "both rate and mass_rate are given" if given else "neither rate nor mass_rate is given"
            raise refuse(what, "give one of them: grains per second, or kilograms per second")
        return self


class Outlet(Table):
    """One entry of ``[[outlets]]``: grains whose centers are inside leave before the next step."""

    name: Name = Field(description="name of the outlet")
    region: RectangleRegion = Field(description="where: deeper than the fastest grain moves in a step")
    then: Literal["remove", "release"] = Field(
        "remove",
        description='"remove": grains leave for good; "release": those of groups with a release go back to wait for it, to come '
        "again as they came first",
    )
