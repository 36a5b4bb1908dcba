"""Certificates: pycrate reads them and encodes the same bytes; only their issuer's signature fits them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from advpipe.pipeline.v2x.security.certificate import Certificate, read_ticket
from advpipe.pipeline.v2x.security.coer import CoerReader, EnvelopeError
from advpipe.pipeline.v2x.security.pki import CAM_PERMISSIONS, Pki

START_NS = 1_767_268_800_000_000_000


def asn1_certificate() -> Any:
    from pycrate_asn1dir import ITS_IEEE1609_2

    return ITS_IEEE1609_2.Ieee1609Dot2.Certificate


@pytest.mark.oracle
@pytest.mark.parametrize("which", ["root", "authority", "ticket"])
def test_pycrate_encodes_the_same_bytes(pki: Pki, which: str) -> None:
    certificate = pki.ticket("car")[0] if which == "ticket" else getattr(pki, which)
    asn1 = asn1_certificate()
    asn1.from_coer(certificate.encoded)
    values = asn1.get_val()
    asn1.set_val(values)
    assert asn1.to_coer() == certificate.encoded
    signed = values["toBeSigned"]
    assert signed["id"] == (("none", 0) if which == "ticket" else ("name", f"drive {which}"))
    assert signed["validityPeriod"] == {
        "start": certificate.start_s,
        "duration": ("hours", certificate.hours),
    }
    assert {p["psid"]: p["ssp"][1] for p in signed["appPermissions"]} == dict(certificate.permissions)
    assert ("certIssuePermissions" in signed) == (which != "ticket")
    assert ("encryptionKey" in signed) == (which == "authority")


def test_the_chain_of_signatures(pki: Pki) -> None:
    ticket, _ = pki.ticket("car")
    assert pki.root.is_issued_by(pki.root)
    assert pki.authority.is_issued_by(pki.root)
    assert ticket.is_issued_by(pki.authority)
    assert not ticket.is_issued_by(pki.root)
    assert not pki.authority.is_issued_by(ticket)
    assert not replace(ticket, hours=9999).is_issued_by(pki.authority)
    assert not Pki(1, START_NS, "other").ticket("car")[0].is_issued_by(pki.authority)


def test_the_seed_determines_every_byte(pki: Pki) -> None:
    again = Pki(1, START_NS)
    assert again.authority.encoded == pki.authority.encoded
    assert again.ticket("car")[0].encoded == pki.ticket("car")[0].encoded != pki.ticket("van")[0].encoded
    assert Pki(2, START_NS).ticket("car")[0].key != pki.ticket("car")[0].key


def test_a_ticket_is_read_back(pki: Pki) -> None:
    ticket, _ = pki.ticket("car", permissions={**CAM_PERMISSIONS, 37: b"\x01\xff\xff\xff", 300: b""})
    reader = CoerReader(ticket.encoded)
    assert read_ticket(reader) == ticket
    reader.end()


def test_validity(pki: Pki) -> None:
    ticket, _ = pki.ticket("car", hours=2)  # from an hour before the drive
    hour_ns = 3_600 * 10**9
    valid = [ticket.is_valid_at(START_NS + at_ns) for at_ns in (-hour_ns - 1, -hour_ns, hour_ns - 1, hour_ns)]
    assert valid == [False, True, True, False]


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_other_bytes_are_refused_or_another_ticket(pki: Pki, data: st.DataObject) -> None:
    encoded = bytearray(pki.ticket("car")[0].encoded)
    for _ in range(data.draw(st.integers(1, 3))):
        encoded[data.draw(st.integers(0, len(encoded) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(encoded[: data.draw(st.integers(0, len(encoded)))])
    for changed in (bytes(encoded), cut):
        reader = CoerReader(changed)
        try:
            ticket: Certificate = read_ticket(reader)
        except EnvelopeError:
            continue
        assert ticket.encoded == reader.since(0)  # canonical: no two encodings of one ticket
