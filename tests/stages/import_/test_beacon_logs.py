"""Published logs of beacons become bags that detectors are scored on, and come out again as they were."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.dataset.layout import EXPORT_MARK
from advpipe.pipeline.labels.messages import read_labels
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.evaluate.v2x.drive import read_drive
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.section import v2x_sections
from advpipe.stages.export.log import export_log
from advpipe.stages.import_.beacons.cams import StationIds
from advpipe.stages.import_.beacons.run import LogSummary, import_log
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from tests.stages.import_.beacon_logs import (
    FALSE_FROM,
    HONEST,
    LIAR,
    STEPS,
    WRITERS,
    write_f2md,
    write_nextgen,
    write_veremi,
)

FALSE = STEPS - FALSE_FROM
Write = Callable[[Path], Path]
ALL = pytest.mark.parametrize(("form", "write"), WRITERS.items(), ids=list(WRITERS))


def imported(form: str, source: Path, out: Path, **options: str) -> LogSummary:
    return import_log(ImportRequest(form, source, ImportOptions(**options)), out)  # type: ignore[arg-type]


def values_in(folder: Path) -> dict[str, object]:
    """The records of each file."""
    paths = [path for path in folder.glob("*.json") if path.read_text() and path.name != EXPORT_MARK]
    return {path.name: _records(path) for path in paths}


def _records(path: Path) -> list[object]:
    text = path.read_text()
    found: list[object] = (
        json.loads(text) if text.startswith("[") else list(map(json.loads, text.splitlines()))
    )
    return found


@ALL
def test_nothing_of_the_log_is_lost(form: str, write: Write, tmp_path: Path) -> None:
    source = write(tmp_path / "log")
    found = imported(form, source, tmp_path / "out")
    written = export_log(found.bag, tmp_path / "again")
    assert values_in(tmp_path / "again") == values_in(source)
    assert written.records == sum(len(each) for each in values_in(source).values())  # type: ignore[arg-type]
    again = imported(form, tmp_path / "again", tmp_path / "twice")
    assert (again.received, again.receivers) == (found.received, found.receivers) == (2 * STEPS, 1)


@ALL
def test_detectors_are_scored_by_the_logs_labels(form: str, write: Write, tmp_path: Path) -> None:
    """F2MD's names say that every message of its attacker is false; the others say which."""
    found = imported(form, write(tmp_path / "log"), tmp_path / "out")
    false = STEPS if form == "f2md" else FALSE
    assert found.false == false == len(read_labels(found.bag))
    detection = read_drive(found.bag, "attacked").detection
    assert (detection.messages, detection.false_messages) == (2 * STEPS, false)
    assert detection.ours.recall >= FALSE / false
    assert detection.ours.false_positives == 0
    (section,) = v2x_sections(tmp_path / "out" / "clean", [found.bag])
    assert section.tables[0].lines[0][2] == str(false)


def test_an_evaluation_takes_a_log_as_it_is(tmp_path: Path) -> None:
    found = imported("nextgen", write_nextgen(tmp_path / "log"), tmp_path / "out")
    report = evaluate(tmp_path / "out" / "clean", [found.bag], tmp_path / "report")
    assert [section.key for section in report.sections] == ["v2x"]
    verdicts = pq.read_table(tmp_path / "report" / "verdicts.parquet").to_pylist()
    ours = [row for row in verdicts if (row["detector"], row["check"]) == ("advpipe", "any")]
    assert [row["truth"] for row in ours].count("false") == FALSE


@ALL
def test_claims_are_the_logs_to_the_resolution_of_a_cam(form: str, write: Write, tmp_path: Path) -> None:
    found = imported(form, write(tmp_path / "log"), tmp_path / "out")
    (one,) = read_receptions(BagReader(found.bag))
    honest = [claim for claim, at in zip(one.claims, one.received, strict=True) if at.station_id == HONEST]
    if form == "nextgen":
        honest = one.claims[::2]  # type: ignore[assignment]
    assert len(honest) == STEPS
    for step, claim in enumerate(honest):
        assert claim.x_m == pytest.approx(5000.123456789 + 5.0 * step, abs=0.02)
        assert claim.y_m == pytest.approx(5800.25 + 4.0 * HONEST, abs=0.02)
        assert claim.yaw_rad == pytest.approx(0.0, abs=0.002)
        assert claim.speed_mps == 10.0
        assert claim.invalid == 0
        assert 0 <= claim.arrival_ns - claim.generation_ns < 2_000_000
    assert {receiver.y_m for receiver in one.receivers} == {5800.25 + 4.0 * 21}


