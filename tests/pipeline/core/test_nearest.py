"""What somebody may have meant, worked out by hand."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.nearest import known_names, suggestion

ATTACKS = ["perturb", "detach", "attach", "cam-speed-offset", "cam-speed-random"]


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("detahc", "did you mean 'detach'?"),
        ("DETACH", "did you mean 'detach'?"),
        ("speed", "did you mean 'cam-speed-offset' or 'cam-speed-random'?"),
        ("cam", "did you mean 'cam-speed-offset' or 'cam-speed-random'?"),
        ("xyzzy", ""),
        ("", ""),
        ("a", ""),
        (7, ""),
        ("d" * 100_000, ""),
    ],
)
def test_suggestion(word: object, meant: str) -> None:
    assert suggestion(word, ATTACKS) == meant


def test_a_suggestion_stands_before_a_short_list_and_replaces_a_long_one() -> None:
    assert known_names("smal", ["small"]) == "did you mean 'small'? known: small"
    assert known_names("x", ["small", "large"]) == "known: small, large"
    assert known_names("bus", ["ego"], "vehicles") == "vehicles: ego"
    assert known_names("bus", [], "vehicles") == "vehicles: none"
    many = [*ATTACKS, *(f"gnss-{letter}" for letter in "abcdefghijklmnop")]
    assert known_names("detahc", many) == "did you mean 'detach'?"
    assert known_names("xyzzy", many) == f"known: {', '.join(many)}"
