"""Finds an implementation of a protocol: a built-in one by its name, or a user's `module:Class`."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr

Build = TypeVar("Build", bound=Callable[..., Any])


def import_object(path: str, refusal: str) -> Any:
    """Import the object that a user's `module:Class` names; the module may lie in the working directory.

    Raises UsageError, one line that begins with `refusal`, if it cannot be imported.
    """
    module, _, attribute = path.partition(":")
    # An installed program does not search the working directory, where the user's file is.
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        return getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:  # a user's module may raise anything
        raise UsageError(f"{refusal}: {type(error).__name__}: {error}") from None


def find_implementation(key: str, name: str, known: Mapping[str, Build]) -> Build:
    """Find the factory (or the user's class) of the implementation `name`, the value of the scenario's `key`.

    known: the built-in factories by name. Raises UsageError, one line, for an unknown name and for a class
    that cannot be loaded.
    """
    if name in known:
        return known[name]
    if ":" not in name:
        raise UsageError(
            f"{key} {short_repr(name)} is unknown; {known_names(name, known)} (or your own module:Class)"
        )
    found: Build = import_object(name, f"{key} {name} cannot be loaded")
    if not callable(found):
        raise UsageError(f"{key} {name} is not a class")
    return found
