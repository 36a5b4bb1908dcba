"""All figures of an evaluation, and the document `report.json` that holds them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.tabular import Rows, Tabular, data_frame
from advpipe.pipeline.results.deprecated import with_deprecated_keys
from advpipe.pipeline.results.figures import Record
from advpipe.pipeline.results.listed import Listed
from advpipe.pipeline.results.origin import ResultsOrigin
from advpipe.pipeline.results.records import PrecisionRecord
from advpipe.pipeline.results.row import ResultRow

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "advpipe-report-2"
"""The version that `report.json` states; its JSON Schema is `docs/schemas/report-2.json`."""

SIGNIFICANT_DIGITS = 8


@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation(Tabular):
    """What a clean bag and adversarial ones showed.

    results: one an adversarial bag and detector, or one a detector for the clean bag alone.
    average_precision: one a bag, detector, condition (`clean`, `adv`, or a baseline's name), class, criterion
    and stratum. records: what families of attacks list, by key. formulas: what the figures mean. warnings:
    what must be read before any value.
    """

    results: tuple[ResultRow, ...]
    origin: ResultsOrigin
    formulas: Mapping[str, str]
    average_precision: tuple[PrecisionRecord, ...] = ()
    records: Mapping[str, Sequence[Listed]]
    warnings: tuple[str, ...] = ()

    @property
    def rows(self) -> tuple[Record, ...]:
        """The results as `report.json` has them: one key a figure."""
        return tuple(result.record() for result in self.results)

    def to_dicts(self, table: str = "rows") -> Rows:
        """One of the tables of `report.json`, with the same keys and units, without deprecated keys.

        table: `rows`, one an adversarial bag and detector; `average_precision`; or a key of `records`, such
        as `v2x`. None stands for what is undefined. Raises UsageError for a table that there is not.
        """
        listed = {"average_precision": self.average_precision, **self.records}
        if table != "rows" and table not in listed:
            raise UsageError(f"no table {table!r}; this report has {', '.join(['rows', *listed])}")
        rows = self.rows if table == "rows" else [each.record() for each in listed[table]]
        return [{key: plain_value(value) for key, value in row.items()} for row in rows]

    def to_pandas(self, table: str = "rows") -> pd.DataFrame:
        """The same table as a `pandas.DataFrame`. Raises UsageError where pandas is not installed."""
        return data_frame(self.to_dicts(table))

    def to_json(self) -> str:
        """The same text for the same figures: sorted keys, rounded numbers, null for what is undefined.

        The records of `average_precision` and of families take one line each.
        """
        listed = {"average_precision": self.average_precision, **self.records}
        current: Record = {
            "warnings": self.warnings,
            "formulas": self.formulas,
            "provenance": self.origin.record(),
            "rows": self.rows,
            "schema": SCHEMA,
            **{key: [each.record() for each in records] for key, records in listed.items()},
        }
        document = with_deprecated_keys(current)
        lists = "".join(f'\n  "{key}": {_one_a_line(document.pop(key))},' for key in sorted(listed))
        text = json.dumps(plain_value(document), indent=2, sort_keys=True, allow_nan=False)
        return f"{{{lists}{text[1:]}\n"


def _one_a_line(records: Sequence[Record]) -> str:
    lines = [json.dumps(plain_value(each), sort_keys=True, allow_nan=False) for each in records]
    return "[" + ",".join(f"\n    {line}" for line in lines) + "\n  ]"


def plain_value(value: object) -> object:
    """A value that JSON knows: numbers rounded to `SIGNIFICANT_DIGITS`, None for NaN."""
    if isinstance(value, Mapping):
        return {str(key): plain_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if np.isfinite(value) else None
    return value
