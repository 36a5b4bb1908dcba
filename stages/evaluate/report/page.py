"""Pages of HTML, in which text from others is text alone: no HTML, and nothing that a terminal would obey."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, StrictUndefined

from advpipe.pipeline.core.text import escape_unprintable


def rendered(template: str, **values: Any) -> str:
    """The page that a Jinja template makes of the values; texts that are no HTML yet are escaped."""
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_without_controls,
    )
    return environment.from_string(template).render(**values)


def _without_controls(value: Any) -> Any:
    return escape_unprintable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value
