"""Pages: text of others is shown as it is written."""

from __future__ import annotations

import pytest
from jinja2 import UndefinedError

from advpipe.pipeline.core.html_page import rendered


def test_text_of_others_is_neither_html_nor_obeyed_by_a_terminal() -> None:
    page = rendered("<p>{{ name }}, {{ count }}</p>", name="\x1b[31m<b>é\u202e\n", count=3)
    assert page == "<p>\\x1b[31m&lt;b&gt;é\\u202e\n, 3</p>"


def test_code_in_prose() -> None:
    """What stands between backticks is code; the rest is escaped as everywhere."""
    page = rendered("{{ text | prose }}", text="use `--out <b>`, `a` & b`")
    assert page == "use <code>--out &lt;b&gt;</code>, <code>a</code> &amp; b`"


def test_html_stays_as_it_is() -> None:
    assert rendered("{{ '<b>' | safe }}{% for x in xs %}{{ x }}{% endfor %}", xs=["a", "b"]) == "<b>ab"


def test_a_missing_value_is_a_mistake() -> None:
    with pytest.raises(UndefinedError):
        rendered("{{ missing }}")
