"""The attacks on messages: GPS first, then V2X, whose messages carry the GPS positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS
from advpipe.pipeline.scenario.attacks import AttackSpec, RadioOf
from advpipe.stages.attack.change import Change

if TYPE_CHECKING:
    from advpipe.stages.attack.debug import DebugMessages
    from advpipe.stages.attack.v2x.base import MessageEditor


def change_messages(
    reader: BagReader,
    gnss: Sequence[AttackSpec],
    v2x: Sequence[AttackSpec],
    seed: int,
    debug: DebugMessages | None = None,
    radar: Sequence[AttackSpec] = (),
    camera: Sequence[AttackSpec] = (),
) -> list[Change]:
    """The changes that the attacks of these families make to a bag's messages; no topic belongs to two.

    debug: takes what viewers show of the attacks. Raises AdvpipeError for a bag that lacks what they attack,
    or V2X where they name a network.
    """
    changes: list[Change] = []
    editors: tuple[MessageEditor, ...] = ()
    if gnss:
        from advpipe.stages.attack.gnss.change import spoof
        from advpipe.stages.attack.gnss.debug import add_fixes

        spoofed = spoof(reader, gnss, seed)
        changes.append(spoofed)
        if debug is not None:
            for vehicle in spoofed.vehicles:
                add_fixes(debug, vehicle)
        editors = spoofed.editors()
    has_v2x = {V2X_STATIONS.name, V2X_SENT.name} <= set(reader.topics)
    network: RadioOf = "artery" if "artery" in {spec.network for spec in (*gnss, *v2x)} else "embedded"
    if not v2x and not has_v2x and network != "embedded":
        raise UsageError(f"{reader.path}: has no V2X that could go through {network}; leave out network")
    if v2x or (editors and has_v2x):
        from advpipe.stages.attack.v2x.change import forge

        dcc_reacts = any(spec.dcc_reacts for spec in v2x)
        changes.append(forge(reader, v2x, seed, editors, dcc_reacts=dcc_reacts, network=network, debug=debug))
    if radar:
        from advpipe.stages.attack.radar.change import attack_radars

        changes.append(attack_radars(reader, radar, seed))
    if camera:
        from advpipe.stages.attack.camera.change import attack_cameras

        changes.append(attack_cameras(reader, camera, seed))
    return changes
