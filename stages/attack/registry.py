"""All attacks, by the names that the command line and scenario files use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import nearest_names, suggestion
from advpipe.pipeline.scenario.attacks import AttackSpec, attack_spec
from advpipe.stages.attack.base import Attack, Traits
from advpipe.stages.attack.camera.base import CameraAttack
from advpipe.stages.attack.camera.registry import CAMERA_ATTACKS
from advpipe.stages.attack.gnss.base import GnssAttack
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.lidar.base import LidarAttack, lidar_traits
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.plugin import plugin_attack
from advpipe.stages.attack.radar.base import RadarAttack
from advpipe.stages.attack.radar.registry import RADAR_ATTACKS
from advpipe.stages.attack.v2x.base import V2xAttack
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS

BASES: tuple[type[Attack], ...] = (GnssAttack, V2xAttack, LidarAttack, RadarAttack, CameraAttack)


FAMILY_REGISTRIES: tuple[Mapping[str, type[Attack]], ...] = (
    *(LIDAR_ATTACKS, GNSS_ATTACKS, V2X_ATTACKS),
    *(RADAR_ATTACKS, CAMERA_ATTACKS),
)
"""In the order in which users see them."""


class _Attacks(Mapping[str, type[Attack]]):
    """The attacks of all families; a family's classes are imported when it is searched."""

    def __getitem__(self, name: str) -> type[Attack]:
        for family in FAMILY_REGISTRIES:
            if name in family:
                return family[name]
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        for family in FAMILY_REGISTRIES:
            yield from family

    def __len__(self) -> int:
        return sum(map(len, FAMILY_REGISTRIES))


ATTACKS: Mapping[str, type[Attack]] = _Attacks()
"""Name to class; a user's own attack is named by `module:Class` itself."""


def find_attack(name: str) -> type[Attack]:
    """The class of a name, or of `module:Class`; raises `AdvpipeError` with those like it for any other,
    and for a class that is no attack."""
    if ":" in name:
        return plugin_attack(name)
    if name in ATTACKS:
        return ATTACKS[name]
    meant = suggestion(name, ATTACKS) or f"most like it: {', '.join(nearest_names(name, ATTACKS))}"
    raise UsageError(
        f"unknown attack {name!r}; {meant} (or module:Class of your own; `advpipe attacks` lists all)"
    )


def resolved_name(spec: AttackSpec) -> AttackSpec:
    """The attack under its name here, where it was named as papers call it."""
    if ":" in spec.type or spec.type in ATTACKS:
        return spec
    for name, attack_class in ATTACKS.items():
        traits: Traits = vars(attack_class)["traits"]
        if spec.type.lower() in traits.also_known_as:
            return spec.model_copy(update={"type": name})
    return spec


def refuse_foreign_keys(spec: AttackSpec) -> None:
    """Raises AdvpipeError for a key that only attacks of another family have."""
    own = find_attack(spec.type).own_keys
    for base in BASES:
        for key in base.own_keys:
            if key not in own and getattr(spec, key) != AttackSpec.model_fields[key].default:
                raise UsageError(f"{spec.type} has no use for {key}; leave it out")


def default_budget(name: str) -> dict[str, float]:
    """The budget parameter of an attack on clouds with its default value; empty for other attacks.

    Raises AdvpipeError for an unknown attack.
    """
    attack_class = find_attack(resolved_name(attack_spec({"type": name})).type)
    return (
        lidar_traits(attack_class).budget.default_parameters if issubclass(attack_class, LidarAttack) else {}
    )
