"""Options that the command line and the API take from one frozen model: default, bounds and help."""

from __future__ import annotations

from dataclasses import field, fields
from typing import Any

from advpipe.pipeline.core.errors import UsageError


def option(default: Any, help: str, *, least: int | None = None) -> Any:
    """A field of a frozen dataclass that is an option; least: its lowest value, None for no bound."""
    return field(default=default, metadata={"help": help, "least": least})


def parser_options(model: type, name: str) -> dict[str, Any]:
    """What an option parser is told of a field: `help`, and `min` if it has a bound."""
    (found,) = (each for each in fields(model) if each.name == name)
    least = found.metadata["least"]
    return {"help": found.metadata["help"], **({} if least is None else {"min": least})}


def check_bounds(options: Any) -> None:
    """Raises UsageError for an option below its bound; call it in `__post_init__`."""
    for each in fields(options):
        value, least = getattr(options, each.name), each.metadata.get("least")
        if least is not None and value is not None and value < least:
            name = each.name.replace("_", " ")
            verb = "are" if name.endswith("s") else "is"
            raise UsageError(f"{name} {verb} {value}, but must be {least} or more")


def device() -> Any:
    return option("cpu", "Where the detector computes: cpu, cuda, or cuda:N of several GPUs.")


def lidar_topic() -> Any:
    return option(None, "Topic of the point clouds if there are several, such as /ego/lidar/points.")


def baseline_tries() -> Any:
    return option(
        None, "Random draws of the baseline; the best of them is scored too; 1: a single draw.", least=1
    )


def detector() -> Any:
    return option("small", "A shipped name, a .safetensors file, or module:Class.")


def workers() -> Any:
    return option(None, "Number of worker processes.", least=1)
