"""The tables of every dataset in the files of a run, one row each.

A row says what a dataset is, where its values come from, and what shows it; writers, readers and
exports follow the tables. Rows that only some runs have name the feature of the run that they
belong to; a run with that feature has all of them, a run without it none (`select`).
"""

from multicor_cli.model.books import Feature, stored_fields
from multicor_cli.model.state import State
from multicor_cli.store.schema.rows import (
    CONTACTS,
    COUNTED,
    FRAME_TABLE,
    MODEL,
    OFFSET_OF,
    OFFSETS,
    PARTICLES,
    SCENARIO,
    SERIES,
    STEPS,
    WALLS,
    Dataset,
    features_of,
    markdown,
    names,
    select,
)

SEGMENT_TABLE = FRAME_TABLE + SERIES

RESULTS_TABLE = SCENARIO + MODEL + FRAME_TABLE + SERIES

DATASETS = {row.path: row for row in RESULTS_TABLE}
"""By path."""

CHECKPOINT = tuple(
    Dataset.of(about, f"state/{name}", finite=False, only_with=None)
    for name, about in stored_fields(State).items()
)
"""Everything in a checkpoint: the fields of `State`; those of heat are empty in runs without."""

FORMAT_VERSION = max(row.since for row in RESULTS_TABLE + CHECKPOINT)
"""Major and minor version of the file format, in which the newest dataset appeared. A reader
refuses another major version and ignores unknown datasets."""

__all__ = [
    "CHECKPOINT", "CONTACTS", "COUNTED", "DATASETS", "FORMAT_VERSION", "FRAME_TABLE", "MODEL",
    "OFFSETS", "OFFSET_OF", "PARTICLES", "RESULTS_TABLE", "SCENARIO", "SEGMENT_TABLE", "SERIES",
    "STEPS", "WALLS", "Dataset", "Feature", "features_of", "markdown", "names", "select",
]  # fmt: skip
