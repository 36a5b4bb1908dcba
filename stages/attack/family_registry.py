"""The attacks of one family by name: classes that are imported when somebody first asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Generic, TypeVar, cast

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.declaration import Family
from advpipe.stages.attack.base import Attack, refuse_undeclared
from advpipe.stages.attack.plugin import plugin_attack

A = TypeVar("A", bound=Attack)


Add = Callable[[str, type[A]], None]
"""Registers a class under a name; to type checkers, a class that is abstract still is an error."""


class FamilyRegistry(Mapping[str, type[A]], Generic[A]):
    """`fill` imports the classes and adds them, in the order in which they are told to users.

    Raises AdvpipeError when it is first asked for a class that does not declare what its base asks for.
    """

    def __init__(self, family: Family, fill: Callable[[Add[A]], None]) -> None:
        self.family, self._fill = family, fill

    @cached_property
    def _kinds(self) -> dict[str, type[A]]:
        kinds: dict[str, type[A]] = {}

        def add(name: str, kind: type[A]) -> None:
            refuse_undeclared(kind)
            if kinds.setdefault(name, kind) is not kind:
                raise ValueError(f"two attacks are named {name}")

        self._fill(add)
        return kinds

    def __getitem__(self, name: str) -> type[A]:
        return self._kinds[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)

    def find(self, word: str) -> type[A]:
        """The class of a name, or of `module:Class`, in this family. Raises AdvpipeError for none."""
        if word in self._kinds:
            return self._kinds[word]
        if ":" not in word:
            raise UsageError(
                f"unknown attack {word!r}; known: {', '.join(self)}, or module:Class of your own"
            )
        kind = plugin_attack(word)
        if kind.family != self.family:
            raise ValueError(f"{word} is an attack of the family {kind.family}, not {self.family}")
        return cast("type[A]", kind)
