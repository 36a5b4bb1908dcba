"""The attacks on V2X messages by name."""

from __future__ import annotations

from advpipe.stages.attack.family_registry import Add, FamilyRegistry
from advpipe.stages.attack.v2x.base import V2xAttack


def _add_claims(add: Add[V2xAttack]) -> None:
    """Attacks that falsify the attackers' own claims."""
    from advpipe.stages.attack.v2x.acceleration import Acceleration, FeignedBraking
    from advpipe.stages.attack.v2x.dimensions import Dimensions
    from advpipe.stages.attack.v2x.heading import HeadingReversed, HeadingRotating
    from advpipe.stages.attack.v2x.mix import Mix
    from advpipe.stages.attack.v2x.out_of_range import OutOfRange
    from advpipe.stages.attack.v2x.position import (
        PositionConstant,
        PositionMirrored,
        PositionOffset,
        PositionRandom,
        PositionRandomOffset,
    )
    from advpipe.stages.attack.v2x.speed import (
        SpeedConstant,
        SpeedFrozen,
        SpeedOffset,
        SpeedRandom,
        SpeedRandomOffset,
    )
    from advpipe.stages.attack.v2x.stop import EventualStop, SuddenStop

    add("cam-position-constant", PositionConstant)
    add("cam-position-offset", PositionOffset)
    add("cam-position-random", PositionRandom)
    add("cam-position-random-offset", PositionRandomOffset)
    add("cam-position-mirrored", PositionMirrored)
    add("cam-speed-constant", SpeedConstant)
    add("cam-speed-offset", SpeedOffset)
    add("cam-speed-random", SpeedRandom)
    add("cam-speed-random-offset", SpeedRandomOffset)
    add("cam-speed-frozen", SpeedFrozen)
    add("cam-heading-reversed", HeadingReversed)
    add("cam-heading-rotating", HeadingRotating)
    add("cam-acceleration", Acceleration)
    add("cam-feigned-braking", FeignedBraking)
    add("cam-dimensions", Dimensions)
    add("cam-out-of-range", OutOfRange)
    add("cam-eventual-stop", EventualStop)
    add("cam-sudden-stop", SuddenStop)
    add("cam-mix", Mix)


def _add_streams(add: Add[V2xAttack]) -> None:
    """Attacks on the message stream: replay, delay, drop, masquerade, flooding, Sybil, ghost vehicles."""
    from advpipe.stages.attack.v2x.delay import Delay, Stale
    from advpipe.stages.attack.v2x.drop import Drop
    from advpipe.stages.attack.v2x.flood import (
        Dos,
        DosDisruptive,
        DosDisruptiveSybil,
        DosRandom,
        DosRandomSybil,
    )
    from advpipe.stages.attack.v2x.ghosts_ahead import GhostBrake, GhostStop
    from advpipe.stages.attack.v2x.masquerade import Masquerade
    from advpipe.stages.attack.v2x.replay import CamReplay, DisruptiveReplay
    from advpipe.stages.attack.v2x.sybil import SybilCongestion, SybilGrid, SybilReplay

    add("cam-replay", CamReplay)
    add("cam-disruptive-replay", DisruptiveReplay)
    add("cam-stale", Stale)
    add("cam-delay", Delay)
    add("cam-drop", Drop)
    add("cam-masquerade", Masquerade)
    add("cam-dos", Dos)
    add("cam-dos-random", DosRandom)
    add("cam-dos-disruptive", DosDisruptive)
    add("cam-dos-random-sybil", DosRandomSybil)
    add("cam-dos-disruptive-sybil", DosDisruptiveSybil)
    add("cam-sybil-grid", SybilGrid)
    add("cam-sybil-replay", SybilReplay)
    add("cam-sybil-congestion", SybilCongestion)
    add("cam-ghost-stop", GhostStop)
    add("cam-ghost-brake", GhostBrake)


def _add_collective_perception(add: Add[V2xAttack]) -> None:
    """Attacks on the objects in CPMs."""
    from advpipe.stages.attack.v2x.perceived_objects import CpmGhost, CpmRemove, CpmShift

    add("cpm-ghost", CpmGhost)
    add("cpm-remove", CpmRemove)
    add("cpm-shift", CpmShift)


def _add_warnings(add: Add[V2xAttack]) -> None:
    """Attacks on warnings (DENMs)."""
    from advpipe.stages.attack.v2x.denm_false import DenmFalse
    from advpipe.stages.attack.v2x.denm_suppress import DenmSuppress

    add("denm-false", DenmFalse)
    add("denm-suppress", DenmSuppress)


def _add_all(add: Add[V2xAttack]) -> None:
    from advpipe.stages.attack.v2x.published import f2md, nextgen, veremi

    catalogues = {"veremi": veremi.PRESETS, "f2md": f2md.PRESETS, "nextgen": nextgen.PRESETS}

    def add_with_presets(name: str, attack_class: type[V2xAttack]) -> None:
        attack_class.presets = {key: presets[name] for key, presets in catalogues.items() if name in presets}
        add(name, attack_class)

    _add_claims(add_with_presets)
    _add_streams(add_with_presets)
    _add_collective_perception(add)
    _add_warnings(add_with_presets)


V2X_ATTACKS = FamilyRegistry[V2xAttack]("v2x", _add_all)
