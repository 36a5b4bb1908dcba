"""HTML pages, in which text from others is escaped: neither HTML nor control characters get through."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape

from advpipe.pipeline.core.text import escape_unprintable


def rendered(template: str, filters: Mapping[str, Callable[..., Any]] | None = None, **values: Any) -> str:
    """The page that a Jinja template makes of the values; text that is not HTML yet is escaped.

    The filter `prose` shows what stands between backticks as code; filters: others, by name.
    """
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_without_controls,
    )
    environment.filters |= {"prose": _with_code, **(filters or {})}
    return environment.from_string(template).render(**values)


def _with_code(text: str) -> Markup:
    escaped = str(escape(escape_unprintable(text)))
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", escaped))


def _without_controls(value: Any) -> Any:
    return escape_unprintable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value
