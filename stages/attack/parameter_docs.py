"""The parameters of an attack for users, with types and help from its class."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from advpipe.stages.attack.base import Attack
from advpipe.stages.attack.parameters import PRESET, known_parameters, parameter_types

_HEAD = re.compile(r"(?:^|(?<=[.;]\s))(\w+(?:,\s+\w+)*):\s", re.MULTILINE)
"""`name: ` or `name, other: ` where a line or a sentence begins."""

_REFERENCE = re.compile(r"see `(?:\w+\.)*(\w+)`")
"""The text of a parameter whose explanation is in another class of the module."""


@dataclass(frozen=True)
class Parameter:
    """One parameter. types: of a value, or of the items of a list; empty if the attack declares none.
    default: `REQUIRED` for none. help: "" where no docstring has `name: ...`."""

    name: str
    types: tuple[Any, ...]
    default: Any
    help: str


def documented_parameters(attack_class: type[Attack]) -> tuple[Parameter, ...]:
    """All parameters of a class but its recipe, in their order; the preset is last, if it has presets."""
    known, types = known_parameters(attack_class), parameter_types(attack_class)
    texts: dict[str, str] = {}
    for owner in attack_class.__mro__:
        texts = {**_texts(owner, known), **texts}
    own = tuple(
        Parameter(name, types.get(name, ()), default, texts.get(name, "")) for name, default in known.items()
    )
    presets = ", ".join(vars(attack_class).get("presets", {}))
    return (
        (*own, Parameter(PRESET, (str,), None, f"what a data set's code does: {presets}")) if presets else own
    )


def summary(attack_class: type[Attack]) -> str:
    """The first paragraph of the class's docstring, on one line; "" for none."""
    return " ".join(_docstring(attack_class).partition("\n\n")[0].split())


def recipe_text(kind: type[Attack]) -> str:
    """What the classes say of the recipe; "" for an attack that has none."""
    return next((text for owner in kind.__mro__ if (text := _texts(owner, ["recipe"]).get("recipe"))), "")


def _texts(owner: type, names: Collection[str]) -> dict[str, str]:
    """The texts of these names in a docstring: from `name: ` to the next name or the paragraph's end."""
    texts = {}
    for paragraph in _docstring(owner).split("\n\n"):
        heads = [*_HEAD.finditer(paragraph)]
        ends = [*(head.start() for head in heads), None][1:]
        for head, end in zip(heads, ends, strict=True):
            text = " ".join(paragraph[head.end() : end].split()).removesuffix(";")
            texts.update(dict.fromkeys(re.split(r",\s+", head[1]), text))
    texts = {name: text for name, text in texts.items() if name in names}
    for each, text in texts.items():
        if reference := _REFERENCE.match(text):
            other = getattr(sys.modules[owner.__module__], reference[1], None)
            texts[each] = _texts(other, names).get(each, "") if inspect.isclass(other) else text
    return texts


def _docstring(owner: type) -> str:
    """The docstring of the class itself; "" where it is only the signature that dataclasses add."""
    written = vars(owner).get("__doc__") or ""
    return "" if written.startswith(f"{owner.__name__}(") else inspect.cleandoc(written)
