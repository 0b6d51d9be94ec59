"""Numbers of a test for figures of the site (docs/generate/validation.py), by pytest's report."""

import json

import numpy as np


def keep(record_property, **numbers):
    """Put arrays and numbers, by name, into the report (``--junitxml``) of a test."""
    record_property(
        "numbers", json.dumps({name: np.asarray(value).tolist() for name, value in numbers.items()})
    )
