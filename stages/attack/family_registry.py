"""The attacks of one family by name; their classes are imported when one is first needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Generic, TypeVar, cast

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.labels.declaration import Family
from advpipe.stages.attack.base import Attack, refuse_undeclared
from advpipe.stages.attack.plugin import plugin_attack

A = TypeVar("A", bound=Attack)


Add = Callable[[str, type[A]], None]
"""Registers a class under a name; to type checkers, a class that is abstract still is an error."""


class FamilyRegistry(Mapping[str, type[A]], Generic[A]):
    """`fill` imports the classes and adds them, in the order in which users see them.

    The first look-up raises AdvpipeError for a class that does not declare what its base requires.
    """

    def __init__(self, family: Family, fill: Callable[[Add[A]], None]) -> None:
        self.family, self._fill = family, fill

    @cached_property
    def _classes(self) -> dict[str, type[A]]:
        classes: dict[str, type[A]] = {}

        def add(name: str, attack_class: type[A]) -> None:
            refuse_undeclared(attack_class)
            if classes.setdefault(name, attack_class) is not attack_class:
                raise ValueError(f"two attacks are named {name}")

        self._fill(add)
        return classes

    def __getitem__(self, name: str) -> type[A]:
        return self._classes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._classes)

    def __len__(self) -> int:
        return len(self._classes)

    def find(self, name: str) -> type[A]:
        """The class of a name, or of `module:Class`, in this family. Raises AdvpipeError for any other."""
        if name in self._classes:
            return self._classes[name]
        if ":" not in name:
            raise UsageError(
                f"unknown attack {name!r}; {known_names(name, self)} (or module:Class of your own)"
            )
        attack_class = plugin_attack(name)
        if attack_class.family != self.family:
            raise ValueError(f"{name} is an attack of the family {attack_class.family}, not {self.family}")
        return cast("type[A]", attack_class)
