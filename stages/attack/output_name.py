"""The default name of an adversarial bag, from the attacks that make it."""

from __future__ import annotations

import re

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.clouds import topic_of
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.parameters import known_parameters, resolved_parameters, resolved_recipe
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.request import AttackRequest


def output_name(request: AttackRequest, reader: BagReader) -> str:
    """`attack_id`, and for each attack on a LiDAR that is not this bag's default one, that LiDAR, such as
    `detach-best-0.01-ego-rear`. Raises AdvpipeError for a LiDAR that the bag does not have."""
    lidars = [name for spec in request.lidar if (name := _other_lidar(spec, reader))]
    return _file_name("-".join((attack_id(request), *dict.fromkeys(lidars))))


def attack_id(request: AttackRequest) -> str:
    """The default name of the adversarial bag: attack, recipe, and the parameters and credentials that are
    not at their defaults, such as `detach-best-0.01` or `cpm-ghost-credentials-none`; of several attacks,
    joined by +."""
    return _file_name("+".join(_one_id(spec) for spec in request.attacks))


def _file_name(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9._+-]+", "-", text)[:200]


def _other_lidar(spec: AttackSpec, reader: BagReader) -> str:
    """Vehicle and name of the attacked LiDAR; "" for the default one of several, and for the only one."""
    if len(lidar_topics(reader)) < 2:
        return ""
    topic = topic_of(reader, spec)
    if topic == VehicleTopics().lidar_points.name:
        return ""
    return topic.strip("/").removesuffix("/points").replace("/", "-")


def _one_id(spec: AttackSpec) -> str:
    attack_class = find_attack(spec.type)
    known = known_parameters(attack_class)
    first = next(iter(known), None)
    parts = [spec.type, *([recipe] if (recipe := resolved_recipe(spec, attack_class)) else [])]
    for name, value in resolved_parameters(spec, attack_class).items():
        if name == first and issubclass(attack_class, LidarAttack):
            parts.append(_short(value))
        elif value != known.get(name):
            parts.append(name if value is True else f"{name}{_short(value)}")
    if spec.credentials != AttackSpec.model_fields["credentials"].default:
        parts += ["credentials", spec.credentials]
    if spec.network != AttackSpec.model_fields["network"].default:
        parts.append(spec.network)
    return "-".join(parts)


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)
