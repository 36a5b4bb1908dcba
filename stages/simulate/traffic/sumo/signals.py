"""SUMO's traffic lights, and the lights of its vehicles."""

from __future__ import annotations

from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection

PERMISSIVE = "oOrRuUyYsgG"
"""Letters of SUMO's signal states, the most permissive last."""

_BLINKER_RIGHT, _BLINKER_LEFT, _EMERGENCY = 1, 2, 4
_LIGHTS = (
    (_BLINKER_RIGHT | _EMERGENCY, ExteriorLights.RIGHT_TURN_SIGNAL),
    (_BLINKER_LEFT | _EMERGENCY, ExteriorLights.LEFT_TURN_SIGNAL),
    (16, ExteriorLights.LOW_BEAM),
    (32, ExteriorLights.FOG),
    (64, ExteriorLights.HIGH_BEAM),
    (128, ExteriorLights.REVERSE),
)
"""Bits of TraCI's vehicle signals, https://sumo.dlr.de/docs/TraCI/Vehicle_Signalling.html."""


def lights_of(signals: int) -> ExteriorLights:
    """The lights that TraCI's vehicle signals state; running lights are always on.

    >>> lights_of(2).name
    'LEFT_TURN_SIGNAL|DAYTIME_RUNNING'
    """
    lights = ExteriorLights.DAYTIME_RUNNING
    for bits, light in _LIGHTS:
        if signals & bits:
            lights |= light
    return lights


def signal_states(sumo: SumoConnection) -> dict[str, str]:
    """SUMO's letter (r, y, g, ...) of each signal of the road map, by the signal's id in OpenDRIVE.

    netconvert keeps the ids of an OpenDRIVE map's signals as parameters of the traffic light, and writes a
    network's as `<traffic light>_<link>`. Of several links with one signal, the most permissive counts.
    """
    states: dict[str, str] = {}
    for light in sumo.trafficlight.getIDList():
        for link, letter in enumerate(sumo.trafficlight.getRedYellowGreenState(light)):
            given = sumo.trafficlight.getParameter(light, f"linkSignalID:{link}").split()
            for signal in given or [f"{light}_{link}"]:
                states[signal] = max(states.get(signal, letter), letter, key=PERMISSIVE.find)
    return states
