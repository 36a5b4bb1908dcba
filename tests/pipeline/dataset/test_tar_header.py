import io
import tarfile

import pytest

from advpipe.pipeline.dataset import tar_header

NAMES_AND_SIZES = [
    ("a", 0),
    ("town/clean/clean_0.mcap", 158_900_000),
    ("n" * 100, 1),
    ("n" * 101, 1),
    ("d/" * 700 + "n", 8**11 - 1),
    ("größe/ü", 12),
    ("big", 8**11),
    ("größe/ü", 10**15),
]


@pytest.mark.parametrize(("name", "size_bytes"), NAMES_AND_SIZES)
def test_headers_are_those_of_tarfile(name: str, size_bytes: int) -> None:
    theirs = tarfile.TarInfo(name)
    theirs.size, theirs.mode = size_bytes, 0o644
    assert tar_header.tar_header(name, size_bytes) == theirs.tobuf(tarfile.PAX_FORMAT)


@pytest.mark.parametrize(("name", "size_bytes"), NAMES_AND_SIZES)
def test_tarfile_reads_them(name: str, size_bytes: int) -> None:
    archive = io.BytesIO(tar_header.tar_header(name, size_bytes) + bytes(1024))
    member = tarfile.TarFile(fileobj=archive).next()
    assert member is not None
    assert (member.name, member.size, member.isreg()) == (name, size_bytes, True)


def read(data: bytes) -> tuple[str, int] | None:
    """What a header says, as unpacking finds it out; None where it is not the canonical one."""
    try:
        pax_bytes = tar_header.pax_length(data[:512])
        records = b"" if pax_bytes is None else data[512 : 512 + pax_bytes]
        name, size_bytes = tar_header.parse_header(records, data[-512:])
        return (name, size_bytes) if tar_header.tar_header(name, size_bytes) == data else None
    except ValueError:
        return None


@pytest.mark.parametrize(("name", "size_bytes"), [NAMES_AND_SIZES[1], NAMES_AND_SIZES[-1]])
def test_every_flipped_bit_of_a_header_shows(name: str, size_bytes: int) -> None:
    """It is refused; only in a pax header's records, which have no checksum, may it say something else."""
    good = tar_header.tar_header(name, size_bytes)
    assert read(good) == (name, size_bytes)
    records = range(512, len(good) - 512)
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        found = read(bytes(bad))
        assert found is None or (bit // 8 in records and found != (name, size_bytes)), bit
