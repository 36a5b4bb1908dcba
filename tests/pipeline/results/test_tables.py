"""The tables of a report: their columns are the fields of the rows, with a type each."""

from __future__ import annotations

from dataclasses import replace

import pyarrow as pa

from advpipe.pipeline.geometry.boxes import BOX_COLUMNS
from advpipe.pipeline.results.frame_row import CloudCounts, FrameRow
from advpipe.pipeline.results.match_row import DETECTION, FOUND, IGNORED, MISSED, TRUTH, MatchRow
from advpipe.pipeline.results.metrics import CRITERIA, CleanMetrics, Precisions
from advpipe.pipeline.results.row import AttackRecord, FrameCounts, ResultRow
from advpipe.pipeline.results.tables import frame_table, match_schema, match_table

RESULT = ResultRow(
    bag="detach-1",
    detector="small",
    attack=AttackRecord("detach", None, "ratio", 0.01, {"ratio": 0.01}, "small", True, 24, 5),
    counts=FrameCounts(1, 1, ("car",), 0.25, 3, 2, 0, 1000),
    boxes={"car": 3},
    clean=CleanMetrics({}, Precisions({}, {})),
    attacked=None,
    recounted=None,
    baselines={},
    significant_vs_random=None,
    notes=(),
)
MATCH = MatchRow(
    *("detach-1", "small", "adv", 7, 700, DETECTION, 0, "car", None, 0.9),
    *(1.0, 2.0, 3.0, 4.0, 1.8, 1.5, 0.1),
    *(12, None, FOUND, FOUND, FOUND, IGNORED, 0, 0, 0, None, None, None, None, False),
)
WORD = pa.dictionary(pa.int32(), pa.string())


def test_a_match_has_the_columns_of_its_fields() -> None:
    schema = match_schema()
    box = [schema.get_field_index(name) for name in BOX_COLUMNS]
    assert box == list(range(box[0], box[0] + len(BOX_COLUMNS)))  # side by side, in the order of boxes
    assert schema.field("class").type == WORD
    assert [schema.field(f"fate_{each}").type for each in CRITERIA] == [WORD] * len(CRITERIA)
    assert [schema.field(f"match_{each}").type for each in CRITERIA] == [pa.int32()] * len(CRITERIA)
    assert (schema.field("id").type, schema.field("score").type) == (pa.string(), pa.float64())
    assert (schema.field("stamp_ns").type, schema.field("is_new").type) == (pa.int64(), pa.bool_())


def test_matches_come_back_as_they_were() -> None:
    missed = replace(MATCH, kind=TRUTH, id="car.3", score=None, fate_strict=MISSED, match_strict=None)
    first, second = match_table([MATCH, missed]).to_pylist()
    assert (first.pop("class"), second["class"]) == ("car", "car")
    assert first == {name: value for name, value in vars(MATCH).items() if name != "class_name"}
    assert (second["id"], second["fate_strict"], second["match_strict"]) == ("car.3", MISSED, None)


def test_frames_have_a_column_of_each_cloud_and_count_and_nothing_where_there_is_no_such_cloud() -> None:
    counts = CloudCounts(1000, 10, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.002, 1, 2, 0, 1, 0, 0, 1)
    both, clean = {"clean": counts, "adv": counts}, {"clean": counts}
    frames = (FrameRow(7, 700, 3, 2, 1, both), FrameRow(8, 800, 3, 0, 0, clean))
    table = frame_table([(RESULT, frames)], ("clean", "adv"))
    assert table.column_names[:7] == ["bag", "detector", "attack", "recipe", "frame", "stamp_ns", "objects"]
    assert table.column_names[7:10] == ["ignored_objects", "ignored_regions", "points_clean"]
    assert table["ignored_objects"].to_pylist() == [2, 0]
    assert table.schema.field("points_adv").type == pa.int64()
    assert table.schema.field("chamfer_distance_m2_adv").type == pa.float64()
    assert table["points_removed_adv"].to_pylist() == [10, None]
    assert table["bag"].to_pylist() == ["detach-1"] * 2
