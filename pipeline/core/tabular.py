"""Results that are tables: rows for programs, a DataFrame, one line of text, and HTML in a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

Rows = list[dict[str, object]]
"""A table: one mapping a row, from the names of its columns."""


class Tabular(ABC):
    """What a command made or found, as a table.

    Its `str` is what the command line prints of it, and the first line of that its `repr`. A dataclass that
    inherits from it is decorated with `repr=False`.
    """

    @abstractmethod
    def to_dicts(self) -> Rows:
        """The table's rows, each with all of its columns; units are in the columns' names."""

    def to_pandas(self) -> pd.DataFrame:
        """The same rows as a `pandas.DataFrame`. Raises UsageError where pandas is not installed."""
        return data_frame(self.to_dicts())

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {str(self).partition(chr(10))[0]}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the same line, and the table."""
        rows = self.to_dicts()
        heads = list(rows[0]) if rows else []
        return html_paragraph(self) + html_table(heads, [[row[head] for head in heads] for row in rows])


def data_frame(rows: Sequence[Mapping[str, object]]) -> pd.DataFrame:
    """The rows as a DataFrame; raises UsageError where pandas is not installed."""
    try:
        import pandas as pd
    except ImportError:
        raise UsageError(
            "to_pandas() needs pandas: pip install pandas; to_dicts() gives the same rows without it"
        ) from None
    return pd.DataFrame(list(rows))


def html_table(heads: Sequence[str], lines: Iterable[Iterable[object]], caption: str = "") -> str:
    """A table in HTML; nothing without heads. Cells are escaped, and empty where a value is None."""
    if not heads:
        return ""
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "".join(f"<tr>{''.join(f'<td>{_cell(value)}</td>' for value in line)}</tr>" for line in lines)
    return f"<table>{above}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_paragraph(text: object) -> str:
    """A paragraph in HTML; its line breaks are kept."""
    return f"<p>{escape(str(text)).replace(chr(10), '<br>')}</p>"


def _cell(value: object) -> str:
    if value is None:
        return ""
    return escape(f"{value:.6g}" if isinstance(value, float) else str(value))
