"""The defences by name, with parameters: `jitter`, `jitter:0.02`, `outliers:k=4,sigmas=2`.

A user's own is named `module:Class`, with parameters `module:Class:0.02`. `default` stands for those that
reports have unless asked otherwise, `all` for all of them, `none` for none.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import import_object
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.plugins import plugin_errors
from advpipe.pipeline.defences.base import Defence, DefendedCloud, ShippedDefence
from advpipe.pipeline.defences.placing import Flip, Scale, Shift
from advpipe.pipeline.defences.rounding import Jitter, Quantisation
from advpipe.pipeline.defences.thinning import OutlierRemoval, RandomSampling
from advpipe.pipeline.messages.cloud import Cloud

DEFENCES: dict[str, type[ShippedDefence]] = {
    "sample": RandomSampling,
    "outliers": OutlierRemoval,
    "quantise": Quantisation,
    "jitter": Jitter,
    "shift": Shift,
    "flip": Flip,
    "scale": Scale,
}

NONE, DEFAULT, ALL = "none", "default", "all"
"""Words for several defences of the registry."""


def parse_defences(texts: Sequence[str]) -> dict[str, Defence]:
    """Parse each `NAME[:VALUE|NAME=VALUE,...]` and `default`, `all` or `none`.

    The keys of the result are full names, such as `jitter:sigma_m=0.01`.

    A bare value sets the first parameter. Raises UsageError for an unknown name or parameter, a value that
    is not a number or out of bounds, a class that cannot be loaded, and a defence that is given twice.
    """
    if NONE in texts and len(texts) > 1:
        raise UsageError(f"defence {NONE} stands alone; leave out the others or it")
    found: dict[str, Defence] = {}
    for text in (name for given in texts for name in _names_of(given)):
        name, defence = _parse(text)
        if name in found:
            raise UsageError(f"defence {name} is given twice")
        found[name] = defence
    return found


def _names_of(text: str) -> list[str]:
    """The defences that a word stands for; the text itself where it is none."""
    words = {
        NONE: [],
        DEFAULT: [name for name, defence in DEFENCES.items() if defence.is_default],
        ALL: list(DEFENCES),
    }
    return words.get(text, [text])


def _parse(text: str) -> tuple[str, Defence]:
    name, rest = _name_and_parameters(text)
    is_own = name not in DEFENCES
    build = _own_class(name) if is_own else DEFENCES[name]
    known = _defaults(name, build)
    given: dict[str, float] = {}
    for part in rest.split(",") if rest else []:
        parameter, equals, value = part.partition("=")
        if not equals:
            parameter, value = next(iter(known), ""), part
        if parameter not in known or parameter in given:
            choice = known_names(parameter, known) if known else "known: none"
            why = "given twice" if parameter in given else f"unknown; {choice}"
            raise UsageError(f"defence {name}: parameter {parameter or value!r} is {why}")
        try:
            given[parameter] = float(value)
        except ValueError:
            raise UsageError(f"defence {name}: {parameter} is {value!r}, but must be a number") from None
    resolved = known | given
    parameters = ",".join(f"{parameter}={value:g}" for parameter, value in resolved.items())
    full_name = f"{name}:{parameters}" if parameters else name
    return full_name, _own_defence(name, build, resolved) if is_own else build(**resolved)


def _name_and_parameters(text: str) -> tuple[str, str]:
    """The registered name or the user's `module:Class`, and what follows it. Raises UsageError for others."""
    name, _, rest = text.partition(":")
    if name in DEFENCES:
        return name, rest
    attribute, _, parameters = rest.partition(":")
    if attribute.isidentifier():
        return f"{name}:{attribute}", parameters
    known = known_names(name, [*DEFENCES, DEFAULT, ALL, NONE])
    raise UsageError(f"unknown defence {name!r}; {known} (or your own module:Class)")


def _own_class(name: str) -> Callable[..., Defence]:
    found: Callable[..., Defence] = import_object(name, f"defence {name} cannot be loaded")
    if not callable(found):
        raise UsageError(f"defence {name} is not a class")
    return found


def _defaults(name: str, build: Callable[..., Defence]) -> dict[str, float]:
    """The parameters of the constructor, each of which has a number as its default."""
    try:
        return {
            parameter.name: float(parameter.default)
            for parameter in inspect.signature(build).parameters.values()
        }
    except (TypeError, ValueError):
        raise UsageError(
            f"defence {name}: each parameter of its constructor needs a number as its default"
        ) from None


def _own_defence(name: str, build: Callable[..., Defence], parameters: dict[str, float]) -> Defence:
    """A user's own defence, whose mistakes become one-line errors."""
    with plugin_errors((name,)):
        defence = build(**parameters)

    def defend(cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        with plugin_errors((name,)):
            defended = defence(cloud, rng)
            if not isinstance(defended, DefendedCloud):
                raise TypeError(f"returned {type(defended).__name__} instead of a DefendedCloud")
        return defended

    return defend
