"""CAMs for the tests of more than one package: random ones, drawn from the ASN.1 itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.v2x.codec import asn1_cam

CamTree = dict[str, Any]

CAM_VECTOR = bytes.fromhex(
    "020200cafe01d431405a56bd962cbb361f2064050708431d4a5c4d2122b68402c08a501bda61f7f8903d6054e0d402810025"
    "fff58000b1ce001b6ffc8c00738e7001b77fcb60070c7380149bfd930053e39c00db80"
)
"""A CAM that pycrate, asn1tools, asn1c and tshark read alike."""


@pytest.fixture
def cam_vector() -> bytes:
    return CAM_VECTOR


@pytest.fixture
def random_cam_tree() -> Callable[..., CamTree]:
    def random_cam_tree(rng: np.random.Generator, vehicle: bool = False) -> CamTree:
        """Any values that the ASN.1 allows, the ends of ranges often; of a vehicle alone if so asked."""
        tree: CamTree = _random_value(asn1_cam(), rng)
        tree["header"] |= {"protocolVersion": 2, "messageID": 2}
        while vehicle and tree["cam"]["camParameters"]["highFrequencyContainer"][0].startswith("rsu"):
            tree = random_cam_tree(rng)
        return tree

    return random_cam_tree


def _random_value(asn1: Any, rng: np.random.Generator) -> Any:
    match asn1.TYPE:
        case "SEQUENCE":
            return {
                name: _random_value(part, rng)
                for name, part in asn1._cont.items()
                if not part._opt or rng.random() < 0.5
            }
        case "CHOICE":
            name = str(rng.choice(list(asn1._cont)))
            return name, _random_value(asn1._cont[name], rng)
        case "SEQUENCE OF":
            bounds = asn1._const_sz.root[0]
            most = min(bounds.ub, 23)
            return [_random_value(asn1._cont, rng) for _ in range(rng.integers(bounds.lb, most + 1))]
        case "ENUMERATED":
            return str(rng.choice(list(asn1._cont)))
        case "BIT STRING":
            size = asn1._const_sz.root[0]
            length = size if isinstance(size, int) else int(rng.integers(size.lb, size.ub + 1))
            return int(rng.integers(1 << length)), length
        case "OCTET STRING":
            bounds = asn1._const_sz.root[0]
            return rng.bytes(int(rng.integers(bounds.lb, bounds.ub + 1)))
        case "BOOLEAN":
            return bool(rng.integers(2))
    bounds = asn1._const_val.root[0]
    return int(rng.choice([bounds.lb, bounds.ub, rng.integers(bounds.lb, bounds.ub, endpoint=True)]))
