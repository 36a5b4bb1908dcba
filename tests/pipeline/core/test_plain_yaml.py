"""YAML on which PyYAML crashes or takes too long is refused with the documented exceptions."""

from __future__ import annotations

import time

import pytest
import yaml

from advpipe.pipeline.core.plain_yaml import LIMIT_BYTES, MOST_LEVELS, load_yaml


def test_plain_values_are_read() -> None:
    text = "a: [1, 0x10, -2.5, 1:30, .inf, true, null, '1', 2026-01-02]\nb: {c: größe}\n"
    assert load_yaml(text) == yaml.safe_load(text)


@pytest.mark.parametrize(
    "text",
    [
        "a: &x [1]\nb: *x",
        "!!bool x",
        "!!int ''",
        "!!timestamp x",
        "!!python/object/apply:os.getcwd []",
        "[1",
        "1" + ":1" * 300 + ".5",
        "9" * 5000,
        "2001-99-99",
        "[" * (MOST_LEVELS + 1) + "]" * (MOST_LEVELS + 1),
        "[" * 1_000_000,
        "- " * 500_000,
        "x" * (LIMIT_BYTES + 1),
    ],
    ids=lambda text: text[:20],
)
def test_invalid_texts_are_refused(text: str) -> None:
    with pytest.raises((yaml.YAMLError, ValueError)):
        load_yaml(text)


def test_long_numbers_are_refused_quickly() -> None:
    start_s = time.process_time()
    with pytest.raises(ValueError, match="a number has"):
        load_yaml("1" + ":1" * (LIMIT_BYTES // 2 - 1))
    assert time.process_time() - start_s < 20


@pytest.mark.parametrize(
    "text",
    [
        '"\\0"',
        "{a: ['\\0']}".replace("'", '"'),
        "a\0",
        '"\\ud800"',
        "{a: 1, a: 2}",
        "!!binary aGk=",
        "!!set {a}",
    ],
    ids=ascii,
)
def test_values_of_types_that_json_lacks_are_refused(text: str) -> None:
    with pytest.raises((yaml.YAMLError, ValueError)):
        load_yaml(text)