def test_every_digit_of_the_log_is_in_the_bag(tmp_path: Path) -> None:
    found = imported("nextgen", write_nextgen(tmp_path / "log"), tmp_path / "out")
    messages = [message for _, message in BagReader(found.bag).messages("/log/beacons")]
    assert len(messages) == 2 * STEPS
    first = messages[0]
    assert first.state.acceleration[0] == 0.1 + 0.2
    assert first.state.position.tolist() == [5000.123456789, 5800.25 + 4.0 * HONEST, 0.0]
    assert first.state.position_noise.tolist() == [-1.25, 0.5, 0.0]
    assert np.isnan(first.state.speed[1:]).all()
    assert first.send_time == 7_200_000_000_000 + HONEST
    assert json.loads(first.text)["sender"]["distance_to_road_edge"] == 1.75


def test_numbers_as_texts(tmp_path: Path) -> None:
    """As the simulation of NextGen writes them."""
    numbers = imported("nextgen", write_nextgen(tmp_path / "log"), tmp_path / "out")
    texts = imported("nextgen", write_nextgen(tmp_path / "texts", as_texts=True), tmp_path / "out-texts")
    claims = [read_receptions(BagReader(each.bag))[0].claims for each in (numbers, texts)]
    assert list(map(repr, claims[0])) == list(map(repr, claims[1]))  # NaN where no roads are known


def test_a_log_without_attackers_is_a_clean_bag_alone(tmp_path: Path) -> None:
    source = write_veremi(tmp_path / "log")
    (source / "GroundTruthJSONlog.json").unlink()
    found = imported("veremi", source, tmp_path / "out")
    assert (found.false, found.bag.name) == (0, "clean")
    assert not (tmp_path / "out" / "attacked").exists()


def test_one_receiver(tmp_path: Path) -> None:
    source = write_f2md(tmp_path / "log")
    assert imported("f2md", source, tmp_path / "out", drive="21").receivers == 1
    with pytest.raises(UsageError, match="holds no log of the vehicle 99"):
        imported("f2md", source, tmp_path / "none", drive="99")


def test_ids_that_no_cam_can_hold() -> None:
    ids = StationIds()
    assert ids.of("7") == 7
    assert ids.of("5000000013") == 2
    assert ids.of("veh_3") == 3
    assert (ids.of("5000000013"), ids.of("3")) == (2, 4)  # 3 is taken


@pytest.mark.parametrize(
    ("form", "name", "text", "message"),
    [
        ("veremi", "log.txt", "", "holds no logs of veremi, such as JSONlog-0-7-A0.json"),
        ("veremi", "JSONlog-0-7-A0.json", "{", "JSONlog-0-7-A0.json, record 1: not valid JSON"),
        ("veremi", "JSONlog-0-7-A0.json", "[]", "record 1: no JSON object"),
        ("veremi", "JSONlog-0-7-A0.json", '{"type":9}', "type 9 is none of 2, 3 and 4"),
        ("veremi", "JSONlog-0-7-A0.json", '{"type":2}', "rcvTime is 'None', not a number"),
        ("veremi", "JSONlog-0-7-A0.json", '{"type":2,"rcvTime":1,"pos":[1]}', "pos is .* not three numbers"),
        ("f2md", "JSONlog-0-7-A0.json", "{}", "holds no logs of f2md"),
        ("nextgen", "log.txt", "", "holds no log of VeReMi NextGen"),
        ("nextgen", "veh_1.json", "{}", "veh_1.json: no list of records"),
        ("nextgen", "veh_1.json", "[{}]", "veh_1.json, record 1: no record with a sender"),
    ],
)
def test_what_is_no_log(form: str, name: str, text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(AdvpipeError, match=message):
        imported(form, tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_options_that_a_log_does_not_take(tmp_path: Path) -> None:
    source = write_veremi(tmp_path / "log")
    with pytest.raises(UsageError, match="split means nothing to the form veremi"):
        imported("veremi", source, tmp_path / "out", split="val")
    with pytest.raises(UsageError, match="a log has no frames"):
        imported("veremi", source, tmp_path / "out", frames="0:2")


def test_a_file_name_that_leaves_the_folder_is_refused(tmp_path: Path) -> None:
    found = imported("nextgen", write_nextgen(tmp_path / "log"), tmp_path / "out")
    reader = BagReader(found.bag)
    from dataclasses import replace

    from advpipe.pipeline.bag.writer import BagWriter
    from advpipe.pipeline.messages.types import serialise

    with BagWriter(tmp_path / "evil", provenance=reader.provenance) as writer:
        for raw in reader.raw_messages():
            if raw.topic.name == "/log/beacons":
                message = reader.decode(raw)
                message.file = "../evil.json"
                raw = replace(raw, cdr=serialise(message, raw.topic.type))
            writer.copy(raw)
    with pytest.raises(AdvpipeError, match=r"names the file '../evil.json'"):
        export_log(tmp_path / "evil", tmp_path / "written")


def test_liars_keep_their_number(tmp_path: Path) -> None:
    found = imported("f2md", write_f2md(tmp_path / "log"), tmp_path / "out")
    assert {label.attack for label in read_labels(found.bag)} == {"f2md-A13"}
    assert {label.attacker for label in read_labels(found.bag)} == {str(LIAR)}
