"""Texts beside the datasets of an HDF5 file: attributes of fixed length, each with a digest.

Strings of variable length, as h5py writes them, lie in a global heap: the only structure of HDF5 without a checksum, and
one in which the library searches forever where an object has no size. They are refused before they are read.
"""

from __future__ import annotations

import hashlib
import json

import h5py

DIGESTS = "attribute_digests"
"""Root attribute with the digests of all other texts of the root, as JSON."""


def write_text(node: h5py.HLObject, name: str, text: str) -> None:
    """Store a text as an attribute."""
    data = text.encode()
    node.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", max(len(data), 1)))


def write_digests(file: h5py.File) -> None:
    """Store the digests of all texts of the root; the last to be written there."""
    file.attrs.pop(DIGESTS, None)
    write_text(file, DIGESTS, json.dumps({name: text_digest(read_text(file, name)) for name in text_names(file)}))


def text_names(node: h5py.HLObject) -> list[str]:
    """Names of the attributes that are texts."""
    return [name for name in node.attrs if h5py.check_string_dtype(node.attrs.get_id(name).dtype) is not None]


def read_text(node: h5py.HLObject, name: str) -> str:
    """An attribute that is a text.

    Raises:
        KeyError: If there is none.
        TypeError: If it is something else, or of variable length.
        UnicodeDecodeError: If it is not text.
    """
    if name not in node.attrs:
        raise KeyError(f"attribute {name!r} is missing")
    info = h5py.check_string_dtype(node.attrs.get_id(name).dtype)
    if info is None or info.length is None:
        raise TypeError(f"attribute {name!r} is not a string of fixed length")
    value = node.attrs[name]
    if not isinstance(value, bytes):
        raise TypeError(f"attribute {name!r} is not one string")
    return value.decode()


def text_digest(text: str) -> str:
    """BLAKE2b digest of a text."""
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
