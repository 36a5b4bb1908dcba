"""Untrusted documents inside bags and data sets: bounded models, and one-line errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from advpipe.pipeline.core import plain_json, plain_yaml
from advpipe.pipeline.core.errors import AdvpipeError, one_line

LONGEST_SHORT_TEXT = 200
LONGEST_TEXT = 2 << 20
_SHOWN = 60

ShortText = Annotated[str, Field(max_length=LONGEST_SHORT_TEXT)]
"""A name, or another string that fits into one cell of a table."""
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite number; `true` and `"1"` are refused."""
Count = Annotated[int, Field(strict=True, ge=0, lt=2**63)]

T = TypeVar("T")


class Document(BaseModel):
    """A frozen model. Keys of other versions are ignored; a number that is not finite is an error."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


def read_json(text: str | bytes, model: Any, where: str, hint: str, limit_bytes: int = LONGEST_TEXT) -> Any:
    """Parse and validate a JSON text as `model`, a type that pydantic accepts.

    where: the file, and the topic or record in it. hint: how to fix an invalid document. limit_bytes: the
    longest text that is read. Raises AdvpipeError, one line that names `where` and the wrong key.
    """
    try:
        document = plain_json.load_json(text, limit_bytes)
    except (ValueError, RecursionError) as error:
        raise AdvpipeError(f"{where}: not valid JSON: {_reason(error)}; {hint}") from None
    return validated(document, model, where, hint)


def read_yaml(text: str, model: Any, where: str, hint: str) -> Any:
    """Parse and validate a YAML text, as `read_json` does a JSON text; it raises the same errors."""
    try:
        document = plain_yaml.load_yaml(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise AdvpipeError(f"{where}: not valid YAML: {_reason(error)}; {hint}") from None
    return validated(document, model, where, hint)


def read_text(path: Path, limit_bytes: int = LONGEST_TEXT) -> str:
    """Read a small text file. Raises AdvpipeError for one that is too large, invalid UTF-8 or unreadable."""
    try:
        with path.open("rb") as file:
            data = file.read(limit_bytes + 1)
    except OSError as error:
        raise AdvpipeError(f"{path}: cannot be read: {error.strerror or error}") from None
    if len(data) > limit_bytes:
        raise AdvpipeError(f"{path} is too large: more than {limit_bytes} bytes")
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise AdvpipeError(f"{path} is not a UTF-8 text file") from None


def validated(document: object, model: Any, where: str, hint: str) -> Any:
    """Validate plain values as `model`. Raises AdvpipeError as `read_json` does."""
    try:
        return TypeAdapter(model).validate_python(document)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key = ".".join(str(part)[:_SHOWN] for part in first["loc"] if part != "[key]")
        message = str(first["msg"]).removeprefix("Value error, ")[:LONGEST_SHORT_TEXT]
        place = f"{where}: {key}" if key else where
        raise AdvpipeError(one_line(f"{place}: {message}; {hint}")) from None


def _reason(error: Exception) -> str:
    """The first line of a parser's message, shortened."""
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark
        place = f" in line {mark.line + 1}" if mark is not None else ""
        return f"{error.problem}{place}"[:LONGEST_SHORT_TEXT]
    return (str(error).splitlines() or [type(error).__name__])[0][:LONGEST_SHORT_TEXT]
