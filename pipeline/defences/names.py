"""The names of the defences, for shells: read from the registry's source, as importing their classes takes
half a second."""

from __future__ import annotations

import ast
from pathlib import Path


def defence_names() -> list[str]:
    """The keys of `registry.DEFENCES`, in their order."""
    source = Path(__file__).with_name("registry.py").read_text(encoding="utf-8")
    for node in ast.parse(source).body:
        match node:
            case ast.AnnAssign(target=ast.Name(id="DEFENCES"), value=ast.Dict(keys=keys)):
                return [
                    key.value for key in keys if isinstance(key, ast.Constant) and isinstance(key.value, str)
                ]
    return []
