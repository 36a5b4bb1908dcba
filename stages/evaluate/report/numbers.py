"""Figures as people read them."""

from __future__ import annotations

NOTHING = "–"


def formatted_number(value: object, digits: int, suffix: str = "") -> str:
    """A figure with so many digits after the point; a dash for one that is undefined."""
    if not isinstance(value, float | int) or value != value:
        return NOTHING
    return f"{value:,.{digits}f}{suffix}"


def interval(value: object, digits: int = 1) -> str:
    """Such as `40.1…52.3`; a dash where there is none."""
    return f"{value[0]:.{digits}f}…{value[1]:.{digits}f}" if isinstance(value, tuple) else NOTHING


def with_interval(value: object, bounds: object, digits: int = 1) -> str:
    """Such as `46.2 (40.1…52.3)`; the figure alone where there is no interval."""
    text = formatted_number(value, digits)
    return f"{text} ({interval(bounds, digits)})" if isinstance(bounds, tuple) else text


def short_name(detector: object) -> str:
    """A detector's name where there is little room: the class alone of `module:Class`."""
    return str(detector).rpartition(":")[2]
