"""What a result that `report.json` lists is made of, and the keys that its fields become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from advpipe.pipeline.results.metrics import Record


@dataclass(frozen=True)
class Flat:
    """Marks a field that holds another dataclass: its fields become keys with this prefix, None adds none."""

    prefix: str


@dataclass(frozen=True)
class LeftOut:
    """Marks a field whose key is left out where it is None: there is no such thing, not even undefined."""


@dataclass(frozen=True)
class Listed:
    """A result that `report.json` lists, one a line, and whose JSON Schema is made from its fields."""

    def record(self) -> Record:
        """The result as `report.json` has it: one key a figure."""
        return flattened(self)


def flattened(result: Any) -> Record:
    """The fields of a dataclass by their keys; NaN for what is undefined."""
    row: Record = {}
    kind: Any = type(result)
    for name, (_, mark) in shape(kind).items():
        value = getattr(result, name)
        if isinstance(mark, Flat):
            inner = {} if value is None else flattened(value)
            row |= {mark.prefix + key: figure for key, figure in inner.items()}
        elif value is not None or not isinstance(mark, LeftOut):
            row[key_of(name)] = _plain(value)
    return row


@cache
def shape(kind: Any) -> Mapping[str, tuple[Any, Any]]:
    """The type of each field of a dataclass, and its mark, None without one."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        each.name: get_args(hint) if get_origin(hint) is Annotated else (hint, None)
        for each in fields(kind)
        for hint in (hints[each.name],)
    }


def key_of(name: str) -> str:
    """The key of a field in a record."""
    return "class" if name == "class_name" else name


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return flattened(value)
    if isinstance(value, tuple) and value and is_dataclass(value[0]):
        return [flattened(item) for item in value]
    return value
