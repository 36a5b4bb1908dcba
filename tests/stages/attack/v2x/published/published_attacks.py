"""Attacks by their presets, on the straight road of `v2x_lane`: tests import them from here."""

from __future__ import annotations

from dataclasses import replace

from v2x_lane import context, decoded, edited

from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.v2x.build import build_attack
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS

MANY = tuple(range(1, 41))
"""Attackers, of which each draws for itself."""
ADDED = 10**6
"""The number of the first message that an attack adds."""


def published(name, preset, attackers=(1,), seed=5, roads=None, active=lambda time_ns: True, **parameters):
    """An attack with a preset. roads: of the drive."""
    spec = AttackSpec(type=name, parameters={"preset": preset, **parameters})
    about = replace(context(name, attackers=attackers, seed=seed, active=active), roads=lambda: roads)
    return build_attack(spec, V2X_ATTACKS[name], about)


def claims(attack, drive, station_id=1):
    """The CAMs that a station's radio sends, in order, each with its report in a receiver's map."""
    return [decoded(one) for one in edited(attack, drive) if one.station_id == station_id]


def presets(catalogue):
    """The presets of a catalogue, by attack."""
    return {name: kind.presets[catalogue] for name, kind in V2X_ATTACKS.items() if catalogue in kind.presets}
