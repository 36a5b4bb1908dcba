"""V2X attackers as the command line and the Python API name them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name


def attackers_section(names: Sequence[str]) -> dict[str, Any] | None:
    """The section `attackers` of a scenario file for these names: vehicles' ids, or one of `20%` and
    `rsu:X,Y`. None without names. Raises UsageError for any other."""
    if not names:
        return None
    special = [name for name in names if name.endswith("%") or name.startswith("rsu:")]
    if not special:
        return {"vehicles": list(names)}
    if len(names) > 1:
        raise UsageError(
            f"{option_name('attacker', special[0])}: a share or a roadside unit must be the only attacker"
        )
    (name,) = names
    try:
        if name.endswith("%"):
            return {"share": float(name[:-1]) / 100}
        numbers = [float(part) for part in name.removeprefix("rsu:").split(",")]
        return {"roadside_unit": dict(zip(("x_m", "y_m", "z_m")[: len(numbers)], numbers, strict=True))}
    except ValueError:
        raise UsageError(
            f"{option_name('attacker', name)}: write a vehicle's id, 20%, or rsu:X,Y in metres"
        ) from None
