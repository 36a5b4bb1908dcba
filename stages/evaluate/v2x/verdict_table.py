"""`verdicts.parquet`: what each check of each misbehaviour detector says of each received message."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.pipeline.misbehaviour.scores import Bools
from advpipe.pipeline.misbehaviour.verdicts import CheckVerdicts
from advpipe.stages.evaluate.v2x.detection import ListenerVerdicts

VERDICTS_FILE = "verdicts.parquet"
ANY = "any"
"""In place of a check: the verdict on the message, and the score of the ROC curve."""
FALSE, HONEST = "false", "honest"

_CATEGORY = pa.dictionary(pa.int32(), pa.string())
VERDICT_SCHEMA = pa.schema(
    [
        ("bag", _CATEGORY),
        ("receiver", _CATEGORY),
        ("message", pa.uint64()),
        ("arrival_ns", pa.int64()),
        ("detector", _CATEGORY),
        ("check", _CATEGORY),
        ("score", pa.float64()),
        ("flagged", pa.bool_()),
        ("truth", _CATEGORY),
    ]
)
"""message: its number in /v2x/sent; null where the bag does not record it. check: or `ANY`. score: larger for
what is less plausible; a check that does not apply to a message has no row. truth: `FALSE` or `HONEST`; null
where the message does not count."""


class VerdictTable:
    """Writes the table bag by bag; `content` is the file's, after the context."""

    def __init__(self) -> None:
        self._file = BytesIO()
        self.content = b""

    def __enter__(self) -> VerdictTable:
        self._writer = pq.ParquetWriter(self._file, VERDICT_SCHEMA, compression="zstd")
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()
        self.content = self._file.getvalue()

    def add(self, bag: str, verdicts: Sequence[ListenerVerdicts]) -> None:
        """Add the rows of all listeners of a bag, by detector, check and arrival."""
        for each in verdicts:
            for detector, check, judged in _checks(each):
                self._writer.write_table(_rows(bag, each, detector, check, judged))


def _checks(each: ListenerVerdicts) -> Iterator[tuple[str, str, CheckVerdicts]]:
    for name, found in each.detectors.items():
        yield name, ANY, CheckVerdicts(found.scores, found.flagged)
        for check, judged in found.checks.items():
            yield name, check, judged


def _rows(bag: str, each: ListenerVerdicts, detector: str, check: str, judged: CheckVerdicts) -> pa.Table:
    kept = ~np.isnan(judged.scores)
    numbers = [number for number, is_kept in zip(each.numbers, kept, strict=True) if is_kept]
    count = len(numbers)
    columns = [
        _repeated(bag, count),
        _repeated(each.listener, count),
        pa.array(numbers, pa.uint64()),
        pa.array(np.array(each.arrivals_ns, np.int64)[kept]),
        _repeated(detector, count),
        _repeated(check, count),
        pa.array(np.asarray(judged.scores[kept], np.float64)),
        pa.array(judged.flagged[kept]),
        _truths(each.is_false[kept], each.is_scored[kept]),
    ]
    return pa.Table.from_arrays(columns, schema=VERDICT_SCHEMA)


def _truths(is_false: Bools, is_scored: Bools) -> Any:
    places = pa.array(np.where(is_false, 0, 1).astype(np.int32), mask=~is_scored)
    return pa.DictionaryArray.from_arrays(places, pa.array([FALSE, HONEST]))


def _repeated(text: str, count: int) -> Any:
    return pa.DictionaryArray.from_arrays(np.zeros(count, np.int32), pa.array([text]))
