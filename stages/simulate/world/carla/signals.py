"""SUMO's traffic lights in CARLA, joined by the signals of the OpenDRIVE map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

STATES: Mapping[str, str] = {
    "r": "Red",
    "u": "Red",
    "y": "Yellow",
    "g": "Green",
    "s": "Unknown",
    "o": "Unknown",
    "O": "Off",
}
"""SUMO's letters, where small and capital ones mostly mean the same: `carla.TrafficLightState`."""


class Signals:
    """The traffic lights of a world, by the ids that they have in its OpenDRIVE map."""

    def __init__(self, world: Any) -> None:
        self._world = world
        lights = world.get_actors().filter("traffic.traffic_light*")
        self._lights = {light.get_opendrive_id(): light for light in lights}
        self._shown: dict[str, str] = {}

    def show(self, letters: Mapping[str, str]) -> None:
        """Set the lights that SUMO has, and that have changed; CARLA does not switch them by itself."""
        import carla

        for name, letter in letters.items():
            state = STATES.get(letter) or STATES.get(letter.lower(), "Unknown")
            if name not in self._lights or self._shown.get(name) == state:
                continue
            if not self._shown:
                self._world.freeze_all_traffic_lights(True)
            self._lights[name].set_state(getattr(carla.TrafficLightState, state))
            self._shown[name] = state

    def release(self) -> None:
        """Let CARLA switch its lights by itself again."""
        if self._shown:
            self._world.freeze_all_traffic_lights(False)
            self._world.reset_all_traffic_lights()
