"""The defences by name, with parameters: `jitter`, `jitter:0.02`, `outliers:k=4,sigmas=2`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.defences.base import Defence
from advpipe.pipeline.defences.placing import Flip, Scale, Shift
from advpipe.pipeline.defences.rounding import Jitter, Quantisation
from advpipe.pipeline.defences.thinning import OutlierRemoval, RandomSampling

DEFENCES: dict[str, Callable[..., Defence]] = {
    "sample": RandomSampling,
    "outliers": OutlierRemoval,
    "quantise": Quantisation,
    "jitter": Jitter,
    "shift": Shift,
    "flip": Flip,
    "scale": Scale,
}


def parse_defences(texts: Sequence[str]) -> dict[str, Defence]:
    """Parse each `NAME[:VALUE|NAME=VALUE,...]`; the keys are full names, such as `jitter:sigma_m=0.01`.

    A bare value sets the first parameter. Raises UsageError for an unknown name or parameter, a value that is
    not a number or out of bounds, and a defence that is given twice.
    """
    found: dict[str, Defence] = {}
    for text in texts:
        name, defence = _parse(text)
        if name in found:
            raise UsageError(f"defence {name} is given twice")
        found[name] = defence
    return found


def _parse(text: str) -> tuple[str, Defence]:
    defence, _, rest = text.partition(":")
    if defence not in DEFENCES:
        raise UsageError(f"unknown defence {defence!r}; known: {', '.join(DEFENCES)}")
    known = {
        name: float(parameter.default)
        for name, parameter in inspect.signature(DEFENCES[defence]).parameters.items()
    }
    given: dict[str, float] = {}
    for part in rest.split(",") if rest else []:
        name, equals, value = part.partition("=")
        if not equals:
            name, value = next(iter(known), ""), part
        if name not in known or name in given:
            why = "given twice" if name in given else f"unknown; known: {', '.join(known) or 'none'}"
            raise UsageError(f"defence {defence}: parameter {name or value!r} is {why}")
        try:
            given[name] = float(value)
        except ValueError:
            raise UsageError(f"defence {defence}: {name} is {value!r}, but must be a number") from None
    resolved = known | given
    parameters = ",".join(f"{name}={value:g}" for name, value in resolved.items())
    return f"{defence}:{parameters}" if parameters else defence, DEFENCES[defence](**resolved)
