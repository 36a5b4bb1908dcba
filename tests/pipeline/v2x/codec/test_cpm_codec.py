"""CPMs: our encoding, pycrate's and asn1tools' of the same ASN.1 are the same bytes."""

from __future__ import annotations

from contextlib import suppress
from random import Random
from typing import Any

import pytest

from advpipe.pipeline.v2x.codec.cpm_asn1 import asn1_text
from advpipe.pipeline.v2x.codec.cpm_codec import CONTAINERS, CPM_CODEC, OBJECTS, CpmError, asn1_part
from advpipe.pipeline.v2x.codec.uper import Uper
from tests.pipeline.v2x.codec.random_values import as_asn1tools_takes_it, random_value

TYPES = ("CollectivePerceptionMessage", *CONTAINERS.values())


def message(rng: Random, containers: tuple[int, ...] = tuple(CONTAINERS)) -> dict[str, Any]:
    tree = random_value(asn1_part(TYPES[0]), rng)
    tree["header"] |= {"protocolVersion": 2, "messageId": 14}
    tree["payload"]["cpmContainers"] = [
        {"containerId": each, "containerData": random_value(asn1_part(CONTAINERS[each]), rng)}
        for each in containers
    ]
    return tree


@pytest.fixture(scope="module")
def oracle() -> Any:
    asn1tools = pytest.importorskip("asn1tools")
    return asn1tools.compile_string(asn1_text(), "uper")


@pytest.mark.oracle
@pytest.mark.parametrize("name", TYPES)
def test_random_values_are_encoded_as_by_pycrate_and_asn1tools(oracle: Any, name: str) -> None:
    rng, asn1 = Random(name), asn1_part(name)
    ours = Uper(asn1)
    for _ in range(100):
        value = random_value(asn1, rng)
        encoded = ours.encode(value)
        assert encoded == asn1.to_uper(value)
        assert encoded == oracle.encode(name, as_asn1tools_takes_it(asn1, value), check_constraints=True)
        assert ours.decode(encoded) == value


def test_messages_are_read_as_they_were_written() -> None:
    rng = Random(1)
    for _ in range(100):
        tree = message(rng)
        assert CPM_CODEC.decode(CPM_CODEC.encode(tree)) == tree


def test_pycrate_reads_what_the_fast_codec_gives_up_on() -> None:
    rng = Random(2)
    tree = message(rng, (OBJECTS,))
    container = tree["payload"]["cpmContainers"][0]["containerData"]
    some = random_value(asn1_part("PerceivedObject"), rng)
    container["perceivedObjects"] = [some] * 300  # more than the 255 of the first release: an extension
    assert CPM_CODEC.decode(CPM_CODEC.encode(tree)) == tree


def test_containers_of_later_releases_are_kept_as_bytes() -> None:
    tree = message(Random(3), ())
    tree["payload"]["cpmContainers"] = [{"containerId": 9, "containerData": b"\x01\x02"}]
    assert CPM_CODEC.decode(CPM_CODEC.encode(tree)) == tree


@pytest.mark.parametrize("cut", [1, 8, 30])
def test_truncated_messages_are_refused(cut: int) -> None:
    payload = CPM_CODEC.encode(message(Random(4)))
    with pytest.raises(CpmError, match="bytes are not"):
        CPM_CODEC.decode(payload[:-cut])


def test_corrupt_bytes_are_refused_or_read() -> None:
    rng = Random(5)
    payload = CPM_CODEC.encode(message(rng))
    for _ in range(300):
        bad = bytearray(payload)
        bad[rng.randrange(len(bad))] ^= 1 << rng.randrange(8)
        with suppress(CpmError):  # and nothing else
            assert CPM_CODEC.decode(bytes(bad))


def test_other_messages_and_values_out_of_range_are_refused() -> None:
    tree = message(Random(6))
    cam = {**tree, "header": {**tree["header"], "messageId": 2}}
    with pytest.raises(CpmError, match="message 2 of protocol version 2 is not a CPM"):
        CPM_CODEC.decode(CPM_CODEC.encode(cam))
    with pytest.raises(CpmError, match="cannot encode these values as a CPM"):
        CPM_CODEC.encode({**tree, "header": {**tree["header"], "stationId": -1}})
    tree["payload"]["cpmContainers"] = [{"containerId": 1, "containerData": {"orientationAngle": 7}}]
    with pytest.raises(CpmError, match="OriginatingVehicleContainer"):
        CPM_CODEC.encode(tree)
