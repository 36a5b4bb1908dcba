"""Text of others in a page of Markdown: shown as it is written, never as Markdown or HTML of its own."""

from __future__ import annotations

import json
import re
from urllib.parse import quote

_MARKS = re.compile(r"[\\`*\[\]|~]|(?<![^\W_])_|_(?![^\W_])")
"""An underscore between letters is no mark."""

_BEGINNING = re.compile(r"^(\s?)(?:([#+=-])(?=[#+= -]*(?:\s|$))|(\d+)(?=[.)](?:\s|$)))")
"""What makes a line a heading, an item of a list, or a rule."""

_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", "$": "&#36;", "://": "&#58;//", "www.": "www&#46;"}
"""HTML; formulas and links without marks, which hosts of such pages make on their own."""

_ENTITY = re.compile("|".join(re.escape(word) for word in _ENTITIES), re.IGNORECASE)


class Markdown(str):
    """Text that is Markdown already."""

    __slots__ = ()


def escaped(value: object) -> Markdown:
    """A value as text on one line, also in a cell of a table; Markdown as it is."""
    if isinstance(value, Markdown):
        return value
    text = _MARKS.sub(lambda found: f"\\{found.group()}", _line(value))
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
    """What the author of a data set wrote about it in Markdown; as a block of code where it holds HTML."""
    from markdown_it import MarkdownIt

    tokens = MarkdownIt("commonmark").enable("table").parse(text)
    kinds = {part.type for token in tokens for part in (token, *(token.children or ()))}
    return block(text) if kinds & {"html_block", "html_inline"} else Markdown(text)


def _line(value: object) -> str:
    words = re.sub(r"\s+", " ", str(value))
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in words)


def _without_beginning(found: re.Match[str]) -> str:
    space, mark, number = found.groups()
    return f"{space}\\{mark}" if mark else f"{space}{number}\\"


def _fenced(text: str, body: str, least: int) -> Markdown:
    """Between more backticks than there are one after the other in it."""
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    fence = "`" * max(least, longest + 1)
    return Markdown(f"{fence}{body}{fence}")
