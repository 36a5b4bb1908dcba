"""YAML of others, read within bounds: plain values, no aliases, which can make a page stand for a library."""

from __future__ import annotations

from typing import Any

import yaml

LIMIT_BYTES = 4 << 20


class _PlainLoader(yaml.SafeLoader):
    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="an alias, which is not read here", problem_mark=mark)
        return super().compose_node(parent, index)


def load(text: str) -> Any:
    """The document's plain values.

    Raises yaml.YAMLError, ValueError or RecursionError for a text that is none, has aliases or is too long.
    """
    if len(text) > LIMIT_BYTES:
        raise ValueError(f"{len(text)} characters are too many")
    return yaml.load(text, Loader=_PlainLoader)
