"""Results that `report.json` lists: their fields, with the keys and descriptions that these become.

A field is described by a text in its type: `Annotated[float, "mean error, in metres"]`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from advpipe.pipeline.results.metrics import Record


@dataclass(frozen=True)
class Flat:
    """Marks a field that holds another dataclass: its fields become keys with this prefix, None adds none.

    about: text before the descriptions of these keys.
    """

    prefix: str
    about: str = ""


@dataclass(frozen=True)
class LeftOut:
    """Marks a field whose key is left out where it is None: the value does not exist."""


class Field(NamedTuple):
    """The type of a field, its mark, None without one, and its description."""

    hint: Any
    mark: Flat | LeftOut | None
    description: str


@dataclass(frozen=True)
class Listed:
    """A result that `report.json` lists, one a line, and whose JSON Schema is made from its fields."""

    def record(self) -> Record:
        """The result as `report.json` has it: one key a figure."""
        return flattened(self)


def flattened(result: Any) -> Record:
    """The fields of a dataclass by their keys; NaN for undefined values."""
    row: Record = {}
    kind: Any = type(result)
    for name, field in described_fields(kind).items():
        value = getattr(result, name)
        if isinstance(field.mark, Flat):
            inner = {} if value is None else flattened(value)
            row |= {field.mark.prefix + key: each for key, each in inner.items()}
        elif value is not None or not isinstance(field.mark, LeftOut):
            row[key_of(name)] = _plain(value)
    return row


@cache
def described_fields(kind: Any) -> Mapping[str, Field]:
    """The fields of a dataclass by name."""
    hints = get_type_hints(kind, include_extras=True)
    return {each.name: _field(hints[each.name]) for each in fields(kind)}


def _field(hint: Any) -> Field:
    if get_origin(hint) is not Annotated:
        return Field(hint, None, "")
    inner, *extras = get_args(hint)
    mark = next((each for each in extras if isinstance(each, Flat | LeftOut)), None)
    return Field(inner, mark, next((each for each in extras if isinstance(each, str)), ""))


def key_of(name: str) -> str:
    """The key of a field in a record."""
    return "class" if name == "class_name" else name


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return flattened(value)
    if isinstance(value, tuple) and value and is_dataclass(value[0]):
        return [flattened(item) for item in value]
    return value
