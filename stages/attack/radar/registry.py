"""The attacks on radars by name."""

from __future__ import annotations

from advpipe.stages.attack.family_registry import Add, FamilyRegistry
from advpipe.stages.attack.radar.base import RadarAttack


def _fill(add: Add[RadarAttack]) -> None:
    from advpipe.stages.attack.radar.delete import RadarDelete
    from advpipe.stages.attack.radar.jam import RadarJam
    from advpipe.stages.attack.radar.spoof import RadarSpoof

    add("radar-spoof", RadarSpoof)
    add("radar-jam", RadarJam)
    add("radar-delete", RadarDelete)


RADAR_ATTACKS = FamilyRegistry[RadarAttack]("radar", _fill)
