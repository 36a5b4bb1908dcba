"""Hand-written texts inside bags and data sets: every command works or fails with a one-line error."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.cli import app
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

sys.path.insert(0, str(Path(__file__).parent))

from mutated_messages import SMALL, failures, write_record, write_text

DEEP = "[" * 100_000 + "]" * 100_000
NOT_JSON = (
    *(
        "",
        "{",
        "[1]",
        "5",
        "null",
        "true",
        '"x"',
        DEEP,
        '{"a":' * 100_000,
        "NaN",
        "[1e999]",
        '{"a": 1, "a": 2}',
    ),
    *('"\\ud800"', '"\\u0000"', "9" * 100_000, "x" * 3_000_000, "\x1b[31m", "$\\foo$", "<script>"),
)
ODD: tuple[Any, ...] = (
    *(
        None,
        True,
        -5,
        2**70,
        1e308,
        -0.5,
        "x",
        "",
        "\x1b[31m",
        "$\\foo$",
        "x" * 100_000,
        [],
        [1],
        {},
        {"a": []},
    ),
    *("a\0b", "\ud800", float("inf"), float("nan")),
)


def some(cases: Sequence[Any], step: int) -> list[Any]:
    """All cases, of which each `step`th is not left to the nightly run."""
    nightly = pytest.mark.nightly
    return [
        pytest.param(case, marks=[nightly] if number % step else [], id=ascii(case)[:25])
        for number, case in enumerate(cases)
    ]


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of a few vehicles, and two attacks on it."""
    folder = tmp_path_factory.mktemp("untrusted") / "drive"
    simulate(load_scenario("smoke", SMALL), folder)
    for spec in ({"type": "cam-position-offset", "attackers": {"share": 0.5}}, {"type": "gnss-bias"}):
        attack(folder / "clean", folder / str(spec["type"]), AttackRequest((attack_spec(spec),)), workers=1)
    return folder


