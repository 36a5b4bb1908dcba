"""The names of all attacks, for shells: read from the registries' source, as importing the classes of the
attacks takes seconds."""

from __future__ import annotations

import ast
from pathlib import Path


def attack_names() -> list[str]:
    """The first argument of each `add("...", Class)` in the registries of all families."""
    names = []
    for registry in Path(__file__).parent.glob("*/registry.py"):
        for node in ast.walk(ast.parse(registry.read_text(encoding="utf-8"))):
            match node:
                case ast.Call(func=ast.Name(id="add"), args=[ast.Constant(value=str(name)), _]):
                    names.append(name)
    return sorted(names)
