"""Grains from a frame of another run, with their velocities and temperatures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from multicor_cli.packing.initial_grains import InitialGrains, describe_faults
from multicor_cli.scenario.problems import Refused

_KEY = ("packing", "path")


def read_frame(path: Path, frame: int) -> InitialGrains:
    """Grains of a frame: radii, wrapped centers, angles, velocities, spins and, if that run had heat, temperatures.

    Walls and materials are not taken over.

    Args:
        path: Run directory (or a ``results.h5``).
        frame: Index of the frame; negative counts from the last one.

    Raises:
        Refused: There is no readable run, or no such frame, or it holds what no grain can have.
    """
    from multicor_cli.store import StoreError, open_run
    from multicor_cli.store.errors import NoFrame

    try:
        with open_run(path) as run:
            chosen = run.frames[frame]
            position = np.column_stack([chosen.position, chosen.angle]).astype(float)
            velocity = np.column_stack([chosen.velocity, chosen.spin]).astype(float)
            warmth = chosen.temperature
            temperature = None if warmth is None else np.array(warmth, float)
            radius = np.array(chosen.model.grains.radius, float)
    except NoFrame as error:
        raise Refused(("packing", "frame"), f"cannot take grains from the run '{path}': {error}", "choose another frame") from None
    except StoreError as error:
        raise Refused(_KEY, f"the run '{path}' cannot be read: {error}", "give the directory of a run") from None
    sizes = {len(radius), len(position), len(velocity), len(radius if temperature is None else temperature)}
    if len(sizes) > 1:
        what = f"the run '{path}' is damaged: the number of grains in frame {frame} differs from that of the run"
        raise Refused(_KEY, what, "check it with multicor verify")
    columns = dict(zip(("x", "y", "angle", "vx", "vy", "spin"), [*position.T, *velocity.T], strict=True)) | {"radius": radius}
    faults = describe_faults(columns | ({} if temperature is None else {"temperature": temperature}))
    if faults:
        raise Refused(_KEY, f"frame {frame} of the run '{path}': {faults}", "check the run with multicor verify")
    return InitialGrains(radius, position, velocity, temperature)
