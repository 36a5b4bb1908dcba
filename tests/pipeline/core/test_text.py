"""Untrusted text: escaped, on one line, of bounded length."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.text import LINE_LIMIT, escape_unprintable, one_line


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain", "plain"),
        ("Grüße, 東京 – 5 m²\n\tnext", "Grüße, 東京 – 5 m²\n\tnext"),
        ("a\x1b[2Jb", r"a\x1b[2Jb"),
        ("\x9b31m", r"\x9b31m"),  # the same in one byte
        (
            "bell\x07, back\x08, return\r, null\0, delete\x7f",
            r"bell\x07, back\x08, return\r, null\x00, delete\x7f",
        ),
        ("exe\u202etxt\u2066", r"exe\u202etxt\u2066"),
        ("name\udcff", r"name\udcff"),
        ("line\u2028end", r"line\u2028end"),
        ("a\xa0b", "a\xa0b"),
    ],
)
def test_control_characters_are_escaped(text: str, shown: str) -> None:
    assert escape_unprintable(text) == shown


def test_a_long_value_keeps_its_start_and_the_hint_at_the_end() -> None:
    line = one_line(f"seed: {'9' * 100_000} is no seed; give a whole number")
    assert line.startswith("seed: 999")
    assert line.endswith("is no seed; give a whole number")
    assert "[... 99,0" in line
    assert len(line) < LINE_LIMIT + 50
    assert one_line("x" * LINE_LIMIT) == "x" * LINE_LIMIT


def test_lines_are_joined() -> None:
    assert one_line(" a\n b\t\x1b ") == r"a b \x1b"
