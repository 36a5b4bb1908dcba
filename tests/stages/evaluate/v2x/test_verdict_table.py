"""`verdicts.parquet`: others compute the report's numbers from it."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from section_rows import rows_of
from sklearn.metrics import f1_score, roc_auc_score

from advpipe.pipeline.misbehaviour.catch import CATCH_CHECKS
from advpipe.pipeline.misbehaviour.config import CHECKS
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS
from advpipe.stages.evaluate.v2x.section import v2x_sections
from advpipe.stages.evaluate.v2x.verdict_table import ANY, VERDICT_SCHEMA, VERDICTS_FILE


def test_f1_and_auc_follow_from_the_table(smoke: Path, offset: Path) -> None:
    (found,) = v2x_sections(smoke, [offset])
    table = pq.read_table(BytesIO(found.files[VERDICTS_FILE]))
    assert table.schema == VERDICT_SCHEMA
    frame = table.to_pandas()
    assert set(frame["bag"]) == {"clean", offset.name}
    assert {ANY, "drift", "kalman", "intersection"} <= set(frame["check"]) <= {ANY, *CHECKS, *CATCH_CHECKS}
    attacked = frame[frame["bag"] == offset.name]
    (record,) = rows_of(found)[1]["attacks"]  # type: ignore[misc]
    assert [each["detector"] for each in record["detectors"]] == list(MISBEHAVIOUR_DETECTORS)
    for each in record["detectors"]:
        of_messages = attacked[(attacked["detector"] == each["detector"]) & (attacked["check"] == ANY)]
        assert not of_messages.duplicated(["receiver", "message"]).any()
        assert set(of_messages["truth"]) == {"false", "honest"}
        is_false = (of_messages["truth"] == "false").to_numpy()
        assert is_false.sum() == record["false_messages"]
        assert f1_score(is_false, of_messages["flagged"]) == pytest.approx(each["f1"])
        assert roc_auc_score(is_false, of_messages["score"]) == pytest.approx(each["auc"])
        assert each["roc_recalls"][-1] == each["roc_false_positive_rates"][-1] == 1.0


def test_a_message_is_flagged_if_any_check_flags_it(smoke: Path, offset: Path) -> None:
    (found,) = v2x_sections(smoke, [offset])
    frame = pq.read_table(BytesIO(found.files[VERDICTS_FILE])).to_pandas()
    key = ["bag", "receiver", "message", "detector"]
    checks = frame[frame["check"] != ANY].groupby(key, observed=True)["flagged"].any()
    whole = frame[frame["check"] == ANY].set_index(key)["flagged"]
    assert (checks == whole.reindex(checks.index)).all()
    assert len(checks) == len(whole)
    assert not frame["score"].isna().any()
