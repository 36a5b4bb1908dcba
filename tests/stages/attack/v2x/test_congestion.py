from __future__ import annotations

import numpy as np
from one_attacker import START_NS

from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.radio.load import ChannelLoad
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.v2x.congestion import Congestion

STEP_NS = 100_000_000


def kept(congestion: Congestion, busy_ratio: float, steps: int) -> dict[int, list[int]]:
    """Which steps' messages two stations, that send ten times a second, may send."""
    radios = tuple(RadioPlace(number, str(number), np.eye(4), (4, 2, 2), np.zeros(3)) for number in (1, 2))
    found: dict[int, list[int]] = {1: [], 2: []}
    for step in range(steps):
        begin_ns = START_NS + step * STEP_NS
        sent = [Sent(2 * step + number, 0, number, begin_ns + 1000, b"", 23.0) for number in (1, 2)]
        for one in congestion.allowed(V2xStep(begin_ns, begin_ns + STEP_NS, radios, ()), sent):
            found[one.station_id].append(step)
        load = ChannelLoad(begin_ns + STEP_NS, np.array([1, 2]), np.full(2, busy_ratio))
        congestion.observe([load])
    return found


def test_a_full_channel_slows_down_benign_stations():
    """Above 0.59 for a second, a station is restrictive: 460 ms, so every fifth of its messages passes."""
    congestion = Congestion(V2x(), frozenset({2}))
    found = kept(congestion, 0.7, 30)
    assert found[2] == list(range(30))  # the attacker
    assert found[1] == [*range(10), 14, 19, 24, 29]
    assert congestion.held_back == 16


def test_a_free_channel_holds_back_no_message():
    congestion = Congestion(V2x(), frozenset())
    assert kept(congestion, 0.18, 30) == {1: list(range(30)), 2: list(range(30))}
