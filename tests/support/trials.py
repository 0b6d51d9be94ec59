"""A test in two lengths: a short form that CI runs, and a long one in the tier ``reliability``."""

from __future__ import annotations

import pytest


def trials(short: int, long: int) -> pytest.MarkDecorator:
    """Give a test the argument ``count``: ``short`` trials, and with ``-m reliability`` ``long`` ones."""
    return pytest.mark.parametrize(
        "count",
        [
            pytest.param(short, id="short"),
            pytest.param(long, id="long", marks=[pytest.mark.reliability, pytest.mark.timeout(3600)]),
        ],
    )
