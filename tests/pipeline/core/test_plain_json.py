"""JSON that Python's reader accepts but other programs or file names cannot hold is refused."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

import pytest

from advpipe.pipeline.core.plain_json import LIMIT_BYTES, load_json
from advpipe.pipeline.core.plain_values import MOST_LEVELS

SOURCES = Path(__file__).parents[3]


@pytest.mark.parametrize(
    "text",
    [
        '{"a": [1, -2.5, 1e10, true, null, "größe", "\\u00fc\\ud83d\\ude00"]}',
        "[" * MOST_LEVELS + "]" * MOST_LEVELS,
        json.dumps(["[{" * 1000, '"[' * 1000, "\\[" * 1000]),
        "[" + ",".join(["[]"] * 1000) + "]",
        f'"{"x" * (LIMIT_BYTES - 2)}"',
        "9" * 100,
    ],
    ids=lambda text: text[:20],
)
def test_plain_values_are_read(text: str) -> None:
    assert load_json(text) == load_json(text.encode()) == json.loads(text)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "Expecting value"),
        ("{", "Expecting property name"),
        ("[1] [2]", "Extra data"),
        ("NaN", "NaN is not a JSON number"),
        ("[-Infinity]", "-Infinity is not a JSON number"),
        ("1e999", "too large"),
        ("-1e999", "too large"),
        ("9" * 101, "a number has 101 characters"),
        ("0." + "9" * 5000, "a number has 5002 characters"),
        ('{"a": 1, "a": 2}', "given twice"),
        ('"\\ud800"', "an unpaired surrogate"),
        ('{"\\udfff": 1}', "an unpaired surrogate"),
        ('"\\u0000"', "NUL"),
        ('[{"a": ["\\u0000"]}]', "NUL"),
        ('"a\0"', "control character"),
        ("[" * (MOST_LEVELS + 1) + "]" * (MOST_LEVELS + 1), "levels"),
        ('{"a":' * (MOST_LEVELS + 1), "levels"),
        ('["', "Unterminated"),
        (" " * (LIMIT_BYTES + 1), "too long"),
        ("\ud800", "Expecting value"),
    ],
    ids=lambda text: ascii(text)[:20],
)
def test_invalid_texts_are_refused(text: str, what: str) -> None:
    with pytest.raises(ValueError, match=what):
        load_json(text)


def test_bytes_that_are_not_utf8_are_refused() -> None:
    for data in (b"\xff", b'"\xed\xa0\x80"', b"{\x00}", " ".encode("utf-16")):
        with pytest.raises(ValueError, match=r".") as caught:
            load_json(data)
        assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize("text", ["[" * LIMIT_BYTES, "[]" * 500 + '"' + '\\"' * 1_000_000, '["a' * 500_000])
def test_no_text_takes_long_to_read(text: str) -> None:
    start_s = time.process_time()
    with pytest.raises(ValueError, match=r"levels|Extra data|delimiter"):
        load_json(text)
    assert time.process_time() - start_s < 10


LOADERS = {
    "pipeline/core/plain_json.py",
    "pipeline/core/json_array.py",  # finds records, and passes those that are wanted through plain_json
    "pipeline/core/plain_yaml.py",
    "pipeline/scenario/load.py",  # its errors name the place of a key
}
OTHERS = {
    "stages/verify/message_store.py",  # rows that it has written itself
    "stages/investigate/calibration.py",  # its own numbers
    # Documents that advpipe has just written itself, for --json.
    "pipeline/cli/audit.py",
    "pipeline/cli/demo.py",
    "pipeline/cli/evaluate.py",
    "pipeline/cli/schema.py",
    "pipeline/cli/sweep.py",
    "pipeline/cli/verify.py",
}


def test_no_other_code_reads_untrusted_json() -> None:
    """Whatever comes from outside goes through one of the loaders, which have bounds."""
    read = re.compile(
        r"(?<!plain_)json\.loads?\(|JSONDecoder|(?<!plain_)yaml\.\w*load\w*\(|YAML\(|from_geojson|validate_json\("
    )
    found = {
        path.relative_to(SOURCES).as_posix()
        for folder in ("pipeline", "stages")
        for path in (SOURCES / folder).glob("**/*.py")
        if read.search(path.read_text(encoding="utf-8"))
    }
    assert found - OTHERS <= LOADERS
