"""Copying arrays within kernels."""

from __future__ import annotations

from multicor_cli.engine.jit.compile import loop_body
from multicor_cli.model.model import Floats


@loop_body
def copy_into(target: Floats, source: Floats) -> None:
    """Write ``source`` over the beginning of ``target``; both flat.

    (``target[:] = source`` compiles the message about arrays that do not fit too: up to three seconds in each kernel.)
    """
    for k in range(source.size):
        target[k] = source[k]
