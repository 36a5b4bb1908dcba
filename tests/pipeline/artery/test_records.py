"""The records of our module in Artery, byte by byte."""

from __future__ import annotations

import struct

import pytest

from advpipe.pipeline.artery.records import (
    LONGEST_RECORD,
    Arrival,
    BusyRatio,
    Hello,
    NewStation,
    RecordParser,
    StepBegun,
    StepDone,
    Transmission,
    VehicleQuestion,
    parse_record,
)
from advpipe.pipeline.core.errors import AdvpipeError


def text(words: str) -> bytes:
    return struct.pack("<H", len(words.encode())) + words.encode()


RECORDS = {
    b"H" + struct.pack("<H", 1) + text("OMNeT++ 5.6"): Hello(1, "OMNeT++ 5.6"),
    b"B" + struct.pack("<q", 100_000_000): StepBegun(100_000_000),
    b"T" + struct.pack("<q", 200_000_000): StepDone(200_000_000),
    b"A" + text("ego") + text("sedan.0") + text("passenger"): VehicleQuestion("ego", "sedan.0", "passenger"),
    b"V" + struct.pack("<qId", 5, 42, 23.0) + text("vehicle ü"): NewStation(5, 42, 23.0, "vehicle ü"),
    b"S" + struct.pack("<qIq", 6, 42, 777) + b"\x11\0\x05\x01": Transmission(6, 42, 777, b"\x11\0\x05\x01"),
    b"R" + struct.pack("<qIqdd", 7, 43, 777, -80.5, 12.25): Arrival(7, 43, 777, -80.5, 12.25),
    b"L" + struct.pack("<qId", 8, 43, 0.125): BusyRatio(8, 43, 0.125),
}


@pytest.mark.parametrize(("data", "record"), RECORDS.items(), ids=lambda each: type(each).__name__)
def test_each_record_is_read(data: bytes, record: object) -> None:
    assert parse_record(data) == record
    assert type(parse_record(data)) is type(record)


def test_records_are_found_however_their_bytes_arrive() -> None:
    stream = b"".join(struct.pack("<I", len(data)) + data for data in RECORDS)
    for size in (1, 3, 1000):
        parser = RecordParser()
        found = [
            record
            for start in range(0, len(stream), size)
            for record in parser.feed(stream[start : start + size])
        ]
        assert found == list(RECORDS.values())


@pytest.mark.parametrize("data", [b"", b"?", b"B123", b"V" + bytes(20) + b"\x09\0ab", b"A" + text("ego")])
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(AdvpipeError, match="that advpipe cannot read; build it anew"):
        parse_record(data)


@pytest.mark.parametrize("length", [0, LONGEST_RECORD + 1])
def test_an_impossible_length_is_refused(length: int) -> None:
    with pytest.raises(AdvpipeError, match=f"a record of {length} bytes"):
        list(RecordParser().feed(struct.pack("<I", length)))
