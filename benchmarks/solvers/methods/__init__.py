"""The methods that are compared, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from methods.anderson import run_anderson
from methods.conjugate import run_conjugate
from methods.engine import run_engine
from methods.gauss_seidel import run_gauss_seidel
from methods.gradient import run_gradient
from methods.momentum import run_momentum
from methods.multilevel import run_multilevel
from methods.newton import run_newton
from methods.operators import Log
from multicor_cli.engine.contact.sweep import System
from multicor_cli.model.model import Floats

Run = Callable[[System, int, Floats, Log], int]
"""``run(system, iterations, parameters, log)``, see `methods.operators`."""


@dataclass(frozen=True)
class Method:
    """A method and its parameters.

    Attributes:
        name: Name on the command line.
        about: What it is.
        run: Does it.
        parameters: Its numbers.
        times_itself: Whether it leaves its time in the log, because its iterations are not of one
            kind.
    """

    name: str
    about: str
    run: Run
    parameters: tuple[float, ...] = ()
    times_itself: bool = False

    def __call__(self, system: System, iterations: int, log: Log) -> int:
        """Run it on a system, which is changed; returns the number of iterations done."""
        return self.run(system, iterations, np.array(self.parameters, np.float64), log)


def _momentum(
    name: str,
    about: str,
    *,
    growth: float = 1.5,
    goes_back: bool = False,
    period: int = 0,
    inner: int = 1,
) -> Method:
    return Method(
        name, about, run_momentum, (growth, float(goes_back), float(period), float(inner))
    )


_LIST = [
    Method("gs", "Gauss–Seidel", run_gauss_seidel, (1.0, 0.0)),
    Method("gs-sym", "Gauss–Seidel, every second sweep backward", run_gauss_seidel, (1.0, 1.0)),
    Method("sor-1.5", "over-relaxed, ω = 1.5", run_gauss_seidel, (1.5, 0.0)),
    Method("engine", "accelerated Gauss–Seidel of the program", run_engine),
    _momentum("restart-2", "its momentum alone, restart at growth 2", growth=2.0),
    _momentum("restart-1.5", "its momentum alone, restart at growth 1.5 as there"),
    _momentum(
        "skip",
        "as restart-1.5, contacts far from closing looked at in every tenth sweep only",
        period=10,
    ),
    _momentum("tiles-2", "as restart-1.5, each tile twice in a row", inner=2),
    _momentum("tiles-3", "as restart-1.5, each tile three times in a row", inner=3),
    _momentum("sym", "as restart-1.5, forward and backward in each iteration", goes_back=True),
    Method("cpg", "conjugate projected gradient of Renouf & Alart", run_conjugate),
    Method("apgd", "accelerated projected gradient", run_gradient),
    Method("anderson-5", "Anderson acceleration, 5 earlier sweeps", run_anderson, (5.0,)),
    Method(
        "levels",
        "engine, and a uniform stress for each 12 grains every 20 sweeps",
        run_multilevel,
        (12.0, 20.0),
        True,
    ),
    Method("newton", "engine, then semi-smooth Newton steps with sparse LU", run_newton, (), True),
]

METHODS = {method.name: method for method in _LIST}
"""All methods."""
