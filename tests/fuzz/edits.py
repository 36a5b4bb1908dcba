"""Mutations of bytes that do not depend on their format."""

from __future__ import annotations

from hypothesis import strategies as st

LENGTHS = (1, 2, 4, 8)
EXTREMES = (
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**63 - 1,
    2**63,
    2**64 - 1,
)


@st.composite
def edited_bytes(draw: st.DrawFn, data: bytes, most: int = 4) -> tuple[bytes, str]:
    """The data with some changes, at most so many, and what they are."""
    notes = []
    for _ in range(draw(st.integers(1, most))):
        place = draw(st.integers(0, max(len(data) - 1, 0)))
        edit = draw(st.sampled_from(["number", "number", "flip", "cut", "drop", "repeat", "insert", "swap"]))
        notes.append(f"{edit} at {place}")
        if edit == "number":
            length = draw(st.sampled_from(LENGTHS))
            number = draw(st.one_of(st.sampled_from(EXTREMES), st.integers(0, 1 << 20))) % (1 << 8 * length)
            data = data[:place] + number.to_bytes(length, "little") + data[place + length :]
        elif edit == "flip":
            flipped = bytes([data[place] ^ 1 << draw(st.integers(0, 7))]) if data else b""
            data = data[:place] + flipped + data[place + 1 :]
        elif edit == "cut":
            data = data[:place]
        elif edit == "insert":
            data = data[:place] + draw(st.binary(min_size=1, max_size=20)) + data[place:]
        else:
            length = draw(st.integers(1, 300))
            piece, rest = data[place : place + length], data[place + length :]
            if edit == "repeat":
                piece = piece * draw(st.sampled_from([2, 3, 50]))
            data = data[:place] + (rest[:length] + piece + rest[length:] if edit == "swap" else
                                   rest if edit == "drop" else piece + rest)  # fmt: skip
    return data, "; ".join(notes)
