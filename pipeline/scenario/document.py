"""A bounded reader of a scenario's YAML: plain values, with aliases expanded, and the line of each key."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import yaml

from advpipe.pipeline.core.short_repr import short_repr, shorten

if TYPE_CHECKING:
    from yaml import SafeLoader as _Fastest
else:
    _Fastest = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

LIMIT_BYTES = 4_000_000
MOST_LEVELS = 50
MOST_NODES = 100_000
"""Keys, values and lists; those that aliases repeat count each time. Python takes some 50 MB for them."""

MOST_CHARACTERS = LIMIT_BYTES
"""Characters of all strings, counted likewise: aliases expand to no more than a file may hold."""

LONGEST_NUMBER = 100
"""Characters of a number; the largest number that any key allows has 19 digits."""

_YAML = "tag:yaml.org,2002:"
_PLAIN = {f"{_YAML}{name}" for name in ("str", "int", "float", "bool", "null", "timestamp")}
_NUMBERS = (f"{_YAML}int", f"{_YAML}float")
_MERGE = f"{_YAML}merge"

_UNPRINTED = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")
"""Characters that no file name may hold or that a terminal interprets: controls other than tab and newline,
and surrogates."""

_BAD_VALUES = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError)
"""Exceptions of PyYAML, besides its own, for a value that does not fit its tag: `!!bool x`."""


class DocumentError(ValueError):
    """The text is not a document of plain values. line: counted from 1, or None where no line is at fault."""

    def __init__(self, problem: str, line: int | None = None) -> None:
        super().__init__(problem)
        self.line = line


@dataclass(frozen=True)
class ScenarioText:
    """The values of a text and the lines of its keys; nothing in `tree` is shared, so it may be changed."""

    tree: Any
    _root: yaml.Node | None

    def lines(self) -> dict[tuple[str, ...], int]:
        """The line of each key, by the key's path; keys that an alias repeats are listed once."""
        found: dict[tuple[str, ...], int] = {}
        visited: set[int] = set()

        def visit(node: yaml.Node | None, place: tuple[str, ...]) -> None:
            if isinstance(node, yaml.CollectionNode) and id(node) not in visited:
                visited.add(id(node))
                is_list = isinstance(node, yaml.SequenceNode)
                for index, item in enumerate(node.value):
                    key, value = (item, item) if is_list else item
                    here = (*place, str(index) if is_list else str(key.value))
                    found[here] = _line(key)
                    visit(value, here)

        visit(self._root, ())
        return found


def read_document(text: str) -> ScenarioText:
    """Parse a YAML text to plain values.

    Raises DocumentError for a text that is not YAML or is too large with its aliases expanded, an unsupported
    tag, a repeated key, an invalid value (such as 30 February), and a character that cannot be shown.
    """
    if len(text) > LIMIT_BYTES:
        raise DocumentError(f"{len(text)} characters; at most {LIMIT_BYTES} are read")
    if found := (yaml.reader.Reader.NON_PRINTABLE.search(text) or _UNPRINTED.search(text)):
        raise DocumentError(_unprinted(found[0]), text.count("\n", 0, found.start()) + 1)
    try:
        _check_events(text)
        root = yaml.compose(text, Loader=_Fastest)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or "it cannot be read"
        last = text.count("\n") + 1
        raise DocumentError(
            f"not YAML: {shorten(str(problem))}", min(mark.line + 1, last) if mark else None
        ) from None
    if root is None:
        return ScenarioText(None, None)
    _Sizes().add(root)
    return ScenarioText(_Plain("").value_of(root), root)


def _check_events(text: str) -> None:
    """Bound the number of nodes and their depth before they are composed, which takes memory."""
    count = level = 0
    for event in yaml.parse(text, Loader=_Fastest):
        line = event.start_mark.line + 1 if event.start_mark else None
        count += isinstance(event, yaml.NodeEvent)
        level += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if level > MOST_LEVELS:
            raise DocumentError(f"is nested more than {MOST_LEVELS} levels deep", line)
        if count > MOST_NODES:
            raise DocumentError(f"holds more than {MOST_NODES} keys and values", line)