def leaves(tree: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Where values and sections are, of lists those of the first item."""
    if place:
        yield place
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from leaves(value, (*place, key))
    elif isinstance(tree, list) and tree:
        yield from leaves(tree[0], (*place, 0))


def with_odd(text: str, number: int) -> str:
    """The document with one of its values changed, another for each number."""
    tree = json.loads(text)
    places = list(leaves(tree))
    place, odd = places[7 * number % len(places)], ODD[number % len(ODD)]
    section = tree
    for step in place[:-1]:
        section = section[step]
    section[place[-1]] = odd
    return json.dumps(tree)


BUILDINGS = json.dumps(
    {
        "type": "MultiPolygon",
        "coordinates": [[[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]]]],
    }
)
TEXTS: dict[str, tuple[str, ...]] = {
    "/scenario/info": ("verify", "export", "cam", "gnss"),
    "/v2x/statistics": ("inspect", "plot", "verify"),
    "/v2x/buildings": ("export", "cam", "gnss"),
}


@pytest.mark.parametrize("text", some(NOT_JSON, 5))
@pytest.mark.parametrize("topic", TEXTS)
def test_texts_that_are_not_documents_are_refused(drive: Path, tmp_path: Path, topic: str, text: str) -> None:
    write_text(drive / "clean", tmp_path / "bag", topic, text)
    assert failures(drive / "clean", tmp_path / "bag", TEXTS[topic]) == []


@pytest.mark.parametrize("number", range(0, 2 * len(ODD), 7))
@pytest.mark.parametrize("topic", TEXTS)
def test_documents_with_an_invalid_value_are_refused(
    drive: Path, tmp_path: Path, topic: str, number: int
) -> None:
    texts = {"/v2x/buildings": BUILDINGS}
    if topic not in texts:
        ((_, message),) = BagReader(drive / "clean").messages(topic)
        texts[topic] = message.data
    write_text(drive / "clean", tmp_path / "bag", topic, with_odd(texts[topic], number))
    assert failures(drive / "clean", tmp_path / "bag", TEXTS[topic]) == []


@pytest.mark.nightly
@pytest.mark.parametrize("topic", ["/scenario/info", "/v2x/statistics"])
def test_every_invalid_value_of_a_document_is_handled(drive: Path, tmp_path: Path, topic: str) -> None:
    ((_, message),) = BagReader(drive / "clean").messages(topic)
    for number in range(len(list(leaves(json.loads(message.data)))) * 3):
        write_text(drive / "clean", tmp_path / str(number), topic, with_odd(message.data, number))
        assert failures(drive / "clean", tmp_path / str(number), TEXTS[topic]) == []


RECORDS: dict[str, tuple[str, ...]] = {
    "kind": ("x" * 1_000_000, "a\0b", "clean"),
    "seed": ("-5", "Infinity", "1e99", ""),
    "scenario_name": ("$\\foo$", "a$_{$b", "x" * 1_000_000, "\x1b[31m", "%", "\n\n# x"),
    "scenario": (
        *(
            "a: !!bool x",
            "!!timestamp x",
            "!!int ''",
            "!!python/object/apply:os.getcwd []",
            "a: &x [*x]",
            "- a",
        ),
        *(
            "[" * 100_000,
            "sensors: {lidars: 5}",
            "sensors: {lidars: {a: 5}}",
            'a: "\\0"',
            "a: 1\na: 2",
            "\ufffe",
        ),
        *("map: {origin: {latitude_deg: .nan}}", "description: [1]", "{" + "a: {" * 200),
    ),
    "versions": NOT_JSON,
    "parameters": (*NOT_JSON, '{"offset_m": []}', '{"<b>": "<i>"}', '{"a": [[[]]]}'),
    "attacks": (
        *NOT_JSON,
        *(
            '[{"type": 5}]',
            "[{}]",
            '[{"type": "cam-dos", "victim": 5}]',
            '[{"type": "cam-dos", "attackers": 5}]',
        ),
        *('[{"type": "cam-mix", "parameters": {}}]', '[{"type": "x", "schedule": {"from_s": -1}}]'),
        *('[{"type": "detach", "lidar": "/none"}]', '[{"type": "gnss-bias", "victim": "nobody"}]'),
    ),
    "lidar_topics": (*NOT_JSON, '["/none"]', "[5]"),
    "looks": NOT_JSON,
    "recovered": NOT_JSON,
    "frames": ("x", "::0", "-5:", "9" * 5000, "1:2:3:4"),
    "budget": ("x" * 1_000_000, "\x1b[31m"),
    "attack": ("\x1b[31m", "<script>", "$\\foo$", "cam-", "+" * 9999),
    "parent_sha256": ("", "x" * 1_000_000),
    "detector": ("x" * 1_000_000, "\x1b[31m"),
    "detector_sha256": ("", "x"),
}


@pytest.mark.parametrize("record", some([(key, text) for key, texts in RECORDS.items() for text in texts], 9))
@pytest.mark.parametrize("bag", ["cam-position-offset", "clean"])
def test_invalid_provenance_records_are_handled(
    drive: Path, tmp_path: Path, bag: str, record: tuple[str, str]
) -> None:
    key, text = record
    write_record(drive / bag, tmp_path / "bag", {key: text})
    for table in (drive / bag).glob("*.parquet"):
        shutil.copy(table, tmp_path / "bag")
    commands = [
        "inspect",
        "verify",
        "recover",
        *(["evaluate"] if bag != "clean" else ["plot", "share", "cam"]),
    ]
    assert failures(drive / "clean", tmp_path / "bag", commands) == []


BINARY = bytes(range(256))
FILES: dict[str, Callable[[Path], Path]] = {
    "scenario.yaml": lambda folder: folder / "scenario.yaml",
    "attack.yaml": lambda folder: folder / "cam-position-offset" / "attack.yaml",
    "metadata.yaml": lambda folder: folder / "clean" / "metadata.yaml",
    "report.json": lambda folder: folder / "reports" / "small" / "report.json",
}
CONTENTS = (
    *(BINARY, b"", b"\xff\xfe", b"a: !!bool x", b"[" * 100_000, b"x" * 20_000_000, b"a: &x [*x]", b"{", b"5"),
    *(
        b"a\x00b",
        b"!!python/object/apply:os.getcwd []",
        b'{"provenance": NaN}',
        b'{"provenance": {"clean": 5}}',
    ),
)


@pytest.mark.parametrize("content", some(CONTENTS, 4))
@pytest.mark.parametrize("name", FILES)
def test_invalid_files_of_a_data_set_are_handled(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: bytes
) -> None:
    folder = Path(shutil.copytree(drive, tmp_path / "drive"))
    path = FILES[name](folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    monkeypatch.chdir(tmp_path)
    settings = [argument for one in SMALL for argument in ("--set", one)]
    for arguments in (
        ("verify", str(folder)),
        ("share", str(folder), "-o", "shared"),
        ("inspect", str(folder)),
        ("recover", str(folder), "-o", "recovered"),
        ("run", "smoke", "-o", str(folder), *settings),
    ):
        result = CliRunner().invoke(app, arguments)
        assert result.exception is None or isinstance(result.exception, SystemExit), arguments
        assert "Traceback" not in result.output


def test_run_refuses_invalid_files(drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scenario.yaml that is not text may be a user's file, so it is kept."""
    folder = Path(shutil.copytree(drive, tmp_path / "drive"))
    (folder / "scenario.yaml").write_bytes(BINARY)
    settings = [argument for one in SMALL for argument in ("--set", one)]
    result = CliRunner().invoke(app, ["run", "smoke", "-o", str(folder), *settings])
    assert result.exit_code == 1
    assert "scenario.yaml is not a UTF-8 text file" in result.stderr
    assert (folder / "scenario.yaml").read_bytes() == BINARY


def test_recover_beside_an_invalid_scenario_is_refused(drive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cut"
    (folder / "clean").mkdir(parents=True)
    (source,) = (drive / "clean").glob("*.mcap")
    (folder / "clean" / source.name).write_bytes(source.read_bytes()[:-5000])
    for content in (BINARY, b"a: !!bool x", b"- a"):
        (folder / "scenario.yaml").write_bytes(content)
        result = CliRunner().invoke(app, ["recover", str(folder), "-o", str(tmp_path / "saved")])
        assert result.exit_code == 1
        assert "scenario.yaml" in result.stderr
        assert not (tmp_path / "saved").exists()
