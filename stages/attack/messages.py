"""The attacks on messages: GPS first, then V2X, which tells others what the GPS said."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.change import Change

if TYPE_CHECKING:
    from advpipe.stages.attack.v2x.editor import MessageEditor


def change_messages(reader: BagReader, attacks: Sequence[AttackSpec], seed: int) -> list[Change]:
    """What the attacks of both families make of a bag's messages; no topic belongs to two changes.

    Raises AdvpipeError for a bag without what they attack.
    """
    changes: list[Change] = []
    gnss = [spec for spec in attacks if spec.family == "gnss"]
    cam = [spec for spec in attacks if spec.family == "cam"]
    editors: tuple[MessageEditor, ...] = ()
    if gnss:
        from advpipe.stages.attack.gnss.change import spoof

        spoofed = spoof(reader, gnss, seed)
        changes.append(spoofed)
        editors = spoofed.editors()
    has_v2x = {V2X_STATIONS.name, V2X_SENT.name} <= set(reader.topics)
    if cam or (editors and has_v2x):
        from advpipe.stages.attack.v2x.change import forge

        changes.append(forge(reader, cam, seed, editors, dcc_reacts=any(spec.dcc_reacts for spec in cam)))
    return changes
