"""V2X attackers as the command line and the Python API name them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name


def attackers_section(words: Sequence[str]) -> dict[str, Any] | None:
    """The section `attackers` of a scenario file that these words stand for: vehicles' ids, or one of `20%`
    and `rsu:X,Y`. None without words; raises UsageError for others."""
    if not words:
        return None
    special = [word for word in words if word.endswith("%") or word.startswith("rsu:")]
    if not special:
        return {"vehicles": list(words)}
    if len(words) > 1:
        raise UsageError(
            f"{option_name('attacker', special[0])}: a share or a roadside unit must be the only attacker"
        )
    (word,) = words
    try:
        if word.endswith("%"):
            return {"share": float(word[:-1]) / 100}
        numbers = [float(part) for part in word.removeprefix("rsu:").split(",")]
        return {"roadside_unit": dict(zip(("x_m", "y_m", "z_m")[: len(numbers)], numbers, strict=True))}
    except ValueError:
        raise UsageError(
            f"{option_name('attacker', word)}: write a vehicle's id, 20%, or rsu:X,Y in metres"
        ) from None
