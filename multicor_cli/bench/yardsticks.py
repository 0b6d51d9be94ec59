"""What benchmarks measure: copying memory on several threads, and sweeps without anything around them."""

from __future__ import annotations

from multicor_cli.engine.contact.sweep import EXACT, Before, Relaxation, System, sweep
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.model.model import Floats

_BLOCK = 1 << 14


@parallel_kernel
def copy_blocks(source: Floats, target: Floats) -> None:
    """Copy ``source`` to ``target`` (**modified**), both of shape ``(k,)``."""
    count = source.size
    for block in prange((count + _BLOCK - 1) // _BLOCK):
        for k in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
            target[k] = source[k]


@kernel
def sweep_repeatedly(s: System, before: Before, repeats: int, parallel: bool, partial: Floats) -> float:
    """Some sweeps one after the other; arguments as `sweep`. Returns the sum of the squares of all velocity corrections [m²/s²]."""
    total = 0.0
    for _ in range(repeats):
        total += sweep(s, before, EXACT, Relaxation(1.0, 1.0, 0.0), parallel, partial)
    return total
