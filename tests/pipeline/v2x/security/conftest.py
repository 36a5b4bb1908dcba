"""The PKI of a drive, a station's ticket, and packets that it signs."""

from __future__ import annotations

from collections.abc import Callable

import pytest

pytest.importorskip("cryptography")

from advpipe.pipeline.v2x.facilities.cam import cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import V2x
from advpipe.pipeline.v2x.security.pki import Pki
from advpipe.pipeline.v2x.stack import PacketBuilder

START_NS = 1_767_268_800_000_000_000
SEED, SENDER = 1, 7


@pytest.fixture(scope="session")
def pki() -> Pki:
    return Pki(SEED, START_NS)


@pytest.fixture
def payload(car: Callable[..., StationState]) -> bytes:
    return encode_cam(cam_of_state(car(time_ns=START_NS, speed_mps=10.0)))


@pytest.fixture
def builder() -> PacketBuilder:
    return PacketBuilder(V2x(security="etsi"), SEED, START_NS)
