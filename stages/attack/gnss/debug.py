"""What viewers show of spoofed GPS: the fix without the attack, the false one, and the believed position."""

from __future__ import annotations

from bisect import bisect_left

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.debug import (
    BELIEVED,
    FALSE,
    TRUE,
    ClaimedPosition,
    positions_cdr,
    positions_topic,
)
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.attack.debug import DebugMessages
from advpipe.stages.attack.gnss.victim import FixRecord, SpoofedVehicle


def add_fixes(debug: DebugMessages, vehicle: SpoofedVehicle) -> None:
    """Add the positions of each attacked fix of a vehicle; those after its last estimate are not attacked."""
    topic = positions_topic(VehicleTopics(vehicle.vehicle).gnss_fix.name)
    times_ns = sorted(vehicle.estimates)
    for raw, record in zip(vehicle.fixes, vehicle.records, strict=False):
        if record.false_fix is None:
            continue
        estimate = vehicle.estimates[times_ns[bisect_left(times_ns, raw.log_time_ns)]]
        claim = _claim(record, record.false_fix.attack, estimate.map_SE3_base[:3, 3])
        debug.add(topic, positions_cdr(record.stamp_ns, [claim]), raw.log_time_ns)


def _claim(record: FixRecord, attack: str, believed_m: Float64) -> ClaimedPosition:
    false_m = None if record.false_fix is None else record.false_fix.position_m
    positions_m = {TRUE: record.true_m, FALSE: false_m, BELIEVED: believed_m}
    return ClaimedPosition(0, attack, {role: m for role, m in positions_m.items() if m is not None})
