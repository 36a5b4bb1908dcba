"""YAML of scenarios: bombs and odd values give one line in little time and memory; anchors are expanded."""

from __future__ import annotations

import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import pytest
import yaml

from advpipe.pipeline.scenario.document import DocumentError, read_document

LAUGHS = "".join(f"a{i}: &a{i} [{', '.join(f'*a{i - 1}' for _ in range(10))}]\n" for i in range(1, 10))
"""A list of ten words, ten times itself, and so on: a thousand million words in 600 bytes."""
BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + LAUGHS
LONG = f"a: &a {'x' * 10_000}\nb: [{', '.join(['*a'] * 1000)}]\n"
MERGES = "a0: &a0 {k: 1}\n" + "".join(
    f"a{i}: &a{i} {{<<: [{', '.join(f'*a{i - 1}' for _ in range(10))}]}}\n" for i in range(1, 10)
)

LOAD = """
import sys, time
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.core.errors import AdvpipeError
def peak_kib():  # that of `resource` is at least what the process that started this one held
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
start = time.process_time()
try:
    load_scenario(sys.argv[1], sys.argv[2:])
except AdvpipeError as error:
    print(error)
peak_mib = peak_kib() >> 10
print(f"{time.process_time() - start < 5} {peak_mib < 300} {peak_mib} MiB")
"""


def test_plain_values_equal_those_of_pyyaml() -> None:
    text = "a: [1, 2.5, 0x10, true, null, ~, word, '5', 2026-01-01T12:00:00Z]\nb: {c: {d: [[], {}]}}\n"
    assert read_document(text).tree == yaml.safe_load(text)
    assert read_document("2026-01-01T12:00:00Z").tree == datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
    assert read_document("").tree is None


def test_anchors_and_merges_are_expanded_to_separate_values() -> None:
    text = "base: &b {x: 1, y: [2]}\none: *b\ntwo: {<<: *b, x: 3}\nthree: {<<: [{x: 9}, *b]}\n"
    tree = read_document(text).tree
    assert tree == yaml.safe_load(text)
    tree["one"]["y"].append(7)
    assert tree["base"]["y"] == tree["two"]["y"] == [2]


def test_lines_are_the_lines_of_the_keys() -> None:
    lines = read_document("a: 1\nb:\n  c: &c {d: 4}\n  e: *c\n").lines()
    assert lines["a",] == 1
    assert lines["b", "c"] == 3
    assert lines["b", "c", "d"] == 3
    assert lines["b", "e"] == 4


def test_a_string_with_colons_is_no_sexagesimal_number() -> None:
    assert read_document("a: 1:30").tree == {"a": "1:30"}


BAD = {
    BOMB: (5, "more than 100000 keys and values once its aliases are expanded"),
    LONG: (2, "more than 4000000 characters once"),
    MERGES: (None, "more than 100000 keys and values once"),
    "a: &a [*a]": (1, "an alias refers to a value that contains the alias itself"),
    "a: &a {b: {c: *a}}": (1, "contains the alias itself"),
    "a: *b": (1, "not YAML: found undefined alias"),
    "[" * 60: (1, "nested more than 50 levels deep"),
    "[" * 1_000_000: (1, "nested more than 50 levels deep"),
    "a:\n" + "- 1\n" * 100_001: (None, "holds more than 100000 keys and values"),
    "x" * 4_000_001: (None, "4000001 characters; at most"),
    "\na: !!bool x": (2, "'x' is not a valid bool"),
    "\na: !!timestamp x": (2, "'x' is not a valid timestamp"),
    "a: !!int ''": (1, "'' is not a valid int"),
    "a: !!float x": (1, "'x' is not a valid float"),
    "a: !!set {x}": (1, "'tag:yaml.org,2002:set' is not supported"),
    "a: !!binary aGk=": (1, "'tag:yaml.org,2002:binary' is not supported"),
    "a: !!python/object:os.system x": (1, "is not supported"),
    "a: !!int [1]": (1, "'tag:yaml.org,2002:int' is not supported"),
    "!!omap [a: 1]": (1, "is not supported"),
    'b: 1\na: "\\ud800"': (2, "U+D800|Unicode"),
    'a: "x\\0y"': (1, r"U\+0000"),
    '"a\\0": 1': (1, r"U\+0000"),
    'a: "\\e[31m"': (1, r"U\+001B"),
    "b: 1\na: \x1b": (2, r"U\+001B"),
    "a: 1\n1: 2": (2, "'1' is not a valid key"),
    "? [a]\n: 1": (1, "a list or a mapping is not a valid key"),
    "a: 1\nb: {c: 1, c: 2}": (2, "'c' is given twice"),
    "<<: 5": (1, "<< takes a mapping"),
    "a: 1\n---\nb: 2": (2, "not YAML"),
    f"a: {'9' * 101}": (1, "a number has 101 characters"),
    f"a: !!bool {'x' * 100_000}": (1, "is not a valid bool"),
}


@pytest.mark.parametrize(("text", "found"), BAD.items(), ids=[text[:20] for text in BAD])
def test_invalid_documents_give_a_short_one_line_error(text: str, found: tuple[int | None, str]) -> None:
    line, problem = found
    with pytest.raises(DocumentError, match=problem) as caught:
        read_document(text)
    assert line in (None, caught.value.line)
    assert len(str(caught.value)) < 300
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("bomb", [BOMB, LONG, MERGES], ids=["words", "characters", "merges"])
@pytest.mark.parametrize("by_option", [False, True], ids=["file", "--set"])
def test_yaml_bombs_take_neither_time_nor_memory(tmp_path: Path, bomb: str, by_option: bool) -> None:
    (tmp_path / "a.yaml").write_text(
        "name: a\nmap: {sumo_net: boulevard.net.xml}\nattacks:\n  x:\n    type: cam-dos\n    parameters:\n"
        + "".join(f"      {line}\n" for line in bomb.splitlines())
    )
    given = [str(tmp_path / "a.yaml")]
    if by_option:
        flow = "{" + bomb.strip().replace("\n", ", ") + "}"
        given = ["smoke", f"attacks.x={{type: cam-dos, parameters: {flow}}}"]
    done = subprocess.run([sys.executable, "-c", LOAD, *given], capture_output=True, text=True, check=True)
    assert "once its aliases are expanded" in done.stdout
    assert "True True" in done.stdout, done.stdout
