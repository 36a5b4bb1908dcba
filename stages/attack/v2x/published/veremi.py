"""VeReMi (SecureComm 2018): `AttackerApp` and `omnetpp.ini` of its branch of Veins.

Its ground truth names attackers, not messages: it calls all of an attacker's messages false, also those
before it stops. Its beacons leave once a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.stages.attack.base import PublishedPreset
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import (
    REFERENCE_POINT_M,
    Falsification,
    OwnMessage,
    PositionFalsification,
)
from advpipe.stages.attack.v2x.published.veins import PlaygroundFalsification, with_velocity_offset

STOP_INCREMENT = 0.025
"""Added to the probability of a stop with each update of the position."""
UPDATE_S = 0.1
"""Between two updates."""
SPEED_MPS = 10.0


class VeremiRandomPosition(PlaygroundFalsification):
    """A random place of the playground in each message: VeReMi 4, and F2MD 3."""

    traits = V2xTraits(
        untrue=("position",),
        every_message_matters=True,
        published=Published(veremi_2018=4, veremi_extension=3),
    )

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return {REFERENCE_POINT_M: self.playground.draw(self.draws.of(message.station_id))}


class VeremiStop(PositionFalsification):
    """Claims the place of a random message from the next one on; all else stays true.

    The probability grows with each update of the position, from the attacker's first message.
    """

    traits = V2xTraits(untrue=("position",), every_message_matters=True, published=Published(veremi_2018=16))

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._draws = AttackDraws(context)
        self._first_ns: dict[int, int] = {}
        self._places_m: dict[int, tuple[float, float]] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if station_id in self._places_m:
            return {REFERENCE_POINT_M: self._places_m[station_id]}
        elapsed_ns = message.time_ns - self._first_ns.setdefault(station_id, message.time_ns)
        updates = 1 + elapsed_ns // round(UPDATE_S * NS_PER_S)
        if self._draws.of(station_id).random() <= updates * STOP_INCREMENT:
            self._places_m[station_id] = message.reference_point_m
        return {}


class VeremiRandomSpeedOffset(Falsification):
    """The true velocity plus a random offset of up to 10 m/s along both axes."""

    traits = V2xTraits(untrue=("speed",), every_message_matters=True, published=Published(veremi_2018=64))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._draws = AttackDraws(context)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        offset_mps = self._draws.of(message.station_id).uniform(-SPEED_MPS, SPEED_MPS, 2).tolist()
        return with_velocity_offset(message, *offset_mps)


PRESETS: Mapping[str, PublishedPreset] = {
    "cam-position-constant": PublishedPreset(
        parameters={"x_m": 5560.0, "y_m": 5820.0},
        remark="A place in the playground of its own map (LuST); ours draws one where this drive takes "
        "place.",
    ),
    "cam-position-offset": PublishedPreset(
        parameters={"x_m": 250.0, "y_m": 150.0},
        remark="250 and -150 m there, as Veins' y axis points south; ours has the smaller offsets of "
        "NextGen, which no range check catches at once.",
    ),
    "cam-position-random": PublishedPreset(
        attack_class=VeremiRandomPosition,
        remark="Draws in the whole playground, here the bounding box of the road network; ours where "
        "vehicles are when the drive begins.",
    ),
    "cam-position-random-offset": PublishedPreset(
        parameters={"min_m": 0.0, "max_m": 300.0},
        remark="Ours has the smaller offsets of NextGen, none of which is within the error of an honest fix.",
    ),
    "cam-speed-constant": PublishedPreset(
        parameters={"speed_mps": 0.0},
        remark="The module's default, as its configuration sets positions by mistake; ours draws a speed.",
    ),
    "cam-speed-random-offset": PublishedPreset(
        attack_class=VeremiRandomSpeedOffset,
        remark="Adds to the velocity along both axes, and a CAM states only its magnitude; ours adds to "
        "the speed, as NextGen does.",
    ),
    "cam-eventual-stop": PublishedPreset(
        attack_class=VeremiStop,
        remark="Freezes the position alone and goes on stating the speed; ours claims to stand, which is "
        "what F2MD does, too.",
    ),
}
