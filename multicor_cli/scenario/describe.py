"""What the models say about a place in a scenario: its description, and the keys that its table knows."""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo

from multicor_cli.scenario.problems import KeyPath


@dataclass(frozen=True)
class Spot:
    """A place in a scenario.

    Attributes:
        path: Path of the key.
        description: What the models say about the last key on the path that they know; may be empty.
        table: Model of the innermost table on the path.
    """

    path: KeyPath
    description: str
    table: type[BaseModel]

    @property
    def known_keys(self) -> list[str]:
        """Keys that the innermost table knows."""
        return [field.alias or name for name, field in self.table.model_fields.items()]


def find_spot(model: type[BaseModel], location: tuple[str | int, ...]) -> Spot:
    """Follow the location of a validation error through the models.

    The validation library puts the tags of unions into its locations; they are not keys of the document and are left out.
    """
    path: list[str | int] = []
    description, table = "", model
    annotation: Any = model
    for part in location:
        annotation = _strip(annotation)
        member = _union_member(annotation, part)
        if member is not None:
            annotation = member
            continue
        if part == "[key]":
            continue
        path.append(part)
        if _is_table(annotation):
            table = annotation
            field = find_field(table, str(part))
            description = (field.description or "") if field else description
        annotation = _inside(annotation, part)
    return Spot(tuple(path), description, table)


def types_inside(types: Iterable[Any], part: str | int) -> list[Any]:
    """The types that the element or key ``part`` may have of something of one of these types; those of unions one by one."""
    return [member for annotation in types for member in _alternatives(_inside(annotation, part))]


def find_field(table: type[BaseModel], key: str) -> FieldInfo | None:
    """The field of ``table`` for a TOML key."""
    for name, field in table.model_fields.items():
        if key == (field.alias or name):
            return field
    return None


def _is_table(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _strip(annotation: Any) -> Any:
    """The type below annotations and "or None"."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        members = [member for member in _members(annotation) if member is not type(None)]
        if len(members) != 1:
            return annotation
        annotation = members[0]


def _members(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else ()


def _alternatives(annotation: Any) -> Iterator[Any]:
    """The types that something of type ``annotation`` may have."""
    annotation = _strip(annotation)
    members = _members(annotation)
    for member in members:
        yield from _alternatives(member)
    if not members:
        yield annotation


def _union_member(annotation: Any, part: str | int) -> Any:
    """The member of a union that ``part`` is the tag of."""
    for member in _members(annotation):
        tags = [data.tag for data in get_args(member)[1:] if isinstance(data, Tag)]
        if part in tags or part == _kind(_strip(member)):
            return member
    return None


def _kind(annotation: Any) -> str | None:
    if not _is_table(annotation) or "kind" not in annotation.model_fields:
        return None
    kind = annotation.model_fields["kind"].annotation
    return str(get_args(kind)[0]) if get_origin(kind) is Literal else None


def _inside(annotation: Any, part: str | int) -> Any:
    """Type of the element or key ``part`` of something of type ``annotation``."""
    if _is_table(annotation):
        field = find_field(annotation, str(part))
        return field.annotation if field else None
    if get_origin(annotation) is dict:
        return get_args(annotation)[1]
    if get_origin(annotation) is tuple:
        return get_args(annotation)[0]
    return None
