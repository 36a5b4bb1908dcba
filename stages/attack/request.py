"""What to attack with: the request as the user makes it, resolved, and the name it gives its bag."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field

from advpipe.pipeline.bag.frames import ALL_FRAMES, FrameSlice
from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.registry import find_attack

Number = int | float


@dataclass(frozen=True)
class AttackRequest:
    """One attack on one bag.

    type: a word of `registry.ATTACKS`. recipe: one of the attack's recipes.
    parameters: the keyword arguments of the attack's constructor, besides the recipe.
    detector: what `pipeline.detector.registry.load_detector` takes.
    frames: which clouds, counted in the clean bag; the adversarial bag holds only these.
    """

    type: str
    recipe: str = "best"
    parameters: Mapping[str, Number] = field(default_factory=dict)
    detector: str = "small"
    frames: FrameSlice = ALL_FRAMES
    seed: int = 0

    def build(self) -> LidarAttack:
        """The attack, its parameters checked; raises `AdvpipeError` for a bad one."""
        return find_attack(self.type)(recipe=self.recipe, **self.resolved_parameters())

    def resolved_parameters(self) -> dict[str, Number]:
        """All parameters in the constructor's order, those not given at their defaults."""
        known = _parameters_of(self.type)
        unknown = [name for name in self.parameters if name not in known]
        missing = [name for name, default in known.items() if default is None and name not in self.parameters]
        if unknown:
            raise AdvpipeError(f"{self.type}: unknown parameter {unknown[0]!r}; known: {', '.join(known)}")
        if missing:
            raise AdvpipeError(f"{self.type}: {missing[0]} is missing; pass --{missing[0].replace('_', '-')}")
        resolved = {name: self.parameters.get(name, default) for name, default in known.items()}
        return {name: value for name, value in resolved.items() if value is not None}


def attack_id(request: AttackRequest) -> str:
    """The default name of the adversarial bag: type, recipe, and the parameters that are not at their
    defaults, such as `detach-best-0.01` or `detach-best-0.01-rounds20`."""
    known = _parameters_of(request.type)
    words = [
        f"{value:g}" if known[name] is None else f"{name}{value:g}"
        for name, value in request.resolved_parameters().items()
        if value != known[name]
    ]
    return "-".join([request.type, request.recipe, *words])


def _parameters_of(attack: str) -> dict[str, Number | None]:
    """The constructor's parameters besides the recipe, with their defaults; None for a required one."""
    signature = inspect.signature(find_attack(attack))
    return {
        name: None if parameter.default is parameter.empty else parameter.default
        for name, parameter in signature.parameters.items()
        if name != "recipe"
    }
