"""What every attack declares on its class; the bases of the families build on this."""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.labels.declaration import Family
from advpipe.pipeline.labels.quantity import Quantity


@dataclass(frozen=True, kw_only=True)
class Traits:
    """Properties of an attack that do not depend on its parameters.

    also_known_as: the names that papers give it, in lower case; the command line and files accept them, too.
    """

    also_known_as: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class PublishedPreset:
    """What the published code of a data set does under an attack's name: `--set preset=NAME`.

    attack_class: carries it out; the attack's own if left out. parameters: its defaults. remark: where our
    default differs, and why; "" where it does not. matters: whether that code labels a message as false, from
    what is true, what is claimed and what was true in the station's message before (None for its first).
    """

    attack_class: type[Attack] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remark: str = ""
    matters: Callable[[Mapping[str, Any], Mapping[str, Any], Mapping[str, Any] | None], bool] = (
        lambda true, false, last: True
    )


class Attack(ABC):
    """An attack inherits from the base of its family: `LidarAttack`, `V2xAttack`, `GnssAttack`,
    `RadarAttack` or `CameraAttack`.

    A class that lacks what its base requires is refused when it is registered or loaded. family: follows from
    the base class. family_title: what the family's attacks change, for users. usual_options: of the command
    line, that choose whom the attack concerns, as an example. own_keys: keys of an attack in a scenario file
    that only this family has. traits_type: the class of `traits`. quantities: those of its family, by name.
    presets: what the code of data sets does under its name, by their names.
    """

    family: ClassVar[Family]
    family_title: ClassVar[str]
    usual_options: ClassVar[str] = ""
    own_keys: ClassVar[tuple[str, ...]] = ()
    traits_type: ClassVar[type[Traits]]
    quantities: ClassVar[Mapping[str, Quantity[Any]]]
    presets: ClassVar[Mapping[str, PublishedPreset]] = {}

    @property
    @abstractmethod
    def traits(self) -> Traits:
        """The attack's properties, defined in its own class: a parent's describe another attack."""

    @classmethod
    def measurable(cls) -> Mapping[str, Quantity[Any]]:
        """What its bounds may be of, by name."""
        return cls.quantities


def refuse_undeclared(attack_class: type[Attack]) -> None:
    """Raises AdvpipeError, one line, for a class that does not declare all that its base requires."""
    name = f"{attack_class.__module__}:{attack_class.__qualname__}"
    if missing := sorted(attack_class.__abstractmethods__ if inspect.isabstract(attack_class) else ()):
        raise UsageError(f"{name} is incomplete: it lacks {', '.join(missing)}; see its base class")
    if "traits" not in vars(attack_class):
        raise UsageError(f"{name} inherits the traits of its parent; define its own")
    if not isinstance(found := vars(attack_class)["traits"], attack_class.traits_type):
        raise UsageError(
            f"{name}: traits are {type(found).__name__}, not {attack_class.traits_type.__name__}"
        )


def checked_bounds(
    attack: str, attack_class: type[Attack], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """The bounds as numbers. Raises AdvpipeError for a quantity that is not measured, and for a bound that is
    not finite."""
    checked, measurable = {}, attack_class.measurable()
    for name, (least, most) in bounds.items():
        if name not in measurable:
            known = ", ".join(measurable)
            raise UsageError(f"{attack} bounds {short_repr(name)}, which is not measured; known: {known}")
        if not math.isfinite(float(least) - float(most)):
            raise UsageError(f"{attack} bounds {name} by {least} to {most}, which are not finite numbers")
        checked[name] = float(least), float(most)
    return checked
