"""A bounded reader of untrusted YAML: plain values only, and no aliases, which can expand without limit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import yaml

from advpipe.pipeline.core.plain_values import LONGEST_NUMBER, MOST_LEVELS, refuse_unsafe_strings

if TYPE_CHECKING:
    from yaml import SafeLoader as _Fastest
else:
    _Fastest = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

LIMIT_BYTES = 2 << 20

_BAD_VALUES = (LookupError, TypeError, AttributeError, ArithmeticError)
"""Exceptions of PyYAML, besides its own and ValueError, for a value that does not fit its tag: `!!bool x`."""


class _PlainLoader(_Fastest):
    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        found = super().construct_mapping(node, deep)
        if len(found) < len(node.value):
            raise ValueError("a key is given twice")
        return found


def _number(loader: _PlainLoader, node: yaml.ScalarNode) -> int | float:
    if len(node.value) > LONGEST_NUMBER:
        raise ValueError(f"a number has {len(node.value)} characters; at most {LONGEST_NUMBER} are read")
    is_int = node.tag == "tag:yaml.org,2002:int"
    value: int | float = (loader.construct_yaml_int if is_int else loader.construct_yaml_float)(node)
    return value


for _tag in ("int", "float"):
    _PlainLoader.add_constructor(f"tag:yaml.org,2002:{_tag}", _number)
for _tag in ("binary", "set", "omap", "pairs"):  # types that JSON lacks
    _PlainLoader.add_constructor(f"tag:yaml.org,2002:{_tag}", _PlainLoader.construct_undefined)  # type: ignore[type-var]


def load_yaml(text: str) -> Any:
    """Parse a YAML text to the values that JSON has, and dates.

    Raises yaml.YAMLError or ValueError for a text that is not YAML, has aliases, is too long or too deep,
    repeats a key, or holds a number of more than `LONGEST_NUMBER` characters, a NUL or an unpaired surrogate.
    """
    if len(text) > LIMIT_BYTES:
        raise ValueError(f"{len(text)} characters are too long")
    level = 0
    for event in yaml.parse(text, Loader=_PlainLoader):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not supported")
        level += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if level > MOST_LEVELS:
            raise ValueError(f"nested more than {MOST_LEVELS} levels deep")
    try:
        document = yaml.load(text, Loader=_PlainLoader)
    except _BAD_VALUES as error:
        raise ValueError(f"not a plain value ({error})") from None
    refuse_unsafe_strings(document)
    return document
