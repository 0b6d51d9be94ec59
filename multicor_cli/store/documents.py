"""Small JSON documents of a run (``run.json``, manifest, sidecars of checkpoints), each protected by a digest of its own."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

from multicor_cli.files import read_regular
from multicor_cli.store.atomic import commit_bytes, storage_errors
from multicor_cli.store.errors import DamagedRun

Document = dict[str, Any]

SIZE_LIMIT = 256 << 20
"""Largest document that is read [bytes]."""

_CHECK = "check"


def write_document(path: Path, label: str, data: Document) -> None:
    """Commit ``data`` as JSON with its digest under the key ``check``; numbers that are not finite become null."""
    text = _page(_sealed(data))
    commit_bytes(path, label, (text + "\n").encode())


def document_line(data: Document) -> bytes:
    """One line of JSON with its digest."""
    return (_line(_sealed(data)) + "\n").encode()


def read_document(path: Path) -> Document:
    """Read a document and check its digest.

    Raises:
        StorageError: If the file cannot be read.
        DamagedRun: If it is not a document of ours, or has been changed.
    """
    with storage_errors(path):
        data = read_regular(path, SIZE_LIMIT)
    return parse_document(data, str(path))


def parse_document(data: bytes, where: str) -> Document:
    """Parse one document and check its digest; ``where`` names it in the message of `DamagedRun`."""
    try:
        value = json.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise DamagedRun(f"{where}: damaged ({error})") from error
    if not isinstance(value, dict):
        raise DamagedRun(f"{where}: damaged (not a JSON object)")
    is_as_written = data.decode() in (_page(value) + "\n", _line(value))  # not a blank more
    check = value.pop(_CHECK, None)
    if check != _digest(value) or not is_as_written:
        raise DamagedRun(f"{where}: damaged or edited (its content does not match its digest)")
    return value


def _page(data: Document) -> str:
    return json.dumps(data, indent=1, ensure_ascii=False)


def _line(data: Document) -> str:
    return json.dumps(data, ensure_ascii=False)


def _sealed(data: Document) -> Document:
    clean = plain(data)
    return {**clean, _CHECK: _digest(clean)}


def _digest(data: Document) -> str:
    text = json.dumps(data, sort_keys=True, ensure_ascii=True, allow_nan=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def plain(value: Any) -> Any:
    """``value`` as plain JSON types: numbers of numpy become numbers, those that are not finite become ``None``."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if hasattr(value, "item"):  # a number of numpy
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
