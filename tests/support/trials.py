"""A test in two lengths: a short form that CI runs, and a long one in the tier ``reliability``."""

from collections.abc import Mapping, Sequence
from typing import Any

import pytest


def trials(short: int, long: int) -> pytest.MarkDecorator:
    """Give a test the argument ``count``: ``short``, or ``long`` with ``-m reliability``."""
    marks = [pytest.mark.reliability, pytest.mark.timeout(3600)]
    forms = [pytest.param(short, id="short"), pytest.param(long, id="long", marks=marks)]
    return pytest.mark.parametrize("count", forms)


def thinned(values: Sequence[Any] | Mapping[str, Any], every: int) -> list[Any]:
    """Parameters, one in ``every`` for CI, the others for ``-m reliability``; named by keys."""
    named = values if isinstance(values, Mapping) else {str(value): value for value in values}
    others = pytest.mark.reliability
    return [
        pytest.param(value, id=name, marks=[] if k % every == 0 else others)
        for k, (name, value) in enumerate(named.items())
    ]
