"""``segments/MANIFEST.jsonl``: the segments that count, one line each. A segment that it does not list does not exist."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path

from multicor_cli.files import Unfit, read_regular
from multicor_cli.store.atomic import append_line, commit_bytes, file_digest, kill_point, require_own, storage_errors
from multicor_cli.store.documents import SIZE_LIMIT, Document, document_line, parse_document
from multicor_cli.store.errors import DamagedRun

NAME = "MANIFEST.jsonl"


@dataclass(frozen=True)
class Segment:
    """An immutable file with a short range of frames and rows of the time series.

    Attributes:
        name: File name.
        frames: Number of frames.
        particle_rows: Rows of particles over these frames.
        contact_rows: Rows of contacts over these frames.
        series_rows: Rows of the time series.
        first_step: Step of its first frame or row of the series.
        last_step: Step of its last frame or row of the series.
        size: Size of the file [bytes].
        blake2b: Digest of the file.
    """

    name: str
    frames: int
    particle_rows: int
    contact_rows: int
    series_rows: int
    first_step: int
    last_step: int
    size: int
    blake2b: str

    def as_document(self) -> Document:
        """As JSON types."""
        return asdict(self)

    @classmethod
    def from_document(cls, data: Document, where: str) -> Segment:
        """The inverse of `as_document`; raises `DamagedRun` naming ``where``."""
        for field in fields(cls):
            value = data.get(field.name)
            kind = str if field.name in ("name", "blake2b") else int
            if type(value) is not kind or (isinstance(value, int) and value < 0):
                raise DamagedRun(f"{where}: {field.name} is {value!r}")
        segment = cls(**{field.name: data[field.name] for field in fields(cls)})
        if Path(segment.name).name != segment.name or not segment.name.endswith(".h5"):
            raise DamagedRun(f"{where}: {segment.name!r} is not the name of a segment")
        return segment


def segment_name(index: int) -> str:
    """File name of the ``index``-th segment."""
    return f"{index:06d}.h5"


def read_manifest(directory: Path) -> list[Segment]:
    """The segments listed in ``directory``; a last line without its end (a crash while it was written) does not count.

    Raises:
        DamagedRun: If a line is damaged.
        StorageError: If the file cannot be read.
    """
    path = directory / NAME
    if not path.exists():
        return []
    with storage_errors(path):
        lines = read_regular(path, SIZE_LIMIT).split(b"\n")[:-1]
    segments = []
    for number, line in enumerate(lines, 1):
        where = f"{path}, line {number}"
        segments.append(Segment.from_document(parse_document(line, where), where))
    return segments


def append_segment(directory: Path, segment: Segment) -> None:
    """Commit a segment, whose file is in place, by listing it; raises `StorageFull` or `StorageError`."""
    append_line(directory / NAME, "manifest", document_line(segment.as_document()))


def keep_segments(directory: Path, segments: list[Segment]) -> list[str]:
    """Make the manifest list exactly ``segments``; the files of others become ``*.orphan``.

    Returns:
        Names of the files set aside.

    Raises:
        StorageError: If a file cannot be renamed or written.
    """
    data = b"".join(document_line(segment.as_document()) for segment in segments)
    path = directory / NAME
    with storage_errors(path):
        try:
            before = read_regular(path, SIZE_LIMIT)
        except (FileNotFoundError, Unfit):
            before = None
    if before != data:
        commit_bytes(path, "manifest", data)
    return set_aside(directory, {segment.name for segment in segments})


def set_aside(directory: Path, keep: set[str]) -> list[str]:
    """Rename segment files that are not in ``keep`` to ``*.orphan``; returns their names."""
    renamed = []
    for path in sorted(directory.glob("*.h5")):
        if path.name in keep:
            continue
        with storage_errors(path):
            require_own(path)
            path.rename(_free_orphan_name(path))
        renamed.append(path.name)
        kill_point("orphan.mid")
    return renamed


def _free_orphan_name(path: Path) -> Path:
    target, count = path.with_name(f"{path.name}.orphan"), 1
    while target.exists():
        target, count = path.with_name(f"{path.name}.{count}.orphan"), count + 1
    return target


def check_segment(directory: Path, segment: Segment) -> None:
    """Compare size and digest of a segment file with its line; raises `DamagedRun` or `StorageError`."""
    path = directory / segment.name
    if not path.is_file():
        raise DamagedRun(f"{path}: missing")
    with storage_errors(path):
        size = path.stat().st_size
    if size != segment.size or file_digest(path) != segment.blake2b:
        raise DamagedRun(f"{path}: damaged (it does not match its digest in {NAME})")
