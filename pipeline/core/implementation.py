"""What stands behind a seam: one of ours by its name, or a user's own `module:Class`."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr

Build = TypeVar("Build", bound=Callable[..., Any])


def import_object(word: str, refusal: str) -> Any:
    """What a user's `module:Class` names; the module may lie in the working directory.

    Raises UsageError, one line that begins with `refusal`, for what cannot be imported.
    """
    module, _, attribute = word.partition(":")
    # A program that was installed does not look into the working directory, where the user's file lies.
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        return getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:  # a user's module may do anything
        raise UsageError(f"{refusal}: {type(error).__name__}: {error}") from None


def find_implementation(key: str, name: str, known: Mapping[str, Build]) -> Build:
    """What makes the implementation `name` that the scenario's key names; a user's class is called alike.

    Raises UsageError, one line, for a name that is not known and for a class that cannot be loaded.
    """
    if name in known:
        return known[name]
    if ":" not in name:
        raise UsageError(
            f"{key} {short_repr(name)} is unknown; known: {', '.join(known)}, or your own module:Class"
        )
    found: Build = import_object(name, f"{key} {name} cannot be loaded")
    if not callable(found):
        raise UsageError(f"{key} {name} is not a class")
    return found
