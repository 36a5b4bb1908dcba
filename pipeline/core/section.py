"""The base class and the value types of all sections of the scenario file."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterable, Iterator
from decimal import Decimal
from functools import cache
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, Strict, model_validator
from pydantic_core import CoreSchema

_NUMBER_STRING = re.compile(r"[-+]?[0-9]{1,30}(\.[0-9]{0,30})?[eE][-+]?[0-9]{1,4}")
"""A number that YAML 1.1 reads as a string: 1e6, since it has no decimal point."""

_PERCENT = re.compile(r"([0-9]{1,30}(?:\.[0-9]{1,30})?) ?%")
"""A share of a whole, in percent."""

Number = Annotated[float, Strict()]
"""Any finite number; without `Strict`, pydantic would read true as 1 and the string "5" as 5."""

Whole = Annotated[int, Strict()]
"""A whole number; 80.0 is one."""

Switch = Annotated[bool, Strict()]
"""true or false; no number or string is accepted instead."""

Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]


class IsShare:
    """Marks a key that holds a share of a whole, which may be written in percent: 20% for 0.2."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [handler(schema), {"type": "string", "pattern": r"^[0-9]+(\.[0-9]+)? ?%$"}]}


Probability = Annotated[Number, Field(ge=0, le=1), IsShare()]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=60)]
"""A name chosen by the user that becomes part of a topic or a frame."""

Reference = Annotated[str, Field(max_length=200)]
"""A reference by name: to a station id, a body, a material or a topic."""


Implementation = Annotated[
    str, Field(pattern=r"^([a-z][a-z0-9_-]*|[A-Za-z_][A-Za-z0-9_.]*:[A-Za-z_][A-Za-z0-9_]*)$", max_length=200)
]
"""An implementation of a protocol of the simulation: a built-in name, or a user's `module:Class`."""


class IsFile:
    """Marks a key that holds a path, relative to the scenario file or (in `--set`) the working directory."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {**handler(schema), "format": "path"}


File = Annotated[str, Field(min_length=1, max_length=4096), IsFile()]
"""A path; the resolved scenario in a data set holds only the file name."""


def parse_number(value: Any) -> Any:
    """The number that a string such as "1e6" spells; any other value unchanged."""
    is_number = isinstance(value, str) and _NUMBER_STRING.fullmatch(value)
    return float(value) if is_number else value


def parse_share(value: Any) -> Any:
    """The share that a string such as "20%" spells; any other value unchanged.

    >>> parse_share("0.5 %")
    0.005
    """
    match = _PERCENT.fullmatch(value) if isinstance(value, str) else None
    return float(Decimal(match[1]) / 100) if match else value


class Section(BaseModel):
    """The base of a frozen section; an unknown key and a number that is not finite are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _convert_numbers(cls, keys: Any) -> Any:
        """Convert "1e6", a string in YAML 1.1, to a number; where a key takes integers, 80.0 to 80; where it
        takes a share, 20% to 0.2."""
        if not isinstance(keys, dict):
            return keys
        types = _number_types(cls)
        converted = {key: written_number(keys[key], types[key]) for key in keys.keys() & types.keys()}
        converted |= {key: parse_share(converted[key]) for key in converted.keys() & _shares(cls)}
        return {key: converted.get(key, value) for key, value in keys.items()}


@cache
def _number_types(section: type[Section]) -> dict[str, type]:
    """Float or int for each key that holds only numbers."""
    types = {name: {*leaves(field.annotation)} for name, field in section.model_fields.items()}
    return {name: found.pop() for name, found in types.items() if found in ({float}, {int})}


@cache
def _shares(section: type[Section]) -> frozenset[str]:
    """The keys that hold a share of a whole."""
    fields = section.model_fields.items()
    return frozenset(name for name, field in fields if _has_share([*field.metadata, field.annotation]))


def _has_share(parts: Iterable[Any]) -> bool:
    """Whether any part of an annotation, however deep, is marked."""
    return any(isinstance(part, IsShare) or _has_share(typing.get_args(part)) for part in parts)


def leaves(annotation: Any) -> Iterator[Any]:
    """The types of the values that an annotation allows, also in lists and mappings, without None."""
    parts = typing.get_args(annotation)
    if typing.get_origin(annotation) is Annotated:
        parts = parts[:1]
    elif typing.get_origin(annotation) is dict:
        parts = parts[1:]
    if not parts and annotation not in (type(None), ...):
        yield annotation
    for part in parts:
        yield from leaves(part)


def written_number(value: Any, number_type: type) -> Any:
    """The value, or a list or mapping of values, with strings that spell numbers converted to numbers.

    number_type: float, or int to convert 80.0 to 80.
    """
    if isinstance(value, (list, tuple)):
        return type(value)(written_number(item, number_type) for item in value)
    if isinstance(value, dict):
        return {key: written_number(item, number_type) for key, item in value.items()}
    number = parse_number(value)
    if number_type is int and isinstance(number, float) and number.is_integer() and abs(number) < 2**53:
        return int(number)
    return number
