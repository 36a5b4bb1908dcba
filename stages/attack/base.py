"""What any attack declares of itself, on its class: the bases of the three families build on this."""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.labels.declaration import Family
from advpipe.pipeline.labels.quantity import Quantity


@dataclass(frozen=True, kw_only=True)
class Traits:
    """What is known of an attack whatever its parameters.

    also_known_as: what papers call it, in lower case; taken for its name on the command line and in files.
    """

    also_known_as: tuple[str, ...] = ()


class Attack(ABC):
    """One of the three families' bases is what an attack inherits from: `LidarAttack`, `V2xAttack` or
    `GnssAttack`. A class that lacks what its base asks for is refused when it is registered or loaded.

    family: by the base class. own_keys: of an attack in a scenario file, those that this family alone knows.
    traits_type: what `traits` has to be. quantities: those of its family, by name.
    """

    family: ClassVar[Family]
    own_keys: ClassVar[tuple[str, ...]] = ()
    traits_type: ClassVar[type[Traits]]
    quantities: ClassVar[Mapping[str, Quantity[Any]]]

    @property
    @abstractmethod
    def traits(self) -> Traits:
        """What is known of the attack, in the body of its own class: a parent's is that of another attack."""

    @classmethod
    def measurable(cls) -> Mapping[str, Quantity[Any]]:
        """What its bounds may be of, by name."""
        return cls.quantities


def refuse_undeclared(kind: type[Attack]) -> None:
    """Raises AdvpipeError, one line, for a class that does not declare all that its base asks for."""
    name = f"{kind.__module__}:{kind.__qualname__}"
    if missing := sorted(kind.__abstractmethods__ if inspect.isabstract(kind) else ()):
        raise UsageError(f"{name} is no whole attack: it lacks {', '.join(missing)}; see its base class")
    if "traits" not in vars(kind):
        raise UsageError(f"{name} declares no traits of its own, only its parent's; give it some")
    if not isinstance(found := vars(kind)["traits"], kind.traits_type):
        raise UsageError(f"{name}: traits are {type(found).__name__}, no {kind.traits_type.__name__}")


def checked_bounds(
    attack: str, kind: type[Attack], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """The bounds as numbers. Raises AdvpipeError for a quantity that nobody measures, and for one that is not
    finite."""
    checked, measurable = {}, kind.measurable()
    for name, (least, most) in bounds.items():
        if name not in measurable:
            known = ", ".join(measurable)
            raise UsageError(f"{attack} bounds {short_repr(name)}, which nobody measures; known: {known}")
        if not math.isfinite(float(least) - float(most)):
            raise UsageError(f"{attack} bounds {name} by {least} to {most}, which are no finite numbers")
        checked[name] = float(least), float(most)
    return checked
