"""What stands behind a seam: one of ours by its name, or a user's own `module:Class`."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.shown import shown

Build = TypeVar("Build", bound=Callable[..., Any])


def find_implementation(key: str, name: str, known: Mapping[str, Build]) -> Build:
    """What makes the implementation `name` that the scenario's key names; a user's class is called alike.

    Raises UsageError, one line, for a name that is not known and for a class that cannot be loaded.
    """
    if name in known:
        return known[name]
    module, colon, attribute = name.partition(":")
    if not colon:
        raise UsageError(
            f"{key} {shown(name)} is not known; known: {', '.join(known)}, or module:Class of your own"
        )
    # A program that was installed does not look into the working directory, where the user's file lies.
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        found: Build = getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:  # a user's module may do anything
        raise UsageError(f"{key} {name} cannot be loaded: {type(error).__name__}: {error}") from None
    if not callable(found):
        raise UsageError(f"{key} {name} is no class")
    return found
