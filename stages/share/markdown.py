"""Escaping of untrusted text in Markdown: it is shown literally, never rendered as Markdown or HTML."""

from __future__ import annotations

import json
import re
from urllib.parse import quote

_SPECIAL = re.compile(r"[\\`*\[\]|~]|(?<![^\W_])_|_(?![^\W_])")
"""An underscore between letters needs no escape."""

_BEGINNING = re.compile(r"^(\s?)(?:([#+=-])(?=[#+= -]*(?:\s|$))|(\d+)(?=[.)](?:\s|$)))")
"""The start of a line that is a heading, a list item, or a rule."""

_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", "$": "&#36;", "://": "&#58;//", "www.": "www&#46;"}
"""HTML, formulas, and bare links, which some hosts turn into links."""

_ENTITY = re.compile("|".join(re.escape(text) for text in _ENTITIES), re.IGNORECASE)


class Markdown(str):
    """Text that is Markdown already."""

    __slots__ = ()


def escaped(value: object) -> Markdown:
    """A value as text on one line, also in a cell of a table; Markdown as it is."""
    if isinstance(value, Markdown):
        return value
    text = _SPECIAL.sub(lambda found: f"\\{found.group()}", _line(value))
    text = _BEGINNING.sub(_without_beginning, text)
    return Markdown(_ENTITY.sub(lambda found: _ENTITIES[found.group().lower()], text))


def code(value: object) -> Markdown:
    """A value between backticks, also in a cell of a table."""
    text = _line(value).strip().replace("|", "\\|") or " "
    return _fenced(text, f" {text} " if "`" in text else text, 1)


def block(value: object) -> Markdown:
    """Several lines as a block of code."""
    text = "".join(sign for sign in str(value) if sign.isprintable() or sign in "\n\t")
    return _fenced(text, f"\n{text}\n", 3)


def link(place: str) -> Markdown:
    """A path in the data set, as the target of a link."""
    return Markdown(quote(place))


def literal(value: str) -> Markdown:
    """A text as Python writes it in a program."""
    text = str(value)
    return Markdown(json.dumps(text) if text.isascii() else ascii(text))


def authors_text(text: str) -> Markdown:
    """The author's Markdown text about a data set; as a code block if it contains HTML."""
    from markdown_it import MarkdownIt

    tokens = MarkdownIt("commonmark").enable("table").parse(text)
    token_types = {part.type for token in tokens for part in (token, *(token.children or ()))}
    return block(text) if token_types & {"html_block", "html_inline"} else Markdown(text)


def _line(value: object) -> str:
    line = re.sub(r"\s+", " ", str(value))
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in line)


def _without_beginning(found: re.Match[str]) -> str:
    space, mark, number = found.groups()
    return f"{space}\\{mark}" if mark else f"{space}{number}\\"


def _fenced(text: str, body: str, least: int) -> Markdown:
    """The body between fences that are longer than any run of backticks in the text."""
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    fence = "`" * max(least, longest + 1)
    return Markdown(f"{fence}{body}{fence}")
