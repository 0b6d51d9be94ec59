"""Curves through the points of a study, and curves given as formulas beside them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.plots.style import PlotError
from multicor_cli.scenario.expressions import Expression, ExpressionError
from multicor_cli.studies.series import Series

FITS = ("line", "power", "mu-of-I")
"""Kinds of fits: y = a + b x; y = a x^b; μ(I) = μ_s + (μ_2 − μ_s)/(1 + I_0/I) (P. Jop et al., Nature 441, 727, 2006)."""


@dataclass(frozen=True)
class Curve:
    """A curve in a figure.

    Attributes:
        text: A fit with its parameters and their errors, or the name of a formula.
        value: Its heights at some x.
    """

    text: str
    value: Callable[[Floats], Floats]


def fit(kind: str, series: Series) -> Curve:
    """A curve through a series, weighted by the errors where all are known.

    Raises:
        PlotError: There are too few points, or no curve of this kind goes through them.
        MissingLibrary: scipy is not installed.
    """
    curve_fit = library("scipy.optimize").curve_fit
    names, model, start = _model(kind, series)
    if series.x.size < len(names) + 1:
        raise PlotError(f"a fit of kind {kind} needs {len(names) + 1} points, {series.label or 'the series'} has {series.x.size}")
    is_known = bool((np.isfinite(series.error) & (series.error > 0.0)).all())
    try:
        found, covariance = curve_fit(
            model, series.x, series.y, start, sigma=series.error if is_known else None, absolute_sigma=is_known, maxfev=20_000
        )
    except (RuntimeError, ValueError) as error:
        raise PlotError(f"no curve of kind {kind} goes through {series.label or 'the points'}: {error}") from None
    errors = np.sqrt(np.diag(covariance))
    text = ", ".join(f"{name} = {value:.4g} ± {error:.2g}" for name, value, error in zip(names, found, errors, strict=True))
    return Curve(text, lambda x: np.asarray(model(x, *found)))


def _model(kind: str, series: Series) -> tuple[tuple[str, ...], Callable[..., Floats], list[float]]:
    """Names of the parameters, the curve, and where the search begins."""
    x, y = series.x, series.y
    if kind == "line":
        return ("a", "b"), lambda x, a, b: a + b * x, [float(y.mean()), 0.0]
    if kind == "power":
        if (x <= 0.0).any() or (y <= 0.0).any():
            raise PlotError("a power law needs positive numbers")
        slope, start = np.polyfit(np.log(x), np.log(y), 1)
        return ("a", "b"), lambda x, a, b: a * x**b, [math.exp(start), float(slope)]
    if kind == "mu-of-I":
        return ("μ_s", "μ_2", "I_0"), lambda x, s, m, i: s + (m - s) / (1.0 + i / x), [float(y.min()), 2.0 * float(y.max()), 0.3]
    raise PlotError(f"no fit is called {kind}; there are {', '.join(FITS)}")


def formula(text: str) -> Curve:
    """The curve of a formula in x, as ``da Cruz 2005: 0.25 + 1.1*x``; its name may be left out.

    Raises:
        PlotError: It is no formula in x.
    """
    name, _, body = text.rpartition(":")
    try:
        found = Expression(f"= {body.strip()}")
        found.check_names({"x": 1.0})
    except ExpressionError as error:
        raise PlotError(f"--curve {text!r}: {error.message}; write it as 'da Cruz 2005: 0.25 + 1.1*x'") from None

    def value(x: Floats) -> Floats:
        heights = []
        for where in x.tolist():
            try:
                heights.append(float(found.value({"x": where})))
            except ExpressionError:
                heights.append(math.nan)
        return np.array(heights)

    return Curve(name.strip() or body.strip(), value)
