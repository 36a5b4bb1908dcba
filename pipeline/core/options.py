"""Options that the command line and the API share: one frozen dataclass holds default, bound and help."""

from __future__ import annotations

from dataclasses import field, fields
from typing import Any

from advpipe.pipeline.core.errors import UsageError


def option(default: Any, help: str, *, least: int | None = None) -> Any:
    """A field of a frozen dataclass that is an option; least: its lowest value, or None for no bound."""
    return field(default=default, metadata={"help": help, "least": least})


def parser_options(model: type, name: str) -> dict[str, Any]:
    """The keyword arguments that an option parser takes for a field: `help`, and `min` if it has a bound.

    model: the dataclass; name: the field's name. Raises ValueError for a name that is not a field.
    """
    (found,) = (each for each in fields(model) if each.name == name)
    least = found.metadata["least"]
    return {"help": found.metadata["help"], **({} if least is None else {"min": least})}


def check_bounds(options: Any) -> None:
    """Raise UsageError for an option below its bound; to be called in `__post_init__`."""
    for each in fields(options):
        value, least = getattr(options, each.name), each.metadata.get("least")
        if least is not None and value is not None and value < least:
            name = each.name.replace("_", " ")
            verb = "are" if name.endswith("s") else "is"
            raise UsageError(f"{name} {verb} {value}, but must be {least} or more")


def device() -> Any:
    """The option that selects the device of the detector."""
    return option("cpu", "Device of the detector: cpu, cuda, or cuda:N for one of several GPUs.")


def lidar_topic() -> Any:
    """The option that selects one LiDAR of a bag by its topic."""
    return option(None, "Topic of the point clouds if there are several, such as /ego/lidar/points.")


def lidar_height_m() -> Any:
    """The option that says how high the LiDAR is mounted."""
    return option(
        None,
        "Height of the LiDAR above the ground, in metres, where it differs from the detector's: clouds are "
        "shifted for the detector.",
    )


def level() -> Any:
    """The option that levels each cloud for the detector."""
    return option(
        False,
        "Fit the ground in each cloud, and level and shift the cloud for the detector; a cloud without "
        "ground is only shifted, by the given height.",
    )


def scale_intensity() -> Any:
    """The option that scales intensities for the detector."""
    return option(
        1.0, "Multiply intensities by this for the detector, such as 0.00392157 for those from 0 to 255."
    )


def baseline_tries() -> Any:
    """The option that sets the query budget of the baseline random-best."""
    return option(None, "Tries that the baseline random-best judges; fewer are faster.", least=1)


def detector() -> Any:
    """The option that selects the detector."""
    return option("small", "small, pointpillars, centerpoint, a .safetensors file, or module:Class.")


def workers() -> Any:
    """The option that sets the number of processes."""
    return option(None, "Number of worker processes.", least=1)