class _Sizes:
    """Counts the nodes and characters of a node with its aliases expanded."""

    def __init__(self) -> None:
        self._of: dict[int, tuple[int, int, int] | None] = {}

    def add(self, node: yaml.Node) -> tuple[int, int, int]:
        """Count nodes, characters and levels. Raises DocumentError above a limit or for a cyclic node."""
        if id(node) in self._of:
            known = self._of[id(node)]
            if known is None:
                raise DocumentError("an alias refers to a value that contains the alias itself", _line(node))
            return known
        self._of[id(node)] = None
        nodes, characters, levels = 1, 0, 1
        if isinstance(node, yaml.ScalarNode):
            characters = len(node.value)
        for part in _parts(node):
            own = self.add(part)
            nodes, characters = nodes + own[0], characters + own[1]
            levels = max(levels, own[2] + 1)
        for count, most, what in (
            (nodes, MOST_NODES, "keys and values"),
            (characters, MOST_CHARACTERS, "characters"),
            (levels, MOST_LEVELS + 1, "levels"),
        ):
            if count > most:
                raise DocumentError(
                    f"holds more than {most} {what} once its aliases are expanded", _line(node)
                )
        self._of[id(node)] = nodes, characters, levels
        return nodes, characters, levels


class _Plain(yaml.SafeLoader):
    """Constructs the value of a node, anew for each use of an alias."""

    def value_of(self, node: yaml.Node) -> Any:
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        kind = "map" if isinstance(node, yaml.MappingNode) else "seq"
        if node.tag != f"{_YAML}{kind}":
            raise DocumentError(f"the tag {short_repr(node.tag)} is not supported; leave it out", _line(node))
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node)
        return [self.value_of(item) for item in node.value]

    def _mapping(self, node: yaml.MappingNode) -> dict[str, Any]:
        own: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if key_node.tag == _MERGE:
                merged = {**self._merged(value_node), **merged}
                continue
            key = self._scalar(key_node) if isinstance(key_node, yaml.ScalarNode) else None
            if not isinstance(key, str):
                what = (
                    short_repr(key_node.value)
                    if isinstance(key_node, yaml.ScalarNode)
                    else "a list or a mapping"
                )
                raise DocumentError(f"{what} is not a valid key; write the key in quotes", _line(key_node))
            if key in own:
                raise DocumentError(f"{short_repr(key)} is given twice", _line(key_node))
            own[key] = self.value_of(value_node)
        return {**merged, **own}

    def _merged(self, node: yaml.Node) -> dict[str, Any]:
        """The keys that `<<` merges from one mapping or several; the first mapping has precedence."""
        parts = node.value if isinstance(node, yaml.SequenceNode) else [node]
        values = [self.value_of(part) for part in parts]
        if not all(isinstance(value, dict) for value in values):
            raise DocumentError("<< takes a mapping, or a list of mappings", _line(node))
        return {key: value for part in reversed(values) for key, value in part.items()}

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        if node.tag not in _PLAIN:
            raise DocumentError(f"the tag {short_repr(node.tag)} is not supported; leave it out", _line(node))
        if found := _UNPRINTED.search(node.value):
            raise DocumentError(_unprinted(found[0]), _line(node))
        if node.tag in _NUMBERS and ":" in node.value and not node.style:
            return node.value  # sexagesimal in YAML 1.1: 1:30 would be 90; here it is a string
        if node.tag in _NUMBERS and len(node.value) > LONGEST_NUMBER:
            raise DocumentError(
                f"a number has {len(node.value)} characters; at most {LONGEST_NUMBER} are read", _line(node)
            )
        try:
            return self.construct_object(node)
        except (yaml.YAMLError, *_BAD_VALUES) as error:
            kind = node.tag.removeprefix(_YAML)
            reason = f" ({shorten(str(error))})" if isinstance(error, ValueError) else ""
            raise DocumentError(
                f"{short_repr(node.value)} is not a valid {kind}{reason}", _line(node)
            ) from None


def _parts(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.SequenceNode):
        return list(node.value)
    return [part for pair in node.value for part in pair] if isinstance(node, yaml.MappingNode) else []


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def _unprinted(character: str) -> str:
    return f"holds the character U+{ord(character):04X}, which cannot be shown; leave it out"
