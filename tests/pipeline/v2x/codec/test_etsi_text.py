"""Our declaration of the CPM against the ASN.1 that ETSI publishes, compiled by asn1tools.

ADVPIPE_ETSI_ASN1 names a folder with ETSI's modules of TS 103 324 v2.1.1 and its common data dictionary,
v2.1.1 or v2.2.1 (forge.etsi.org, BSD-3-Clause), which are not part of the project. Two places are put in
other words for asn1tools, which reads no ranges between named numbers and no size on top of another one, and
what version 2.2.1 of the dictionary changed is put back as 2.1.1 has it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from advpipe.pipeline.v2x.codec.cpm_codec import CONTAINERS, asn1_part
from advpipe.pipeline.v2x.codec.uper import Uper
from tests.pipeline.v2x.codec.random_values import as_asn1tools_takes_it, random_value

IN_OTHER_WORDS = {
    r"\(unknown\|passengerCar\.\.tram\|agricultural\)": "(0..14)",
    r"SequenceOfCartesianPosition3d \(SIZE\(3\.\.16,\.\.\.\)\)": (
        "SEQUENCE SIZE (3..16, ...) OF CartesianPosition3d"
    ),
}
CHANGED_LATER = {
    r"SEQUENCE SIZE \(1\.\.13,\.\.\.\) OF CorrelationColumn": "SEQUENCE SIZE (1..13) OF CorrelationColumn",
    r",\s*roadbike +\(9\),\s*childrensbike +\(10\)": "",
    r"(VruSubProfile\w+ ::= )INTEGER( {[^}]+)}\(0\.\.15\)": r"\1ENUMERATED\2, max (15) }",
}


@pytest.fixture(scope="module")
def etsi() -> Any:
    if not (name := os.environ.get("ADVPIPE_ETSI_ASN1")):
        pytest.skip("ADVPIPE_ETSI_ASN1 is not set")
    asn1tools = pytest.importorskip("asn1tools")
    text = "\n".join(path.read_text("utf-8", "replace") for path in sorted(Path(name).glob("*.asn")))
    for pattern, ours in (IN_OTHER_WORDS | CHANGED_LATER).items():
        text = re.sub(pattern, ours, text)
    return asn1tools.compile_string(text, "uper")


def leaves(value: Any) -> Iterator[object]:
    """The numbers and bytes in a value, in order: names are others in later dictionaries. A name of an
    enumeration is None, whose place the bytes have."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, tuple) and isinstance(value[0], str):
        value = [value[1]]
    if isinstance(value, list):
        for each in value:
            yield from leaves(each)
    else:
        yield None if isinstance(value, str) else value


def same(theirs: Any, ours: Any) -> bool:
    """Whether all numbers and bytes are equal; asn1tools gives the number of a name that it cannot read."""
    pairs = zip(leaves(theirs), leaves(ours), strict=True)
    return all(one == other or other is None for one, other in pairs)


@pytest.mark.parametrize("name", list(CONTAINERS.values()))
def test_containers_have_the_same_bytes_and_values(etsi: Any, name: str) -> None:
    rng, asn1 = Random(name), asn1_part(name)
    for _ in range(200):
        value = random_value(asn1, rng)
        encoded = Uper(asn1).encode(value)
        found = etsi.decode(name, encoded)
        assert same(found, as_asn1tools_takes_it(asn1, value))
        assert etsi.encode(name, found) == encoded


def test_what_precedes_the_containers_has_the_same_bytes(etsi: Any) -> None:
    for name in ("ItsPduHeader", "ManagementContainer"):
        rng, asn1 = Random(name), asn1_part(name)
        for _ in range(200):
            value = random_value(asn1, rng)
            encoded = Uper(asn1).encode(value)
            assert etsi.encode(name, etsi.decode(name, encoded)) == encoded
            assert same(etsi.decode(name, encoded), value)
