"""What the grains of a run or of a frame are: sizes, masses, and names where the model has numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.text import count_noun


@dataclass(frozen=True, repr=False)
class GrainFacts:
    """What grains are that does not change; every array has shape ``(n,)``.

    Attributes:
        radius: Radius a [m].
        mass: Mass m [kg].
        inertia: Moment of inertia about the center [kg m²].
        material: Name of the material.
        group: Name of the ``[[particles]]`` table that a grain comes from.
    """

    radius: Floats
    mass: Floats
    inertia: Floats
    material: NDArray[Any]
    group: NDArray[Any]

    @classmethod
    def of(cls, model: Model) -> GrainFacts:
        """Those of a model."""
        grains = model.grains
        material, group = np.array(model.materials)[grains.material], np.array(model.groups)[grains.group]
        return cls(grains.radius, grains.mass, grains.inertia, material, group)

    def __len__(self) -> int:
        return len(self.radius)

    def __repr__(self) -> str:
        sizes = f", radius {self.radius.min():.4g} to {self.radius.max():.4g} m" if len(self) else ""
        return f"<Grains: {count_noun(len(self), 'grain')}{sizes}>"
