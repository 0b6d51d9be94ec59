"""`multicor_cli.arithmetic` on float64 arrays of any shape, compiled when first called."""

from __future__ import annotations

import numpy as np

from multicor_cli import arithmetic
from multicor_cli.engine.jit.compile import elementwise
from multicor_cli.model.model import Floats

acos = elementwise(arithmetic.acos)
asin = elementwise(arithmetic.asin)
cos = elementwise(arithmetic.cos)
exp = elementwise(arithmetic.exp)
log1p = elementwise(arithmetic.log1p)
normal_quantile = elementwise(arithmetic.normal_quantile)
sin = elementwise(arithmetic.sin)


def hypot(x: Floats, y: Floats) -> Floats:
    """Lengths of the vectors (x, y), as `arithmetic.hypot`."""
    return np.asarray(np.sqrt(x * x + y * y))
