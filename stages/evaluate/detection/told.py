"""What the provenance of a bag tells in JSON, which anybody may have written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from advpipe.pipeline.errors import AdvpipeError

T = TypeVar("T")


def read_told(provenance: Mapping[str, str], key: str, kind: Any, default: T) -> T:
    """The value of this kind (a type, as pydantic takes it), or the default where nothing is told.

    Raises AdvpipeError for anything else.
    """
    if key not in provenance:
        return default
    try:
        value: T = TypeAdapter(kind).validate_json(provenance[key])
    except ValidationError as error:
        reason = error.errors()[0]["msg"]
        raise AdvpipeError(
            f"the provenance of the adversarial bag has {key} {provenance[key][:60]!r}: {reason}; "
            "attack again"
        ) from None
    return value
