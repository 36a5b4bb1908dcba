"""YAML of others, read within bounds: plain values, no aliases, which can make a page stand for a library."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from yaml import SafeLoader as _Fastest
else:
    _Fastest = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

LIMIT_BYTES = 2 << 20
MOST_LEVELS = 100
LONGEST_NUMBER = 100
"""Signs of a number: PyYAML takes the square of their count to read `1:1:1...`, a number to base 60."""

_BAD_VALUES = (LookupError, TypeError, AttributeError, ArithmeticError)
"""What PyYAML raises, beside its own errors and ValueError, on a value not of its tag: `!!bool x`."""


class _PlainLoader(_Fastest):
    pass


def _number(loader: _PlainLoader, node: yaml.ScalarNode) -> int | float:
    if len(node.value) > LONGEST_NUMBER:
        raise ValueError(f"a number of {len(node.value)} signs")
    is_int = node.tag == "tag:yaml.org,2002:int"
    value: int | float = (loader.construct_yaml_int if is_int else loader.construct_yaml_float)(node)
    return value


for _tag in ("int", "float"):
    _PlainLoader.add_constructor(f"tag:yaml.org,2002:{_tag}", _number)


def load(text: str) -> Any:
    """The document's plain values.

    Raises yaml.YAMLError or ValueError for a text that is none, has aliases, is too long or too deep.
    """
    if len(text) > LIMIT_BYTES:
        raise ValueError(f"{len(text)} characters are too many")
    level = 0
    for event in yaml.parse(text, Loader=_PlainLoader):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError("an alias, which is not read here")
        level += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
    try:
        return yaml.load(text, Loader=_PlainLoader)
    except _BAD_VALUES as error:
        raise ValueError(f"no plain value ({error})") from None
