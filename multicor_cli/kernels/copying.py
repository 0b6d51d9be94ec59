"""Copying memory on several threads: the yardstick of kernels that are bound by it."""

from __future__ import annotations

from multicor_cli.kernels.jit import parallel_kernel, prange
from multicor_cli.state.model import Floats

_BLOCK = 1 << 14


@parallel_kernel
def copy_blocks(source: Floats, target: Floats) -> None:
    """Copy ``source`` to ``target`` (**modified**), both of shape ``(k,)``."""
    count = source.size
    for block in prange((count + _BLOCK - 1) // _BLOCK):
        for k in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
            target[k] = source[k]
