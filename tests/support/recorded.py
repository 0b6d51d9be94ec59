"""Numbers of a test for the figures of the site (docs/generate/validation.py), through the report
of pytest.
"""

import json

import numpy as np


def keep(record_property, **numbers):
    """Put arrays and numbers, by name, into the report (``--junitxml``) of the test whose
    `record_property` this is.
    """
    record_property(
        "numbers", json.dumps({name: np.asarray(value).tolist() for name, value in numbers.items()})
    )
