"""The attacks on GPS by name."""

from __future__ import annotations

from advpipe.stages.attack.family_registry import Add, FamilyRegistry
from advpipe.stages.attack.gnss.base import GnssAttack


def _fill(add: Add[GnssAttack]) -> None:
    from advpipe.stages.attack.gnss.bias import Bias
    from advpipe.stages.attack.gnss.drift import Drift
    from advpipe.stages.attack.gnss.drift_aware import DriftAware
    from advpipe.stages.attack.gnss.freeze import Freeze
    from advpipe.stages.attack.gnss.jam import Jam
    from advpipe.stages.attack.gnss.jump import Jump
    from advpipe.stages.attack.gnss.relocate import Relocate
    from advpipe.stages.attack.gnss.replay import GnssReplay
    from advpipe.stages.attack.gnss.walk import RandomWalk

    add("gnss-bias", Bias)
    add("gnss-relocate", Relocate)
    add("gnss-drift", Drift)
    add("gnss-drift-aware", DriftAware)
    add("gnss-jump", Jump)
    add("gnss-walk", RandomWalk)
    add("gnss-replay", GnssReplay)
    add("gnss-freeze", Freeze)
    add("gnss-jam", Jam)


GNSS_ATTACKS = FamilyRegistry[GnssAttack]("gnss", _fill)
