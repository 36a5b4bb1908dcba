"""Results that are tables: as rows, as a DataFrame, as one line of text, and as HTML in a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, object]]
"""A table: for each row, a mapping from the names of the columns to values."""


class Tabular(ABC):
    """The result of a command as a table.

    `str` is the text that the command line prints, and `repr` the first line of that text. A dataclass that
    inherits from this class must be decorated with `repr=False`.
    """

    @abstractmethod
    def to_dicts(self) -> Rows:
        """The rows of the table, each with all columns; the names of the columns state units."""

    def to_pandas(self) -> pd.DataFrame:
        """The same rows as a `pandas.DataFrame`. Raises UsageError where pandas is not installed."""
        return data_frame(self.to_dicts())

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {str(self).partition(chr(10))[0]}>"

    def _repr_html_(self) -> str:
        """The HTML that a notebook shows: the text of the result, and the table."""
        rows = self.to_dicts()
        heads = list(rows[0]) if rows else []
        return html_paragraph(self) + html_table(heads, [[row[head] for head in heads] for row in rows])


def data_frame(rows: Sequence[Mapping[str, object]]) -> pd.DataFrame:
    """The rows as a `pandas.DataFrame`. Raises UsageError where pandas is not installed."""
    try:
        import pandas as pd
    except ImportError:
        raise UsageError(
            "to_pandas() needs pandas: pip install pandas; to_dicts() gives the same rows without it"
        ) from None
    return pd.DataFrame(list(rows))


def html_table(heads: Sequence[str], lines: Iterable[Iterable[object]], caption: str = "") -> str:
    """A table in HTML, "" if there are no heads. Cells are escaped, and empty where a value is None."""
    if not heads:
        return ""
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "".join(f"<tr>{''.join(f'<td>{_cell(value)}</td>' for value in line)}</tr>" for line in lines)
    return f"<table>{above}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_paragraph(text: object) -> str:
    """A paragraph of escaped text in HTML; line breaks are kept."""
    return f"<p>{escape(str(text)).replace(chr(10), '<br>')}</p>"


def _cell(value: object) -> str:
    if value is None:
        return ""
    return escape(f"{value:.6g}" if isinstance(value, float) else str(value))
