"""What every section of the scenario file is made of."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, Strict, model_validator
from pydantic_core import CoreSchema

_NUMBER_WORD = re.compile(r"[-+]?[0-9]{1,30}(\.[0-9]{0,30})?[eE][-+]?[0-9]{1,4}")
"""A number to everybody but YAML 1.1, which takes 1e6 for a word, as it has no point."""

Number = Annotated[float, Strict()]
"""Any finite number; pydantic would take true for 1, and the word "5" for 5."""

Whole = Annotated[int, Strict()]
"""A number without a fraction; 80.0 is one."""

Switch = Annotated[bool, Strict()]
"""true or false; no number or word stands for them."""

Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Probability = Annotated[Number, Field(ge=0, le=1)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=60)]
"""A name of the user's that becomes part of a topic or a frame."""

Word = Annotated[str, Field(max_length=200)]
"""A name that stands for something else: an id, a body, a material, a topic."""


Implementation = Annotated[
    str, Field(pattern=r"^([a-z][a-z0-9_-]*|[A-Za-z_][A-Za-z0-9_.]*:[A-Za-z_][A-Za-z0-9_]*)$", max_length=200)
]
"""What stands behind a seam of the simulation: a name of ours, or a user's own `module:Class`."""


class IsFile:
    """Marks a key that holds a path: relative to the scenario file, or to the working folder in `--set`."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {**handler(schema), "format": "path"}


File = Annotated[str, Field(min_length=1, max_length=4096), IsFile()]
"""A path; the resolved scenario in a data set names only the file."""


def number_of_word(value: Any) -> Any:
    """The number that a word such as 1e6 stands for; any other value as it is."""
    is_word = isinstance(value, str) and _NUMBER_WORD.fullmatch(value)
    return float(value) if is_word else value


class Section(BaseModel):
    """Frozen; a key that is not known is an error, and so is a number that is not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _written_numbers(cls, keys: Any) -> Any:
        """1e6 for what YAML takes for a word, 80 for 80.0 where only whole numbers are taken."""
        if not isinstance(keys, dict):
            return keys
        kinds = _number_kinds(cls)
        written = {key: written_number(keys[key], kinds[key]) for key in keys.keys() & kinds.keys()}
        return {key: written.get(key, value) for key, value in keys.items()}


@cache
def _number_kinds(section: type[Section]) -> dict[str, type]:
    """By key, float or int, for the keys that hold numbers alone."""
    kinds = {name: {*leaves(field.annotation)} for name, field in section.model_fields.items()}
    return {name: kind.pop() for name, kind in kinds.items() if kind in ({float}, {int})}


def leaves(annotation: Any) -> Iterator[Any]:
    """The types of the values that an annotation lets in, those in lists and mappings too, None left out."""
    parts = typing.get_args(annotation)
    if typing.get_origin(annotation) is Annotated:
        parts = parts[:1]
    elif typing.get_origin(annotation) is dict:
        parts = parts[1:]
    if not parts and annotation not in (type(None), ...):
        yield annotation
    for part in parts:
        yield from leaves(part)


def written_number(value: Any, kind: type) -> Any:
    """The value, its words that stand for numbers as numbers; kind: int makes 80 of 80.0."""
    if isinstance(value, (list, tuple)):
        return type(value)(written_number(item, kind) for item in value)
    if isinstance(value, dict):
        return {key: written_number(item, kind) for key, item in value.items()}
    number = number_of_word(value)
    if kind is int and isinstance(number, float) and number.is_integer() and abs(number) < 2**53:
        return int(number)
    return number
