"""Results as tables: rows, a data frame, one line, and HTML."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.tabular import Rows, Tabular, html_table


@dataclass(frozen=True, repr=False)
class Counted(Tabular):
    """How often each word came."""

    counts: dict[str, float | None]

    def __str__(self) -> str:
        return f"{len(self.counts)} words\nand more"

    def to_dicts(self) -> Rows:
        return [{"word": word, "share": share} for word, share in self.counts.items()]


COUNTED = Counted({"<b>": 0.1234567891, "c": None})


def test_results_have_a_one_line_repr_and_html() -> None:
    assert repr(COUNTED) == "<Counted 2 words>"
    assert COUNTED._repr_html_() == (
        "<p>2 words<br>and more</p><table><thead><tr><th>word</th><th>share</th></tr></thead><tbody>"
        "<tr><td>&lt;b&gt;</td><td>0.123457</td></tr><tr><td>c</td><td></td></tr></tbody></table>"
    )
    assert Counted({})._repr_html_() == "<p>0 words<br>and more</p>"
    assert html_table(["a"], [[1]], "<").startswith("<table><caption>&lt;</caption><thead>")


def test_rows_become_a_data_frame() -> None:
    frame = COUNTED.to_pandas()
    assert list(frame.columns) == ["word", "share"]
    assert frame["share"].to_list()[0] == 0.1234567891
    assert frame["share"].isna().to_list() == [False, True]


def test_without_pandas_the_error_states_the_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match="pip install pandas") as caught:
        COUNTED.to_pandas()
    assert "\n" not in str(caught.value)
    assert COUNTED.to_dicts()[0]["word"] == "<b>"
